"""Plates that close on a breast: load steps, damped Newton iterations, rest, starts from coarser meshes."""

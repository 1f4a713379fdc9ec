"""Hexahedral block meshes of the breast: building, quality, refinement and location of points.

Source: paper, section II-A (transfinite interpolation, Gordon and Hall).
"""

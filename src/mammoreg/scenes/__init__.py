"""Synthetic breasts between plates, for studies of the solver: bodies, tissue, scenes, and checks from outside."""

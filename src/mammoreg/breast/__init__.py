"""A patient's breast between plates: the mechanics that are chosen for it, and its model in the plate frame."""

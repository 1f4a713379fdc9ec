"""Projection of the deformed breast onto the mammogram's detector, and comparison with the mammogram."""

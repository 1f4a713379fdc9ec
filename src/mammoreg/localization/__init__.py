"""Localisation: carrying lesions and landmarks between the MR volume, the mammograms and a compressed MR volume."""

"""Stage `segment`: breast, tissues, chest wall and nipple in the MR volume."""

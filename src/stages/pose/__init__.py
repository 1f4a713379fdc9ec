"""Stage `pose`: where the breast lay between the plates."""

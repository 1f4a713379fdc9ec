"""Stage `compress`: the breast between two rigid plates."""

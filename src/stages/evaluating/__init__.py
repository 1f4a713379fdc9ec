"""Comparisons of stage `evaluate`, one module per table; here alone predictions meet the truth."""

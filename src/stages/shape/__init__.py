"""Stage `shape`: the 3-D surface that meets the mammogram's outline."""

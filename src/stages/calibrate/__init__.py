"""Stage `calibrate`: tissue stiffness against the measured range of plate forces."""

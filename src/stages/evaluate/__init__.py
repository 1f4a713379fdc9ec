"""Stage `evaluate`: predictions against the truth that the tables name."""

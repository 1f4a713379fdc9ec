"""Stage `tables`: the cohort's tables."""

"""Studies: targets of their own, which run stages on variations of a cohort."""

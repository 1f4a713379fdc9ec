"""Stage `digital`: a patient of the embedded digital cohort."""

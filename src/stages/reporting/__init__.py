"""What stage `report` puts on its page: one module for the cohort, one for a case, one for texts about the run."""

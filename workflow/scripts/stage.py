"""Bridge from a rule to the stage of the same name."""

from stages.engine.bridge import run_job

run_job(snakemake)  # noqa: F821

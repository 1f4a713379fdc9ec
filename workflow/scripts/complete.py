"""Bridge from rule `complete` to the check that no case failed."""

from stages.engine.bridge import run_complete

run_complete(snakemake)  # noqa: F821

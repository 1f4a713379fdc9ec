"""The command `mammoreg`, and `python -m stages`: what a user types, and what is said while and after a run."""

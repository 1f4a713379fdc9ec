"""Readers of the files that a user's tables name."""

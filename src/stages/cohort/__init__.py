"""The user's tables and files: read, and checked before the first job."""

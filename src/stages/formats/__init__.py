"""Writers of files that other programs open, one a format."""

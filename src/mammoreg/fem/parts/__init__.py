"""What acts on a body beside its elements and plates: its back, ties, gravity."""

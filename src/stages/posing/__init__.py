"""Parts of the stage `pose`."""

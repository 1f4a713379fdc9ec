"""The three directions of stage `localize`, one module each; none knows the marks of another."""

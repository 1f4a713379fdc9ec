"""Three-dimensional shape of the compressed breast from a simulated compression and the outline in the image."""

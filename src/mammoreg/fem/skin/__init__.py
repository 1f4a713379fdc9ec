"""The four skin models: membranes, and the interface between a membrane and the tissue under it."""

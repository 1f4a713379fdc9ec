"""Stage `project`: X-ray projection of the deformed MR volume."""

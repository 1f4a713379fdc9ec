"""Image analysis: MR segmentation and the reading of mammograms, on arrays."""

"""Pose of a view: silhouettes and outlines, plates, scaling, projection angle and imaged portion."""

"""Measures of a registration, and the paper's own results.

A lesion's centre is the centroid of its mask, in a mammogram of the projected mask's pixels. Distances in a mammogram
are those on the detector divided by the magnification at the middle of the plates. Overlap is the paper's, the share
of the true lesion that the prediction covers. The region in the MR volume is where the back-projected areas of two
views meet; where they do not, the point is midway between the beams at their closest approach and the overlap is 0.
"""

"""Mammograms: DICOM and pictures, with how they were taken."""

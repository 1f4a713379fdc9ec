"""Lesions and landmarks: tables, masks, DICOM SEG, 3D Slicer."""

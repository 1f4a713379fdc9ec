"""MR volumes: NIfTI files, and folders of DICOM as they come."""

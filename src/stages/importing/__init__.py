"""From a folder of DICOM, as a PACS exports it, to the two tables."""

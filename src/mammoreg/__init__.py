"""mammoreg: registration of X-ray mammograms and MR volumes of the breast, numerics on arrays.

Units are mm, N, kPa and degrees throughout. Nothing here knows of files, HDF5, Snakemake or configuration.
"""

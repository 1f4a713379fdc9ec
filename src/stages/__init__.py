"""The pipeline's stages: each turns settings and inputs into one artefact with the numerics of `mammoreg`.

In order: segment, mesh, calibrate, pose, compress, shape, solve, project, localize, evaluate, figures; then tables and
report for the cohort.
"""

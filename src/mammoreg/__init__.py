"""mammoreg: registration of X-ray mammograms and MR volumes of the breast, on arrays.

From arrays to a lesion's place and back, in patient coordinates (LPS, mm) and stored pixels (column, row):

* `Volume`: an axis-aligned volume and its frame; `volume_of_affine` makes one of voxels and an affine.
* `Breast`: the undeformed breast of an MR volume, segmented and meshed; `Breast.of_mr`.
* `Mammogram`: pixels, pixel spacing, view, and what is known of how they were taken.
* `register`: a mammogram with a breast, a `RegisteredView`: `to_mammogram` carries points of the MR volume into the
  image, `to_mr` a pixel to its curve in the MR volume, `mark` and `mark_mask` mark a lesion there.
* `locate`: the place of a lesion marked in one or two views, `Located`.
* `BreastMechanics`, `PoseSearch`: what may be chosen otherwise.
* `DataError`, `NotConvergedError`: data that cannot be used, and numerics without an answer.

What stands behind, each with its own docstring:

* `mammoreg.geometry`: frames, volumes, the geometry of a view; `mammoreg.labels`: codes of tissues.
* `mammoreg.imaging`: segmentation of MR volumes, analysis of mammograms; `mammoreg.meshing`: hexahedra of a breast.
* `mammoreg.materials`, `mammoreg.contact`, `mammoreg.fem`: laws of tissue, plates, the finite element solver.
* `mammoreg.breast`: a breast between plates; `mammoreg.pose`: where a view shows it; `mammoreg.shape`: its outline met.
* `mammoreg.localization`, `mammoreg.projection`: lesions both ways, and what a detector would show.
* `mammoreg.metrics`, `mammoreg.plots`: measures and pictures.
* `mammoreg.phantom`, `mammoreg.scenes`: digital patients by another mechanics, and test scenes for the solver.

Units are mm, N, kPa and degrees throughout. Nothing here knows of files, HDF5, Snakemake or configuration.
"""

from importlib import import_module
from typing import Any

__version__ = "0.1.0"

# Loaded when asked for, so that `import mammoreg` costs nothing; types for checkers stand in `__init__.pyi`.
_HOMES = {
    "Breast": "registration",
    "BreastMechanics": "breast.mechanics",
    "DataError": "errors",
    "Located": "registration",
    "Mammogram": "imaging.acquisition",
    "NotConvergedError": "errors",
    "PoseSearch": "pose.search",
    "RegisteredView": "registration",
    "Volume": "geometry",
    "locate": "registration",
    "register": "registration",
    "volume_of_affine": "geometry",
}

__all__ = [
    "Breast",
    "BreastMechanics",
    "DataError",
    "Located",
    "Mammogram",
    "NotConvergedError",
    "PoseSearch",
    "RegisteredView",
    "Volume",
    "__version__",
    "locate",
    "register",
    "volume_of_affine",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'mammoreg' has no attribute {name!r}; it offers {', '.join(__all__)}")
    return getattr(import_module(f"mammoreg.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})

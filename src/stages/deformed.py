"""What speaks against a deformed mesh, as values of `compress`, `shape` and `solve`."""

import numpy as np

from mammoreg.arrays import Points
from mammoreg.geometry import breast_to_lps, breast_to_plate
from mammoreg.meshing.quality import folded_corners
from mammoreg.meshing.trilinear import volumes
from mammoreg.metrics.drift import sideways_drift_mm
from stages.engine.artefact import Value
from stages.mesh.record import MeshRecord

FORCE_VALUES = ("force_n", "force_lower_n", "force_upper_n", "contact_lost")
MESH_VALUES = ("folded_corners", "folded_share", "folded_corner_points", "sideways_drift_mm")
LOST_SHARE = 0.05
"""A plate that presses with less than this share of the other's force has lost its contact; chosen."""


def mesh_values(mesh: MeshRecord, deformed: Points, angle_deg: float) -> dict[str, Value]:
    """Folded corners and sideways drift of nodes (N, 3), plate frame, mm.

    `folded_corners` counts the corners of elements whose Jacobian is not positive, `folded_share` is the share of
    elements with one, `folded_corner_points` are their places in the undeformed breast (LPS, mm).
    """
    block = mesh.block
    hexes = block.hexes()
    folded = folded_corners(deformed[hexes])
    before = breast_to_plate(block.points, angle_deg)
    drift = sideways_drift_mm(before, deformed, hexes, volumes(block.points[hexes]), block.back_nodes())
    places = breast_to_lps(block.points[hexes[folded]], mesh.laterality)
    rounded = [[round(float(x), 2) for x in place] for place in places]
    found = (int(folded.sum()), float(folded.any(axis=1).mean()), rounded, drift)
    return dict(zip(MESH_VALUES, found, strict=True))


def force_values(force_n: tuple[float, float]) -> dict[str, Value]:
    """Forces of the lower and the upper plate, and whether one of them has lost the breast."""
    lower, upper = force_n
    lost = bool(np.less_equal(min(force_n), LOST_SHARE * max(force_n)))
    return dict(zip(FORCE_VALUES, (0.5 * (lower + upper), lower, upper, lost), strict=True))

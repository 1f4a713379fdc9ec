"""A breast between plates as `compress`, `shape` or `solve` leaves it: what speaks against it, and how it is read."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from mammoreg.arrays import Points
from mammoreg.fem.report import SolveReport
from mammoreg.geometry import breast_to_lps, breast_to_plate
from mammoreg.meshing.quality import folded_corners
from mammoreg.meshing.trilinear import volumes
from mammoreg.metrics.drift import sideways_drift_mm
from stages.engine.artefact import Value
from stages.engine.record import Record
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


def report_values(report: SolveReport | None) -> dict[str, Value]:
    """What an artefact keeps of a solve's report: all but wall times, which differ from run to run."""
    if report is None:
        return {}
    return {
        "iterations": report.iterations,
        "load_steps": report.steps,
        "cut_steps": report.cuts,
        "unbalance": report.unbalance,
        "energy_mj": report.isochoric_mj,
        "volumetric_energy_mj": report.volumetric_mj,
        "part_energies_mj": dict(report.parts_mj),
        "min_det_f": report.min_det_f,
        "volume_change": report.volume_change,
    }


def seconds_text(report: SolveReport | None) -> str:
    """Where the time of a solve went, for the log."""
    if report is None:
        return "no report of the solve"
    parts = ", ".join(f"{name} {seconds:.2f}" for name, seconds in report.seconds.items())
    return f"{report.iterations} Newton iterations in {report.steps} load steps; seconds: {parts}"


class SolutionRecord(Record):
    """The breast between the plates as one of the stages with mechanics has solved it."""

    @property
    def deformed(self) -> Points:
        """Mesh nodes (N, 3), plate frame, mm."""
        return np.asarray(self.artefact.array("deformed", "mm"), dtype=float)

    @property
    def force_n(self) -> float | None:
        """Mean force of both plates, which balance but for the back's share."""
        forces = [self._given(f"force_{plate}_n") for plate in ("lower", "upper")]
        known = [float(force) for force in forces if force is not None]
        return sum(known) / len(known) if known else None

    @property
    def min_det_f(self) -> float | None:
        """Smallest volume ratio at an integration point."""
        return self._number("min_det_f")

    @property
    def thickness_mm(self) -> float:
        """Distance of the plates."""
        return float(self.artefact.value("thickness_mm"))

    @property
    def penetration_mm(self) -> float | None:
        """Deepest point of skin or back inside a plate."""
        return self._number("penetration_mm")

    @property
    def folded_corners(self) -> int | None:
        """Corners of elements that are turned inside out."""
        count = self._given("folded_corners")
        return None if count is None else int(count)

    @property
    def folded_share(self) -> float | None:
        """Share of the elements with a folded corner."""
        return self._number("folded_share")

    @property
    def sideways_drift_mm(self) -> float | None:
        """Mean sideways motion of the breast over its back."""
        return self._number("sideways_drift_mm")

    @property
    def plate_forces_n(self) -> tuple[float, float]:
        """Forces of the lower and the upper plate."""
        lower, upper = (float(self.artefact.value(f"force_{plate}_n")) for plate in ("lower", "upper"))
        return lower, upper

    @property
    def contact_lost(self) -> bool:
        """Whether one plate has lost the breast."""
        return bool(self._given("contact_lost", False))

    def facts(self) -> dict[str, Value]:
        """What a stage keeps that takes over the solution as it is."""
        names = ("penetration_mm", "volume_change", "min_det_f", *FORCE_VALUES, *MESH_VALUES)
        return {name: self.artefact.value(name) for name in names}

    def report(self) -> Mapping[str, Any]:
        """What the solve came to, by name."""
        names = ("force_n", "iterations", "load_steps", "min_det_f", "volume_change")
        return {name: self.artefact.value(name) for name in names}

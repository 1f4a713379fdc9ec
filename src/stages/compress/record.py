"""What stage `compress` leaves: the breast between two plates, whole enough for other stages to go on from it."""

from dataclasses import asdict, dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mammoreg.arrays import Points
from mammoreg.breast.compression import Compression
from mammoreg.breast.mechanics import BreastMechanics
from mammoreg.breast.placed import PlacedBreast, closing_plates, place_breast
from mammoreg.contact.soft import SoftMemory
from mammoreg.fem.plates.closing import Closed, Closing, ClosingOptions
from mammoreg.fem.plates.state import DampedState
from mammoreg.geometry import ViewGeometry
from mammoreg.meshing.block import BlockMesh
from stages.engine.artefact import Array, Artefact, Fields, Value
from stages.mechanics import Mechanics
from stages.mesh.record import MeshRecord
from stages.solution import SolutionRecord, force_values, mesh_values, report_values

GLAND_SHARE = "gland_fraction"
"""Name of the shares of gland, here and in exported meshes."""
_MEMORY = {
    "anchor": ("mm", "contact points at the last step, each plate"),
    "traction": ("kPa", "friction, each plate"),
    "pressure": ("kPa", "contact pressure, each plate"),
    "shift": ("mm", "shift of contact points' distances, each plate"),
}
_MEMBRANE = "membrane"


@dataclass(frozen=True)
class FloatingFrame:
    """The plate frame as the numerics have it: a floating breast, whose plates come to lie where its back takes them.

    Attributes:
        lift_mm: how far above there the pose has seen the plates.
    """

    lift_mm: float

    def to_plate(self, points: Points) -> Points:
        """Points (..., 3) of this frame in the plate frame, mm."""
        return np.asarray(points + self._lift)

    def from_plate(self, points: Points) -> Points:
        """Points (..., 3) of the plate frame in this one, mm."""
        return np.asarray(points - self._lift)

    @property
    def _lift(self) -> Points:
        return np.array([0.0, 0.0, self.lift_mm])

    def view(self, view: ViewGeometry) -> ViewGeometry:
        """A view of the plate frame in this one."""
        return replace(view, height_mm=view.height_mm - self.lift_mm)


@dataclass(frozen=True)
class CompressFields:
    """What is to be kept of a compression.

    Attributes:
        closed: the breast between the plates, in the floating frame.
        prepared: the breast and the plates before they closed.
        view: of the pose, whose plates the result is lifted to.
        mesh: undeformed.
        mechanics, mu_kpa, gland: with which the breast was placed.
    """

    closed: Closed
    prepared: Compression
    view: ViewGeometry
    mesh: MeshRecord
    mechanics: Mechanics
    mu_kpa: float
    gland: NDArray[np.float64] | None

    def fields(self) -> Fields:
        """The artefact's contents."""
        closed, frame = self.closed, FloatingFrame(self.view.height_mm - self.closed.height_mm)
        deformed = frame.to_plate(closed.deformed)
        arrays = {
            "deformed": Array(deformed, "mm", "mesh nodes between the plates, plate frame", "plate"),
            "residuals": Array(np.array(closed.residuals), "1", "unbalanced over internal forces, each iteration"),
            **_state_arrays(closed, frame),
        }
        if self.gland is not None:
            arrays[GLAND_SHARE] = Array(self.gland, "1", "gland's share of each hexahedron")
        return Fields(
            arrays=arrays,
            values=closing_report(closed)
            | mesh_values(self.mesh, deformed, self.view.angle_deg)
            | self._setting(frame),
        )

    def _setting(self, frame: FloatingFrame) -> dict[str, Value]:
        return {
            "height_mm": self.view.height_mm,
            "lift_mm": frame.lift_mm,
            "known_lower_mm": self.prepared.closing.lower_mm,
            "raised_mm": self.closed.state.height,
            "uncompressed_mm": self.prepared.closing.uncompressed_mm,
            "compression": self.prepared.share,
            "stiffness_ratio": self.prepared.breast.stiffness_ratio,
            "mechanics": self.mechanics.plain(),
            "options": asdict(self.prepared.closing.options),
            "mu_kpa": self.mu_kpa,
            "angle_deg": self.view.angle_deg,
            "edge_p_mm": self.view.edge_p_mm,
        }


def closing_report(closed: Closed) -> dict[str, Value]:
    """What happened in a compression."""
    return {
        "thickness_mm": closed.gap_mm,
        **force_values(closed.force_n),
        "cut_steps": closed.cuts,
        "last_motion_mm": closed.restless_mm,
        "penetration_mm": closed.penetration_mm,
        **report_values(closed.report),
    }


def memory_arrays(memory: SoftMemory) -> dict[str, Array]:
    """What contact points remember, as arrays of an artefact; empty ones are left out."""
    kept = {f.name: getattr(memory, f.name) for f in fields(SoftMemory)}
    return {f"contact/{n}": Array(data, *_MEMORY[n]) for n, data in kept.items() if data.size}


def kept_memory(artefact: Artefact) -> SoftMemory:
    """What contact points remember; an array is empty where the contact does not need it."""
    names, held = {name: f"contact/{name}" for name in _MEMORY}, artefact.names()
    kept = {n: artefact.array(key, _MEMORY[n][0]) for n, key in names.items() if key in held}
    return SoftMemory(**{f.name: kept.get(f.name, np.zeros(0)) for f in fields(SoftMemory)})


def _state_arrays(closed: Closed, frame: FloatingFrame) -> dict[str, Array]:
    """The state from which `CompressRecord.resumed` goes on."""
    kept = memory_arrays(closed.state.memory)
    kept["pressure"] = Array(closed.state.pressure, "kPa", "element pressures, positive in tension")
    if closed.extra is not None:
        kept[_MEMBRANE] = Array(
            frame.to_plate(closed.extra), "mm", "nodes of the skin's own membrane, plate frame", "plate"
        )
    return kept


class CompressRecord(SolutionRecord):
    """A compression, from which later stages go on."""

    @property
    def mechanics(self) -> BreastMechanics:
        """Tissue, plates and back."""
        return Mechanics.model_validate(self.artefact.value("mechanics")).numerics()

    @property
    def frame(self) -> FloatingFrame:
        """The frame of the numerics."""
        return FloatingFrame(float(self.artefact.value("lift_mm")))

    @property
    def angle_deg(self) -> float:
        """Projection angle."""
        return float(self.artefact.value("angle_deg"))

    @property
    def raised_mm(self) -> float:
        """Height of the plates in the floating frame above the middle of first touch."""
        return float(self.artefact.value("raised_mm"))

    @property
    def compression(self) -> float:
        """Share of the thickness between the plates that they have taken away."""
        return float(self.artefact.value("compression"))

    @property
    def stiffness_ratio(self) -> float:
        """Shear modulus at the compression over the initial one."""
        return float(self.artefact.value("stiffness_ratio"))

    @property
    def mu_kpa(self) -> float:
        """Shear modulus of the homogeneous tissue."""
        return float(self.artefact.value("mu_kpa"))

    @property
    def pressure(self) -> NDArray[np.float64]:
        """Element pressures (E,), kPa, positive in tension."""
        return self.artefact.array("pressure", "kPa")

    @property
    def gland_share(self) -> NDArray[np.float64] | None:
        """Gland's share of each element (E,), None where the material did not ask for it."""
        return self.artefact.array(GLAND_SHARE, "1") if GLAND_SHARE in self.artefact.names() else None

    def placed(self, mesh: BlockMesh) -> PlacedBreast:
        """The breast as it was before the plates closed."""
        return place_breast(mesh, self.angle_deg, self.mechanics, self.mu_kpa, self.gland_share, self.compression)

    def closing(self, breast: PlacedBreast) -> Closing:
        """The plates around the breast that `placed` gives."""
        value = self.artefact.value
        options = replace(ClosingOptions(), **_options(value("options")))
        return closing_plates(breast, float(value("edge_p_mm")), self.mechanics, options, value("known_lower_mm"))

    def resumed(self, mesh: BlockMesh) -> tuple[Closing, Closed]:
        """The plates and the breast between them as the stage left them, in the floating frame."""
        value, closing = self.artefact.value, self.closing(self.placed(mesh))
        state = self._state(closing)
        membrane = None if closing.extra_nodes is None else state.positions[-len(closing.extra_nodes) :]
        closed = Closed(
            deformed=state.positions[: len(closing.model.points)],
            height_mm=value("height_mm") - self.frame.lift_mm,
            gap_mm=self.thickness_mm,
            force_n=(value("force_lower_n"), value("force_upper_n")),
            iterations=0,
            steps=0,
            cuts=0,
            residuals=[],
            restless_mm=value("last_motion_mm"),
            min_det_f=value("min_det_f"),
            volume_change=value("volume_change"),
            penetration_mm=value("penetration_mm"),
            energy_mj=value("energy_mj"),
            state=state,
            extra=membrane,
        )
        return closing, closed

    def _state(self, closing: Closing) -> DampedState:
        nodes = [self.artefact.array(n, "mm") for n in ("deformed", _MEMBRANE) if n in self.artefact.names()]
        positions = self.frame.from_plate(np.concatenate(nodes))
        return DampedState(
            positions,
            self.pressure,
            self.raised_mm,
            kept_memory(self.artefact),
            tuple(part.renewed(positions) for part in closing.parts),
        )


def _options(kept: dict[str, Any]) -> dict[str, Any]:
    known = asdict(ClosingOptions())
    return {name: value for name, value in kept.items() if name in known}

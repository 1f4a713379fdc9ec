"""The closing plates of stage `compress` as an object, built anew from artefacts by the stages that go on from it."""

from dataclasses import asdict, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mammoreg.breast.mechanics import BreastMechanics
from mammoreg.breast.placed import PlacedBreast, closing_plates, place_breast
from mammoreg.contact.soft import SoftMemory
from mammoreg.fem.plates.closing import Closed, Closing, ClosingOptions
from mammoreg.fem.plates.state import DampedState
from stages.compress.gland_map import kept_gland_share
from stages.engine.artefact import Artefact
from stages.engine.contract import Array, Value
from stages.mechanics import Mechanics
from stages.methods import block_mesh

Floats = NDArray[np.float64]
_MEMORY = {
    "anchor": ("mm", "contact points at the last step, each plate"),
    "traction": ("kPa", "friction, each plate"),
    "pressure": ("kPa", "contact pressure, each plate"),
    "shift": ("mm", "shift of contact points' distances, each plate"),
}
_MEMBRANE = "membrane"


def placed_again(mesh: Artefact, compress: Artefact) -> PlacedBreast:
    """The breast as `compress` had it before the plates closed."""
    mechanics = _kept_mechanics(compress)
    angle_deg, mu_kpa = float(compress.value("angle_deg")), float(compress.value("mu_kpa"))
    gland, compression = kept_gland_share(compress), float(compress.value("compression"))
    return place_breast(block_mesh(mesh), angle_deg, mechanics, mu_kpa, gland, compression)


def kept_values(
    mechanics: Mechanics, options: ClosingOptions, mu_kpa: float, angle_deg: float, edge_p_mm: float
) -> dict[str, Value]:
    """What later stages need to know of a compression."""
    return {
        "mechanics": mechanics.plain(),
        "options": asdict(options),
        "mu_kpa": mu_kpa,
        "angle_deg": angle_deg,
        "edge_p_mm": edge_p_mm,
    }


def _kept_mechanics(compress: Artefact) -> BreastMechanics:
    return Mechanics.model_validate(compress.value("mechanics")).numerics()


def kept_arrays(closed: Closed, lift: Floats) -> dict[str, Array]:
    """The state of a breast between plates, from which `resumed` goes on; `lift` (3,) takes it to the pose's plates."""
    kept = memory_arrays(closed.state.memory)
    kept["pressure"] = Array(closed.state.pressure, "kPa", "element pressures, positive in tension")
    if closed.extra is not None:
        kept[_MEMBRANE] = Array(closed.extra + lift, "mm", "nodes of the skin's own membrane, plate frame")
    return kept


def memory_arrays(memory: SoftMemory) -> dict[str, Array]:
    """What contact points remember, as arrays of an artefact; empty ones are left out."""
    kept = {f.name: getattr(memory, f.name) for f in fields(SoftMemory)}
    return {f"contact/{n}": Array(data, *_MEMORY[n]) for n, data in kept.items() if data.size}


def kept_memory(artefact: Artefact) -> SoftMemory:
    """What contact points remember; an array is empty where the contact does not need it."""
    names = {name: f"contact/{name}" for name in _MEMORY}
    kept = {n: artefact.array(key, _MEMORY[n][0]) for n, key in names.items() if key in artefact.names()}
    return SoftMemory(**{f.name: kept.get(f.name, np.zeros(0)) for f in fields(SoftMemory)})


def closing_again(breast: PlacedBreast, compress: Artefact) -> Closing:
    """The plates as `compress` had them around the breast that `placed_again` gives."""
    mechanics = _kept_mechanics(compress)
    options = replace(ClosingOptions(), **_options(compress.value("options")))
    edge_p_mm = float(compress.value("edge_p_mm"))
    return closing_plates(breast, edge_p_mm, mechanics, options, compress.value("known_lower_mm"))


def resumed(mesh: Artefact, compress: Artefact) -> tuple[Closing, Closed]:
    """The plates and the breast between them as `compress` left them, in the floating breast's own height."""
    closing = closing_again(placed_again(mesh, compress), compress)
    state = _kept_state(compress, closing)
    membrane = None if closing.extra_nodes is None else state.positions[-len(closing.extra_nodes) :]
    closed = Closed(
        deformed=state.positions[: len(closing.model.points)],
        height_mm=compress.value("height_mm") - compress.value("lift_mm"),
        gap_mm=compress.value("thickness_mm"),
        force_n=(compress.value("force_lower_n"), compress.value("force_upper_n")),
        iterations=0,
        steps=0,
        cuts=0,
        residuals=[],
        restless_mm=compress.value("last_motion_mm"),
        min_det_f=compress.value("min_det_f"),
        volume_change=compress.value("volume_change"),
        penetration_mm=compress.value("penetration_mm"),
        energy_mj=compress.value("energy_mj"),
        state=state,
        extra=membrane,
    )
    return closing, closed


def _kept_state(compress: Artefact, closing: Closing) -> DampedState:
    lift = np.array([0.0, 0.0, compress.value("lift_mm")])
    nodes = [compress.array(n, "mm") for n in ("deformed", _MEMBRANE) if n in compress.names()]
    positions = np.concatenate(nodes) - lift
    return DampedState(
        positions,
        compress.array("pressure", "kPa"),
        compress.value("raised_mm"),
        kept_memory(compress),
        tuple(part.renewed(positions) for part in closing.parts),
    )


def _options(kept: dict[str, Any]) -> dict[str, Any]:
    known = asdict(ClosingOptions())
    return {name: value for name, value in kept.items() if name in known}

"""Plates that close on coarse blocks first: their answer, interpolated, leaves a few iterations on the fine one."""

import logging
from dataclasses import replace

import numpy as np
from scipy.spatial import cKDTree

from mammoreg.arrays import Floats, Integers
from mammoreg.contact.soft import SoftMemory
from mammoreg.errors import NotConvergedError
from mammoreg.fem.elements.model import HyperelasticModel
from mammoreg.fem.linear.hierarchy import Hierarchy, block_size, interpolate_elements, interpolation
from mammoreg.fem.parts.back import BackCondition
from mammoreg.fem.plates.closing import Closed, Closing
from mammoreg.fem.plates.state import DampedState
from mammoreg.fem.plates.untangle import untangled
from mammoreg.materials.elastic import ElasticMaterial
from mammoreg.meshing.block import BlockMesh

COARSEST = 8  # elements a side up to which a mesh is closed on its own
NEAREST_POINTS = 4
LEAST_START_DET = 0.02  # an interpolated start that squeezes an element further is not used
HEALED_DET = 0.1  # what interpolation squeezes further is healed
WIDER_FACTOR = 0.6  # load factor, to start from instead

_log = logging.getLogger(__name__)


def close_nested(closing: Closing, gap_mm: float) -> list[Closed]:
    """Close the plates to a gap on coarser and coarser blocks, then on the body itself.

    Only homogeneous structure can be made coarser: bodies that are no structured block, or with parts or extra nodes,
    are closed as they are. So is a mesh on which the start from a coarser one fails.

    Args:
        closing: the body and its plates; all faces of the block but its back may touch.
        gap_mm: where the plates end.

    Returns:
        the bodies between the plates, from the coarsest to the one asked for.

    Raises:
        NotConvergedError: with the reason and how far the plates came.
    """
    n = block_size(closing.model.hexes)
    if n is None or closing.parts or closing.extra_nodes is not None:
        return [closing.close(gap_mm)]
    levels = [*(coarsened(closing, n, size) for size in nested_sizes(n)[:-1]), closing]
    found: list[Closed] = []
    for coarse, fine in zip([None, *levels], levels, strict=False):
        found.append(_closed(coarse, fine, found, gap_mm))
    return found


def nested_sizes(n: int) -> list[int]:
    """Elements a side from the coarsest mesh to n."""
    sizes = [n]
    while sizes[0] > COARSEST:
        whole = [sizes[0] // k for k in (2, 3) if sizes[0] % k == 0]
        sizes.insert(0, whole[0] if whole else round(sizes[0] / 2))
    return sizes


def coarsened(closing: Closing, n: int, size: int) -> Closing:
    """The plates around the same body with `size` instead of n elements a side.

    Its elements have the material of the element around their centre, its back the condition of the nearest node.
    """
    block = BlockMesh(size, interpolation(size, n) @ closing.model.points)
    model = HyperelasticModel(block.points, block.hexes(), _coarse_material(closing.model.material, n, size))
    back = _coarse_back(closing.back, Hierarchy(n, size), block)
    lower, options = closing.lower_mm, closing.options
    return Closing(model, block.skin_quads(), back, closing.edge, closing.lip, closing.contact.friction, options, lower)


def _coarse_material(material: ElasticMaterial, n: int, size: int) -> ElasticMaterial:
    """The material of the element around the centre of each coarse one."""
    return material.part(interpolate_elements(np.arange(n**3), size, n))


def _closed(coarse: Closing | None, fine: Closing, found: list[Closed], gap_mm: float) -> Closed:
    """Let a body rest where the coarser one does or, where that fails, close the plates on it."""
    if coarse is not None:
        try:
            return _resumed(coarse, fine, found[-1]) or _half_resumed(coarse, fine, gap_mm)
        except NotConvergedError as error:
            _log.info("the start from a coarser mesh fails: %s", error)
    return fine.close(gap_mm)


def _resumed(coarse: Closing, fine: Closing, closed: Closed) -> Closed | None:
    """A body at rest where the coarser one is; None: its elements would be turned inside out there."""
    start = _carried(closed, coarse, fine)
    if fine.model.determinants(start.positions).min() < LEAST_START_DET:
        return None
    return fine.resume(start, closed.gap_mm)


def _half_resumed(coarse: Closing, fine: Closing, gap_mm: float) -> Closed:
    """A body started from the coarser one at a wider gap, then closed further."""
    wider = coarse.uncompressed_mm + WIDER_FACTOR * (gap_mm - coarse.uncompressed_mm)
    half = _resumed(coarse, fine, coarse.close(wider))
    if half is None:
        raise NotConvergedError("elements of a coarser mesh's answer turn inside out on the finer one")
    whole = fine.further(half, gap_mm)
    residuals = [*half.residuals, *whole.residuals]
    return replace(whole, iterations=len(residuals), steps=half.steps + 1, residuals=residuals)


def _carried(closed: Closed, coarse: Closing, fine: Closing) -> DampedState:
    """The state of a coarse body as one of a fine body."""
    many, few = (block_size(closing.model.hexes) for closing in (fine, coarse))
    assert many is not None
    assert few is not None
    moved = fine.points + interpolation(many, few) @ (closed.deformed - coarse.points)
    held, anchors = np.zeros(moved.shape, dtype=bool), fine.points.copy()
    held[fine.back.nodes] = fine.back.held
    anchors[fine.back.nodes] += fine.back.pull_mm
    positions = untangled(fine.model, np.where(held, anchors, moved), held, HEALED_DET)
    pressure = interpolate_elements(closed.state.pressure, many, few)
    return DampedState(positions, pressure, closed.state.height, _carried_memory(closed, coarse, fine, positions))


def _carried_memory(closed: Closed, coarse: Closing, fine: Closing, positions: Floats) -> SoftMemory:
    """What the contact points remember, from those nearest on the undeformed skin."""
    plates, height, old = fine.plates(closed.gap_mm), closed.state.height, closed.state.memory
    memory = fine.contact.start(positions, plates, height)
    if fine.contact.friction == 0.0:
        return memory
    there, here = (c.contact.surface.positions(c.points).reshape(-1, 3) for c in (coarse, fine))
    distance, nearest = cKDTree(there).query(here, NEAREST_POINTS)
    weights = 1.0 / (np.asarray(distance) + 1e-9)
    weights /= weights.sum(axis=1, keepdims=True)

    def carried(values: Floats) -> Floats:
        flat = values.reshape(len(plates), len(there), -1)
        mixed = np.einsum("nk,pnkc->pnc", weights, flat[:, nearest])
        return np.asarray(mixed.reshape(len(plates), *memory.pressure.shape[1:], *values.shape[3:]))

    slip = old.anchor - coarse.contact.start(closed.deformed, plates, height).anchor
    return replace(
        memory,
        anchor=memory.anchor + carried(slip),
        traction=carried(old.traction),
        pressure=carried(old.pressure),
    )


def _coarse_back(back: BackCondition, grids: Hierarchy, block: BlockMesh) -> BackCondition:
    """A back's condition on a coarser block: that of coincident nodes, springs by the area of a node."""
    index: Integers = np.full(grids.nodes, -1)
    index[back.nodes] = np.arange(len(back.nodes))
    nodes = np.arange(len(block.points))
    place = index[grids.coincident()]
    nodes, place = nodes[place >= 0], place[place >= 0]
    larger = (grids.fine / grids.coarse) ** 2
    return BackCondition(nodes, back.held[place], larger * back.springs[place], back.pull_mm)

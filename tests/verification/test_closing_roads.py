"""Two roads to a closed breast, `Closing.close` and `close_nested`, against the limit of small load steps.

Coulomb's friction remembers the way: of all equilibria at a gap, closing slowly leads to one, the limit of ever smaller
load steps. Without friction no way is remembered, and both roads must end alike.
"""

from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from mammoreg.fem.plates.closing import ClosingOptions
from mammoreg.fem.plates.nested import close_nested
from mammoreg.materials.elastic import neo_hookean
from tests.unit.breast_block import breast_block, breast_closing

pytestmark = pytest.mark.slow
ELEMENTS, FRICTION, FINEST = 10, 0.46, 64
GAP_MM, EDGE_MM = 55.0, -15.0
MILD_GAP_MM, MILD_EDGE_MM = 66.0, -5.0


def _off_mm(a: NDArray[np.float64], b: NDArray[np.float64]) -> float:
    """Mean distance of nodes (N, 3)."""
    return float(np.linalg.norm(a - b, axis=1).mean())


@cache
def _closed(road: str, steps: int) -> NDArray[np.float64]:
    """Nodes (N, 3) over the lower plate, mm, of a breast with a stiff lump, closed by half against friction."""
    block = breast_block(ELEMENTS)
    centre = block.points[block.hexes()].mean(axis=1)
    lump = np.linalg.norm(centre - [15.0, -35.0, 10.0], axis=1) < 25.0
    material = neo_hookean(np.where(lump, 3.4, 1.0), 0.495)
    closing = breast_closing(ELEMENTS, material, ClosingOptions(steps=steps), FRICTION, EDGE_MM)
    closed = closing.close(GAP_MM) if road == "close" else close_nested(closing, GAP_MM)[-1]
    return closed.deformed - np.array([0.0, 0.0, closed.height_mm])


def test_smaller_load_steps_converge_where_friction_remembers_the_way() -> None:
    limit = _closed("close", FINEST)
    off = [_off_mm(_closed("close", steps), limit) for steps in (8, 16, 32)]
    assert off[0] > off[1] > off[2]
    assert off[2] < 0.25 * off[0]


def test_start_from_a_coarser_mesh_converges_to_something_else() -> None:
    """Four times the steps on the coarse mesh hardly move the answer, and not to the limit."""
    limit, few, many = _closed("close", FINEST), _closed("nested", 32), _closed("nested", 128)
    assert _off_mm(many, limit) > 2.0 * _off_mm(_closed("close", 32), limit)
    assert _off_mm(many, limit) > 0.8 * _off_mm(few, limit)
    assert _off_mm(many, few) < 0.25 * _off_mm(many, limit)


def test_without_friction_both_roads_end_alike() -> None:
    options = ClosingOptions(steps=8)
    direct, nested = (breast_closing(ELEMENTS, None, options, 0.0, MILD_EDGE_MM) for _ in range(2))
    one, other = direct.close(MILD_GAP_MM), close_nested(nested, MILD_GAP_MM)[-1]
    assert np.abs(one.deformed - other.deformed).max() < 0.01
    assert one.force_n == pytest.approx(other.force_n, rel=1e-4)

"""Closing on coarse blocks first against closing at once."""

import numpy as np
import pytest

from mammoreg.fem.plates import nested as fem_nested
from mammoreg.fem.plates.closing import ClosingOptions
from mammoreg.fem.plates.nested import close_nested, coarsened, nested_sizes
from mammoreg.fem.plates.untangle import untangled
from mammoreg.materials.elastic import neo_hookean
from tests.unit.breast_block import HEIGHT_MM, UNDAMPED, breast_block, breast_closing

COARSE_DEFAULT = ClosingOptions(steps=4, rule="nodes")


def test_sizes_divide_one_another_where_they_can() -> None:
    assert nested_sizes(42) == [7, 21, 42]
    assert nested_sizes(28) == [7, 14, 28]
    assert nested_sizes(21) == [7, 21]
    assert nested_sizes(7) == [7]
    assert nested_sizes(13) == [6, 13]


@pytest.mark.parametrize("percent", [21, 50])
def test_a_few_iterations_remain_on_the_fine_mesh(percent: int) -> None:
    gap = HEIGHT_MM * (1.0 - 0.01 * percent)
    nested, direct = close_nested(breast_closing(14), gap), breast_closing(14).close(gap)
    assert [len(closed.deformed) for closed in nested] == [8**3, 15**3]
    assert np.abs(nested[-1].deformed - direct.deformed).max() < 2.0 * UNDAMPED.tolerance_mm
    assert nested[-1].force_n == pytest.approx(direct.force_n, rel=1e-3)
    assert nested[-1].iterations <= 7
    assert nested[-1].iterations < 0.6 * direct.iterations


@pytest.mark.parametrize(("healing", "steps"), [(True, 1), (False, 2)])
def test_start_that_turns_elements_over_is_healed_or_made_at_a_wider_gap(
    healing: bool, steps: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    if not healing:
        monkeypatch.setattr(fem_nested, "untangled", lambda _model, positions, _held, _least: positions)
    gap = 0.5 * HEIGHT_MM
    nested, direct = close_nested(breast_closing(12), gap), breast_closing(12).close(gap)
    assert nested[-1].steps == steps
    assert nested[-1].iterations == len(nested[-1].residuals) < direct.iterations
    assert np.abs(nested[-1].deformed - direct.deformed).max() < UNDAMPED.tolerance_mm


def test_displacements_that_turn_elements_over_are_healed_around_them() -> None:
    model = breast_closing(6).model
    positions = model.points * [1.2, 1.2, 0.7]
    wanted = positions.copy()
    positions[171] += [40.0, 0.0, 0.0]  # the middle
    assert model.determinants(positions).min() < 0.0
    held = np.zeros(positions.shape, dtype=bool)
    healed = untangled(model, positions, held, 0.1)
    assert model.determinants(healed).min() > 0.1
    np.testing.assert_allclose(healed, wanted, atol=1e-9)  # small strains keep what is affine around them
    np.testing.assert_array_equal(untangled(model, wanted, held, 0.1), wanted)


def test_heterogeneous_breast_with_friction_between_ending_plates() -> None:
    centre = breast_block(10).points[breast_block(10).hexes()].mean(axis=1)
    mu = np.where(np.linalg.norm(centre - [0.0, -30.0, 0.0], axis=1) < 25.0, 8.0, 1.0)
    nested, direct = (
        breast_closing(10, neo_hookean(mu, 0.49), COARSE_DEFAULT, friction=0.3, edge_p_mm=-5.0) for _ in range(2)
    )
    found, expected = close_nested(nested, 80.0)[-1], direct.close(80.0)
    assert np.abs(found.deformed - expected.deformed).max() < 1.5  # friction remembers the coarse body's way
    assert found.force_n[0] == pytest.approx(expected.force_n[0], rel=0.05)


def test_coarse_body_keeps_shape_material_and_back() -> None:
    mu = np.repeat([1.0, 5.0], 4 * 64)
    fine = breast_closing(8, neo_hookean(mu, 0.49))
    coarse = coarsened(fine, 8, 4)
    np.testing.assert_allclose(coarse.model.points, fine.model.points.reshape(9, 9, 9, 3)[::2, ::2, ::2].reshape(-1, 3))
    np.testing.assert_array_equal(coarse.model.material.mu_kpa, np.repeat([1.0, 5.0], 32))
    assert coarse.uncompressed_mm == pytest.approx(fine.uncompressed_mm)
    assert coarse.back.held.all(axis=1).sum() == 1
    assert coarse.back.held[:, 1].all()

"""Plates with an end that close on a small breast: lips, back conditions, mirror, limits and failures."""

import numpy as np
import pytest
from numpy.typing import NDArray

from mammoreg.contact.plate import Plate
from mammoreg.contact.surface import ContactSurface
from mammoreg.errors import NotConvergedError
from mammoreg.fem.elements.model import HyperelasticModel
from mammoreg.fem.parts.back import BackName, back_condition
from mammoreg.fem.plates.closing import COARSE, Closed, Closing, ClosingOptions
from mammoreg.materials.elastic import neo_hookean
from mammoreg.meshing.block import BlockMesh
from tests.unit.fe_bodies import block

EDGE, GAP = 5.0, 55.0


def breast(n: int = 4) -> BlockMesh:
    """A rounded body, 70 mm deep, that stands a little askew; its back is the plane of posterior 35 mm."""
    mesh = block(n, (2.0, 1.0, 2.0))
    x, z = mesh.points[:, 0], mesh.points[:, 2]
    deep = 0.5 - mesh.points[:, 1]
    round_off = 1.0 - 0.1 * (x * z) ** 2
    narrow = np.sqrt(1.0 - 0.6 * deep**2)
    medial, height = 50.0 * x * round_off * narrow, 42.0 * z * round_off * narrow
    bulge = 1.0 - 0.1 * (x**2 + z**2)
    return BlockMesh(n, np.stack([medial + 5.0 * deep, 35.0 - 70.0 * deep * bulge, height - 8.0 * deep**2], axis=1))


def closing(
    mesh: BlockMesh,
    name: BackName = "slide_compression",
    friction: float = 0.3,
    options: ClosingOptions | None = None,
    pull: NDArray[np.float64] | None = None,
) -> Closing:
    model = HyperelasticModel(mesh.points, mesh.hexes(), neo_hookean(9.4, 0.495))
    back = back_condition(name, mesh.points, mesh.back_quads(), pull_mm=pull)
    return Closing(model, mesh.skin_quads(), back, EDGE, 8.0, friction, options)


@pytest.fixture(scope="module")
def closed() -> Closed:
    return closing(breast()).close(GAP)


def test_nothing_passes_the_plates_in_front_of_their_lips_and_tissue_behind_is_free(closed: Closed) -> None:
    mesh = breast()
    points = ContactSurface(mesh.points, mesh.skin_quads(), "gauss3").positions(closed.deformed).reshape(-1, 3)
    for plate in (Plate(closed.height_mm, 1, EDGE, 8.0), Plate(closed.height_mm + GAP, -1, EDGE, 8.0)):
        distance = plate.gap(points).distance
        assert distance[points[:, 1] < EDGE - 8.0].min() > -0.3
        assert distance.min() > -2.0, "faces may bridge the lip, not pass it"
    behind = closed.deformed[:, 1] > EDGE + 10.0
    assert np.ptp(closed.deformed[behind, 2]) > GAP + 15.0


def test_forces_balance_and_volume_is_kept(closed: Closed) -> None:
    assert closed.force_n[0] == pytest.approx(closed.force_n[1], rel=1e-3)
    assert 1.0 < closed.force_n[0] < 200.0
    assert abs(closed.volume_change) < 0.01
    assert closed.min_det_f > 0.3


def test_mirrored_breast_gives_the_mirrored_answer(closed: Closed) -> None:
    mesh = breast()
    order = mesh.node_grid()[::-1].transpose(2, 1, 0).ravel()
    mirrored = closing(BlockMesh(mesh.n, (mesh.points * [-1.0, 1.0, 1.0])[order])).close(GAP)
    np.testing.assert_allclose(mirrored.deformed, (closed.deformed * [-1.0, 1.0, 1.0])[order], atol=0.02)


def test_again_is_identical(closed: Closed) -> None:
    np.testing.assert_array_equal(closing(breast()).close(GAP).deformed, closed.deformed)


@pytest.mark.parametrize("name", ["fixed", "slide_compression", "slide_plane", "springs"])
def test_back_conditions_hold_what_they_promise(name: BackName) -> None:
    mesh = breast()
    moved = (closing(mesh, name).close(GAP).deformed - mesh.points)[mesh.back_nodes()]
    assert np.abs(moved[:, 1]).max() < 0.3, "the back of this breast is a plane"
    if name in ("fixed", "slide_compression"):
        assert np.abs(moved[:, 0]).max() < 1e-9
    if name == "fixed":
        assert np.abs(moved[:, 2]).max() < 1e-9
    if name in ("slide_plane", "springs"):
        assert np.abs(moved[:, 0]).max() > 1.0


def test_shear_layer_lets_the_back_slide_along_the_chest_wall_by_its_softness() -> None:
    mesh = breast()
    model = HyperelasticModel(mesh.points, mesh.hexes(), neo_hookean(9.4, 0.495))
    ways = []
    for shear in (0.1, 1.0, 1000.0):
        back = back_condition("shear_layer", mesh.points, mesh.back_quads(), along_kpa_per_mm=shear)
        deformed = Closing(model, mesh.skin_quads(), back, EDGE, 8.0, 0.3).close(GAP).deformed
        moved = (deformed - mesh.points)[mesh.back_nodes()]
        np.testing.assert_allclose(moved[:, 1], 0.0, atol=1e-12)
        ways.append(np.abs(moved[:, [0, 2]]).max(axis=0))
    softest, middle, stiffest = ways
    assert (softest > middle).all()
    assert (middle > stiffest).all()
    assert stiffest.max() < 0.05, "a stiff layer is a fixed back"


def test_pull_moves_the_back() -> None:
    mesh = breast()
    pulled = closing(mesh, pull=np.array([0.0, -6.0, 0.0])).close(GAP).deformed - mesh.points
    np.testing.assert_allclose(pulled[mesh.back_nodes(), 1], -6.0)


def test_pulled_springs_draw_the_back_along_with_the_load_steps() -> None:
    mesh = breast()
    closed = closing(mesh, "springs", pull=np.array([0.0, -6.0, 0.0])).close(GAP)
    moved = (closed.deformed - mesh.points)[mesh.back_nodes(), 1]
    np.testing.assert_allclose(moved, -6.0, atol=0.5)
    assert closed.report is not None
    assert closed.report.unbalance < 1e-3
    assert closed.report.parts_mj["BackSprings"] > 0.0


def test_coarse_options_are_near_the_fine_ones(closed: Closed) -> None:
    coarse = closing(breast(), options=COARSE).close(GAP)
    shift = closed.height_mm - coarse.height_mm
    assert np.abs(coarse.deformed + np.array([0.0, 0.0, shift]) - closed.deformed).mean() < 1.5


def test_soft_contact_alone_lets_more_pass(closed: Closed) -> None:
    soft = closing(breast(), options=ClosingOptions(contact_factors=())).close(GAP)
    assert closed.penetration_mm < 0.5 * soft.penetration_mm
    assert closed.iterations < 2 * soft.iterations


def test_breast_that_damping_alone_has_stopped_is_not_at_rest() -> None:
    """Heavy damping keeps a step below any tolerance while plates that came nearer still push the tissue."""
    mesh = breast(3)
    rested = closing(mesh).close(GAP)
    assert rested.report is not None
    assert rested.report.unbalance < 1e-4
    closer = closing(mesh).further(rested, GAP - 1.0)
    assert closer.force_n[0] > 1.02 * rested.force_n[0]
    damped = closing(mesh, options=ClosingOptions(damping=1e4, rests=1))
    with pytest.raises(NotConvergedError, match="balance"):
        damped.further(rested, GAP - 1.0)


def test_plates_wider_than_the_breast_are_refused() -> None:
    with pytest.raises(NotConvergedError, match="does not compress a breast"):
        closing(breast()).close(300.0)


def test_impossible_compression_ends_with_a_reason() -> None:
    with pytest.raises(NotConvergedError, match="plates came to|come to rest|passes the plates"):
        closing(breast(3), "fixed").close(0.5)

"""Flips between stored and canonical mammograms."""

from functools import cache

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mammoreg.errors import DataError
from mammoreg.geometry.frames import plate_rotation
from mammoreg.imaging.mammogram import analyse
from mammoreg.imaging.mammogram_canonical import canonicalise
from mammoreg.imaging.mammogram_frame import without_frame
from mammoreg.imaging.mammogram_orientation import Flips, flips_of_orientation, orientation_of_flips
from mammoreg.imaging.views import PROJECTIONS, VIEWS
from tests.unit.mammogram_images import PIXEL_MM, breast_image


@pytest.mark.parametrize(
    ("orientation", "laterality", "view", "rows", "columns"),
    [
        ("A\\R", "L", "CC", False, False),
        ("P\\L", "R", "CC", False, True),
        ("A\\FR", "L", "MLO", False, False),
        ("P\\FL", "R", "MLO", False, True),
        ("A\\L", "R", "CC", False, False),
        ("A\\FL", "R", "MLO", False, False),
        ("P\\HR", "R", "MLO", True, True),
        ("A\\L", "L", "CC", True, False),
        ("A\\F", "L", "MLO", False, False),
        ("A\\H", "R", "MLO", True, False),
        ("p\\fl", "R", "MLO", False, True),
        ("PL\\L", "R", "CC", False, True),
        ("A\\F", "L", "ML", False, False),
        ("P\\FL", "R", "ML", False, True),
        ("P\\FR", "R", "ML", False, True),
        ("A\\F", "L", "LM", True, False),
        ("P\\H", "R", "LM", False, True),
        ("A\\HL", "L", "LMO", False, False),
        ("P\\FL", "R", "LMO", True, True),
        ("A\\R", "L", "FB", True, False),
        ("P\\R", "R", "FB", False, True),
        ("A\\R", "L", "XCCL", False, False),
        ("P\\L", "R", "XCCM", False, True),
    ],
)
def test_flips_of_the_contract(orientation, laterality, view, rows, columns):
    assert flips_of_orientation(orientation, laterality, view) == Flips(rows, columns)


@pytest.mark.parametrize("view", VIEWS)
@pytest.mark.parametrize("laterality", ["L", "R"])
def test_orientation_of_flips_is_read_back_as_these_flips(laterality, view):
    for flips in (Flips(rows, columns) for rows in (False, True) for columns in (False, True)):
        assert flips_of_orientation(orientation_of_flips(flips, laterality, view), laterality, view) == flips


def test_rows_as_usually_stored_follow_the_plate_frame_towards_medial():
    # Contract: (-s cos a, 0, -sin a) in LPS, s = +1 for a left breast; the breast frame mirrors x of a left breast.
    angle = np.deg2rad(37.0)
    for s in (1.0, -1.0):
        in_lps = np.array([-s * np.cos(angle), 0.0, -np.sin(angle)])
        in_breast = in_lps * np.array([-s, 1.0, 1.0])
        assert plate_rotation(37.0)[0] == pytest.approx(in_breast)


@pytest.mark.parametrize(
    ("orientation", "laterality", "view", "words"),
    [
        ("L\\P", "R", "CC", "antero-posterior"),
        ("A", "R", "CC", "pair of directions"),
        ("A\\X", "R", "CC", "pair of directions"),
        ("AP\\L", "R", "CC", "pair of directions"),
        ("A\\F", "R", "CC", "does not tell"),
        ("A\\FL", "L", "MLO", "contradicts"),
    ],
)
def test_orientation_that_cannot_be_used_names_itself(orientation, laterality, view, words):
    with pytest.raises(DataError, match=words) as caught:
        flips_of_orientation(orientation, laterality, view)
    assert repr(orientation) in str(caught.value)


@given(st.booleans(), st.booleans(), st.integers(2, 9), st.integers(2, 9))
def test_flips_undo_themselves_and_pixels_follow_the_image(rows, columns, height, width):
    flips, image = Flips(rows, columns), np.arange(height * width).reshape(height, width)
    flipped = flips.apply(image)
    assert np.array_equal(flips.apply(flipped), image)
    places = np.array([[width - 1, 0], [0, height - 1], [1, 1]], dtype=float)
    moved = flips.apply_to_pixels(places, (height, width)).astype(int)
    assert np.array_equal(flipped[moved[:, 1], moved[:, 0]], image[places[:, 1].astype(int), places[:, 0].astype(int)])


@pytest.mark.parametrize(("rows", "columns"), [(False, False), (True, False), (False, True), (True, True)])
@pytest.mark.parametrize("dark", [False, True])
@pytest.mark.parametrize("laterality", ["L", "R"])
def test_every_storage_gives_the_same_canonical_image(rows, columns, dark, laterality):
    image = breast_image()
    stored = Flips(rows, columns).apply(4095.0 - image if dark else image)
    medial, lateral = ("R", "L") if laterality == "L" else ("L", "R")
    orientation = f"{'P' if columns else 'A'}\\{lateral if rows else medial}"
    photometric = "MONOCHROME1" if dark else "MONOCHROME2"
    got = canonicalise(stored, laterality, "CC", orientation=orientation, photometric=photometric)
    assert got.flips == Flips(rows, columns)
    assert got.estimated == ()
    offset = got.pixels - image
    assert np.ptp(offset) < 1e-2


def test_image_edge_that_contradicts_the_orientation_is_refused():
    with pytest.raises(DataError, match="shows air"):
        canonicalise(breast_image(), "R", "CC", orientation="P\\L")


@pytest.mark.parametrize(("dark", "told"), [(True, "MONOCHROME2"), (False, "MONOCHROME1")])
def test_polarity_that_contradicts_the_air_is_refused(dark, told):
    stored = 4095.0 - breast_image() if dark else breast_image()
    with pytest.raises(DataError, match=f"PhotometricInterpretation is {told}"):
        canonicalise(stored, "R", "CC", orientation="A\\L", photometric=told)


def _framed(image, sides, value):
    framed = image.copy()
    for side, width in sides.items():
        turned = {"top": framed, "bottom": framed[::-1], "left": framed.T, "right": framed.T[::-1]}[side]
        turned[:width] = value
        turned[2:6, 100:115] = 300.0  # a letter
    return framed


@cache
def _outline():
    return analyse(breast_image(noise=0.0), PIXEL_MM, "CC").outline


@pytest.mark.parametrize(
    ("sides", "dark"),
    [
        ({"right": 12}, False),
        ({"top": 15, "right": 9}, True),
        ({"top": 20, "bottom": 20, "right": 15}, False),
        ({"top": 12, "bottom": 8, "right": 30, "left": 6}, True),
    ],
)
def test_frame_of_a_scanned_film_is_no_air(sides, dark):
    image = breast_image(noise=0.0)
    film = _framed(4095.0 - image if dark else image, sides, 0.0 if dark else 4095.0)
    got = canonicalise(film, "L", "CC", photometric="MONOCHROME1" if dark else "MONOCHROME2")
    found = analyse(got.pixels, PIXEL_MM, "CC")
    assert not got.flips.columns
    skin = found.outline[found.outline_weight >= 1.0]
    gap = np.linalg.norm(skin[:, None] - _outline()[None], axis=2).min(axis=1) * PIXEL_MM
    assert gap.max() < 0.3


def test_image_without_a_frame_is_left_as_it_is():
    image = breast_image()
    assert np.array_equal(without_frame(image), image)


def test_without_orientation_the_air_tells_the_chest_wall():
    image = breast_image()
    got = canonicalise(image[:, ::-1], "R", "CC", photometric="MONOCHROME2")
    assert got.estimated == ("orientation",)
    assert np.array_equal(got.pixels, image)


def test_blank_margin_at_the_chest_wall_does_not_pass_for_the_nipple_side():
    image = breast_image(noise=0.0)
    image[:, :12] = 40.0
    assert not canonicalise(image, "L", "CC", photometric="MONOCHROME2").flips.columns


def test_unprocessed_data_become_attenuation():
    attenuation = breast_image(noise=0.0, air=0.0) / 1000.0
    exposure = 12000.0 * np.exp(-attenuation)
    got = canonicalise(exposure, "L", "CC", orientation="A\\R", photometric="MONOCHROME1", linear=True)
    assert np.allclose(got.pixels, attenuation, atol=1e-4)


@pytest.mark.parametrize("value", [0.0, np.nan])
def test_image_without_breast_is_refused(value):
    noise = np.random.default_rng(0).normal(100.0, 2.0, (200, 150))
    noise[50, 50] = value if np.isnan(value) else noise[50, 50]
    with pytest.raises(DataError, match="not finite" if np.isnan(value) else "no breast"):
        canonicalise(noise, "L", "CC")


def test_constant_image_is_refused():
    with pytest.raises(DataError, match="no breast"):
        canonicalise(np.full((200, 150), 7), "L", "CC")


@pytest.mark.parametrize("view", VIEWS)
@pytest.mark.parametrize("laterality", ["L", "R"])
def test_letters_of_the_canonical_rows_follow_the_plate_frame(view, laterality):
    """Rows follow (-s cos a, 0, -sin a) in LPS; what of it stands out is what the orientation's letters say."""
    angle, s = np.deg2rad(PROJECTIONS[view].angle_deg), 1.0 if laterality == "L" else -1.0
    x, z = -s * np.cos(angle), -np.sin(angle)
    letters = "".join(letter for letter, share in (("L", x), ("R", -x), ("H", z), ("F", -z)) if share > 0.5)
    assert flips_of_orientation(f"A\\{letters}", laterality, view) == Flips(rows=False, columns=False)
    assert plate_rotation(PROJECTIONS[view].angle_deg)[0] == pytest.approx([-s * x, 0.0, z])


@pytest.mark.parametrize(
    ("view", "upright", "as_canonical"),
    [("CC", False, True), ("MLO", True, True), ("ML", True, True), ("LM", True, False), ("LMO", True, False),
     ("FB", False, False), ("XCCL", False, True)],
)  # fmt: skip
def test_how_views_are_hung(view, upright, as_canonical):
    assert (PROJECTIONS[view].upright, PROJECTIONS[view].hung_as_canonical) == (upright, as_canonical)


@pytest.mark.parametrize(("view", "flipped"), [("CC", False), ("ML", False), ("LM", True), ("LMO", True), ("FB", True)])
def test_without_orientation_the_first_row_is_the_one_that_is_hung_on_top(view, flipped):
    assert canonicalise(breast_image(), "L", view).flips.rows == flipped
    assert canonicalise(breast_image(), "L", view, turned=True).flips.rows != flipped

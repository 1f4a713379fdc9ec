"""The lines of README on the library run as they stand, on a breast whose truth is known."""

import re
from pathlib import Path

import numpy as np
import pytest

import mammoreg
from mammoreg.geometry import breast_to_plate
from tests.library import pressed_torso

PAPERS_MEAN_MM = 4.3
"""Of the paper's lesions in mammograms (Table V)."""
README = Path(__file__).parents[2] / "README.md"
LESION = pressed_torso.LESIONS[0]


def _lines() -> str:
    section = README.read_text(encoding="utf-8").partition("## As a library")[2]
    (block, *_) = re.findall(r"```python\n(.*?)```", section, flags=re.DOTALL)
    return str(block)


@pytest.fixture(scope="module")
def after() -> dict[str, object]:
    """The names of README's block after it ran."""
    volume, views = pressed_torso.mr(), {view: pressed_torso.truth(view) for view in ("CC", "MLO")}
    affine = np.diag([*volume.spacing, 1.0])
    affine[:3, 3] = volume.origin
    names: dict[str, object] = {
        "intensities": volume.data,
        "affine": affine,
        "cc_pixels": views["CC"].pixels,
        "mlo_pixels": views["MLO"].pixels,
        "lesion": LESION,
        "cc_spot": views["CC"].shown(LESION[None])[0],
        "mlo_spot": views["MLO"].shown(LESION[None])[0],
    }
    exec(_lines(), names)  # noqa: S102
    return names


def _miss_mm(view: str, pixel: np.ndarray) -> float:
    true = pressed_torso.truth(view)
    miss = pixel - true.shown(LESION[None])[0]
    return float(np.linalg.norm(miss) * true.geometry.pixel_mm / true.geometry.middle_magnification)


def test_about_ten_lines():
    assert len([line for line in _lines().splitlines() if line.strip()]) <= 12


def test_lesion_is_found_in_the_mammogram(after):
    shown = after["shown"]
    assert isinstance(shown, np.ndarray)
    # Without the deformation: the turned breast, straight through the true geometry.
    geometry = pressed_torso.truth("CC").geometry
    column, row = geometry.project(breast_to_plate(LESION, geometry.angle_deg))
    stiff = _miss_mm("CC", np.array([pressed_torso.COLUMNS - 1 - column, row]))
    assert _miss_mm("CC", shown) < min(PAPERS_MEAN_MM, 0.5 * stiff)


def test_lesion_is_found_in_the_mr_volume(after):
    found = after["found"]
    assert isinstance(found, mammoreg.Located)
    assert np.linalg.norm(found.point - LESION) < PAPERS_MEAN_MM
    assert found.region is not None
    assert found.region.frame == "LPS"
    assert found.beam_gap_mm is not None
    assert found.beam_gap_mm < 5.0


def test_a_pixel_s_curve_leads_through_the_lesion_and_back_to_the_pixel(after):
    view = after["cc"]
    assert isinstance(view, mammoreg.RegisteredView)
    pixel = np.array([150.0, 190.0])
    curve = view.to_mr(pixel)
    shown = view.to_mammogram(curve)
    np.testing.assert_allclose(shown, np.broadcast_to(pixel, shown.shape), atol=0.5)
    assert np.isnan(view.to_mammogram(LESION + np.array([0.0, 200.0, 0.0]))).all()


def test_marks_of_different_breasts_are_refused(after):
    with pytest.raises(ValueError, match="one and the same Breast"):
        mammoreg.locate([])

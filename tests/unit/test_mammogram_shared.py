"""Mammograms of the shared data: read, made canonical, analysed."""

import json

import h5py
import numpy as np
import pytest
from skimage.io import imread, imsave

from mammoreg.errors import DataError
from mammoreg.imaging.mammogram import analyse
from mammoreg.imaging.mammogram_canonical import canonicalise
from stages.cohort.readers.mammogram.image import read_mammogram, read_mammogram_facts
from tests.shared_data import DATA, requires_shared

TWINS = [("twin1", "CC"), ("twin1", "MLO"), ("twin4", "CC"), ("twin4", "MLO")]
EXAM = {"L-CC": "A\\R", "L-MLO": "A\\FR", "R-CC": "A\\L", "R-MLO": "A\\FL"}


def _canonical(path, laterality, view, row=None):
    stored = read_mammogram(path, row or {}, laterality, view)
    facts = stored.facts
    return facts, canonicalise(
        stored.pixels, laterality, view, orientation=facts.orientation, photometric=facts.photometric
    )


@requires_shared("twins")
@pytest.mark.parametrize(("case", "view"), TWINS)
def test_twins_outline_encloses_breast_and_points(case, view):
    facts, canonical = _canonical(DATA / f"twins/mg/{case}_{view}.dcm", "R", view)
    found = analyse(canonical.pixels, facts.pixel_mm, view)
    assert canonical.flips.columns
    assert not canonical.flips.rows
    points = np.loadtxt(DATA / f"twins/points/{case}_{view}.tsv", skiprows=1, usecols=(1, 2))
    column, row = np.rint(canonical.flips.apply_to_pixels(points, canonical.pixels.shape)).astype(int).T
    assert found.mask[row, column].all()
    assert (found.outline_weight == 1.0).sum() > 120
    assert (found.pectoral is not None) == (view == "MLO")


@requires_shared("twins")
def test_stored_flipped_gives_the_same_canonical_picture(tmp_path):
    source = read_mammogram(DATA / "twins/mg/twin4_CC.dcm", {}, "R", "CC").pixels
    _, expected = _canonical(DATA / "twins/mg/twin4_CC.dcm", "R", "CC")
    imsave(tmp_path / "flipped.png", source[::-1, ::-1].astype(np.uint16), check_contrast=False)
    _, got = _canonical(tmp_path / "flipped.png", "R", "CC", {"orientation": "A\\R", "pixel_spacing_mm": "0.2"})
    assert got.estimated == ("polarity",)
    assert np.ptp(got.pixels - expected.pixels) == 0.0


@requires_shared("twins")
def test_mirrored_left_breast_gives_the_same_canonical_picture(tmp_path):
    source = read_mammogram(DATA / "twins/mg/twin1_MLO.dcm", {}, "R", "MLO").pixels
    _, expected = _canonical(DATA / "twins/mg/twin1_MLO.dcm", "R", "MLO")
    imsave(tmp_path / "left.tif", source[:, ::-1].astype(np.uint16), check_contrast=False)
    _, got = _canonical(tmp_path / "left.tif", "L", "MLO", {"orientation": "A\\FR"})
    assert np.array_equal(got.pixels, expected.pixels)


@requires_shared("victre")
def test_victre_outline_and_nipple():
    facts, canonical = _canonical(DATA / "victre/cc.dcm", "R", "CC")
    found = analyse(canonical.pixels, facts.pixel_mm, "CC")
    assert facts.support_detector_mm == pytest.approx(1.0)
    # Pixels are 1000 x attenuation and the air is 0 but for noise: the breast is what is not air.
    assert 2 * (found.mask & (canonical.pixels > 20)).sum() / (found.mask.sum() + (canonical.pixels > 20).sum()) > 0.995
    truth = json.loads((DATA / "victre/truth.json").read_text())["nipple"]["cc_column_row"]
    nipple = canonical.flips.apply_to_pixels(np.array(truth), canonical.pixels.shape)
    assert found.nipple is not None
    assert np.hypot(*(found.nipple - nipple)) * facts.pixel_mm < 4.0


@requires_shared("mammograms")
@pytest.mark.parametrize("name", EXAM)
def test_screening_exam_whatever_its_storage(name):
    laterality, view = name[0], name[2:]
    row = {"orientation": EXAM[name], "pixel_spacing_mm": "0.1"}
    facts, canonical = _canonical(DATA / f"mammograms/nyu_birads_exam/{name}.png", laterality, view, row)
    assert not canonical.flips.columns
    assert facts.thickness_mm is None
    assert {"thickness_mm", "force_n", "source_detector_mm", "support_detector_mm"} <= set(facts.estimated)
    found = analyse(canonical.pixels, facts.pixel_mm, view)
    text = np.s_[:250, 1650:]
    assert not found.mask[text].any()
    assert found.mask.sum() > 0.4 * found.mask.size
    assert (found.pectoral is not None) == (view == "MLO")


@requires_shared("mammograms")
def test_mirrored_view_of_the_exam_flipped_back_is_the_same():
    path = DATA / "mammograms/nyu_birads_exam/R-MLO.png"
    mirrored = imread(path)
    first = canonicalise(mirrored, "R", "MLO", orientation="A\\FL")
    second = canonicalise(mirrored[:, ::-1], "R", "MLO", orientation="P\\FL")
    assert np.array_equal(first.pixels, second.pixels)


@requires_shared("mammograms")
def test_digibreast_outline_encloses_the_measured_thickness():
    with h5py.File(DATA / "mammograms/digibreast/digibreast.h5") as file:
        image, thickness = file["mammogram"][:], file["thickness"][:]
    canonical = canonicalise(image, "R", "CC")
    found = analyse(canonical.pixels, 1.0, "CC")
    true = canonical.flips.apply(np.nan_to_num(thickness) > 0.0)
    assert found.mask.sum() / 100.0 == pytest.approx(161.3, rel=0.02)
    assert 2 * (found.mask & true).sum() / (found.mask.sum() + true.sum()) > 0.99
    assert found.nipple is not None


@requires_shared("twins")
def test_facts_of_a_twin():
    facts = read_mammogram_facts(DATA / "twins/mg/twin4_MLO.dcm", {}, "R", "MLO")
    assert (facts.pixel_mm, facts.thickness_mm, facts.force_n, facts.angle_deg) == (0.2, 88.0, 51.2, 45.0)
    assert (facts.source_detector_mm, facts.support_detector_mm) == (650.0, 15.0)
    assert facts.estimated == ()


@requires_shared("mri")
def test_mr_image_is_no_mammogram():
    path = sorted((DATA / "mri/69b91dc2_t1_tse_dicom").iterdir())[0]
    with pytest.raises(DataError, match="modality is MR, not MG"):
        read_mammogram_facts(path, {}, "R", "CC")

"""MR volumes from NIfTI and DICOM, in any orientation, and what is refused."""

import gzip
import struct
from pathlib import Path

import nibabel
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from pydicom.dataset import Dataset, FileMetaDataset
from pydicom.uid import ExplicitVRLittleEndian, MRImageStorage, generate_uid

from mammoreg.errors import DataError
from mammoreg.geometry import Volume, volume_of_affine
from stages.cohort.readers.mr.header import read_mr_grid
from stages.cohort.readers.mr.volume import read_mr, read_nifti
from stages.cohort.readers.whole import check_whole_mr
from tests.shared_data import DATA, requires_shared

TO_RAS = np.diag([-1.0, -1.0, 1.0, 1.0])


def linear_field(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Intensities that linear interpolation meets exactly."""
    return np.asarray(300.0 + points @ np.array([1.0, -2.0, 0.5]))


def sampled(affine: NDArray[np.float64], shape: tuple[int, int, int]) -> NDArray[np.float64]:
    indices = np.moveaxis(np.indices(shape), 0, -1)
    return linear_field(indices @ affine[:3, :3].T + affine[:3, 3])


def centres(volume: Volume) -> NDArray[np.float64]:
    return volume.to_world(np.moveaxis(np.indices(volume.shape), 0, -1))


@given(axes=st.permutations([0, 1, 2]), signs=st.tuples(*[st.sampled_from([-1.0, 1.0])] * 3))
@settings(max_examples=30, deadline=None)
def test_every_axis_order_and_direction_lands_in_lps(axes: list[int], signs: tuple[float, float, float]) -> None:
    affine = np.eye(4)
    affine[:3, :3] = np.eye(3)[:, axes] * signs * np.array([1.0, 1.5, 2.5])
    affine[:3, 3] = [-20.0, 15.0, 4.0]
    volume = volume_of_affine(sampled(affine, (9, 10, 11)), affine, order=1)
    assert np.allclose(volume.data, linear_field(centres(volume)))
    assert np.all(volume.spacing > 0.0)
    assert volume.data.size == 9 * 10 * 11


@given(angles=st.tuples(*[st.floats(-0.5, 0.5)] * 3))
@settings(max_examples=15, deadline=None)
def test_oblique_volumes_are_resampled(angles: tuple[float, float, float]) -> None:
    from scipy.spatial.transform import Rotation

    affine = np.eye(4)
    affine[:3, :3] = Rotation.from_euler("xyz", angles).as_matrix() * np.array([1.0, 1.5, 2.0])
    affine[:3, 3] = [-20.0, 15.0, 4.0]
    data = sampled(affine, (12, 13, 14))
    volume = volume_of_affine(data, affine, order=1)
    inside = volume.data > 0.0
    assert np.allclose(volume.data[inside], linear_field(centres(volume))[inside], atol=0.1)
    middle = affine[:3, :3] @ np.array([5.5, 6.0, 6.5]) + affine[:3, 3]
    assert volume.sample(middle[None])[0] == pytest.approx(linear_field(middle), abs=0.1)


def test_nifti_round_trip_and_labels_on_the_same_voxels(tmp_path: Path) -> None:
    affine = np.diag([1.4, -1.4, 1.4, 1.0])
    affine[:3, 3] = [-30.0, 20.0, 5.0]
    data = sampled(TO_RAS @ affine, (10, 11, 12))
    nibabel.save(nibabel.Nifti1Image(data.astype(np.float32), affine), tmp_path / "mr.nii.gz")
    nibabel.save(nibabel.Nifti1Image((data > 300.0).astype(np.uint8), affine), tmp_path / "labels.nii.gz")
    volume, labels = read_mr(tmp_path / "mr.nii.gz"), read_nifti(tmp_path / "labels.nii.gz")
    assert np.allclose(volume.data, linear_field(centres(volume)), atol=1e-3)
    assert np.array_equal(labels.data, (volume.data > 300.0).astype(np.uint8))
    assert np.array_equal(labels.origin, volume.origin)


def test_scaled_integers_are_rescaled(tmp_path: Path) -> None:
    image = nibabel.Nifti1Image(np.arange(1000, dtype=np.int16).reshape(10, 10, 10), np.eye(4))
    image.header.set_slope_inter(0.5, 10.0)
    nibabel.save(image, tmp_path / "mr.nii")
    assert read_mr(tmp_path / "mr.nii").data.max() == pytest.approx(10.0 + 0.5 * 999.0)


@pytest.mark.parametrize(
    ("name", "change", "message"),
    [
        ("NaN", lambda data, header: data.__setitem__((3, 3, 3), np.nan), "not finite"),
        ("spacing", lambda data, header: header["pixdim"].__setitem__(2, 0.0), "spacing"),
    ],
)
def test_spoiled_nifti_is_refused(tmp_path: Path, name: str, change: object, message: str) -> None:
    data = np.ones((10, 10, 10), np.float32)
    image = nibabel.Nifti1Image(data, np.eye(4))
    assert callable(change)
    change(data, image.header)
    path = tmp_path / "mr.nii"
    nibabel.save(image, path)
    if name == "spacing":  # nibabel mends the header on saving
        raw = bytearray(path.read_bytes())
        raw[84:88] = np.float32(0.0).tobytes()
        path.write_bytes(raw)
    with pytest.raises(DataError, match=message):
        read_mr(path)


HEADERS = {
    "vox_offset below the header": ("<f", 108, 348.0, "cannot be read as NIfTI"),
    "unknown data type": ("<h", 70, 1, "cannot be read as NIfTI"),
    "dimensions without end": ("<h", 42, 30000, "30000 x 10 x 10 voxels of 1 x 1 x 1 mm are no breast volume"),
    "no dimension": ("<h", 42, 0, "cannot be read as NIfTI|0 x 10 x 10"),
    "negative dimension": ("<h", 42, -10, "-10 x 10 x 10 voxels, which is no volume"),
    "spacing of pixdim ten times that of the affine": (
        "<f",
        80,
        10.0,
        "two voxel spacings, 10 x 1 x 1 and 1 x 1 x 1 mm",
    ),
    "spacing that is no number": ("<f", 80, float("nan"), "voxel spacing is nan"),
    "affine that is no number": ("<f", 280, float("nan"), "nan"),
    "affine that leads to the moon": ("<f", 292, 4e8, "4e.08 mm from the scanner's centre"),
    "code of an orientation that there is none": ("<h", 254, 46, "gives no orientation"),
    "flat affine": ("<f", 280 + 20, 0.0, "spacing"),
    "colours": ("<h", 70, 128, "not grey values|cannot be read"),
    "wrong magic": ("4s", 344, b"abc\0", "cannot be read as NIfTI"),
}


@pytest.mark.parametrize(("form", "offset", "value", "message"), HEADERS.values(), ids=HEADERS.keys())
@pytest.mark.parametrize("suffix", [".nii", ".nii.gz"])
def test_headers_that_nibabel_refuses_in_its_own_ways(
    tmp_path: Path, suffix: str, form: str, offset: int, value: object, message: str
) -> None:
    nibabel.save(nibabel.Nifti1Image(np.ones((10, 10, 10), np.float32), np.eye(4)), tmp_path / "mr.nii")
    raw = bytearray((tmp_path / "mr.nii").read_bytes())
    struct.pack_into(form, raw, offset, value)
    path = tmp_path / f"spoilt{suffix}"
    path.write_bytes(gzip.compress(bytes(raw)) if suffix == ".nii.gz" else bytes(raw))
    with pytest.raises(DataError, match=message):
        read_mr_grid(path)


@pytest.mark.parametrize("share", [0.0, 0.01, 0.5, 0.999])
def test_damage_in_a_compressed_volume_is_no_traceback(tmp_path: Path, share: float) -> None:
    path = tmp_path / "mr.nii.gz"
    nibabel.save(nibabel.Nifti1Image(np.random.default_rng(0).random((12, 12, 12)), np.eye(4)), path)
    raw = bytearray(path.read_bytes())
    start = int(share * (len(raw) - 40))
    raw[start : start + 40] = bytes(40)
    path.write_bytes(bytes(raw))

    def looked_at() -> None:
        read_mr_grid(path)
        check_whole_mr(path)

    with pytest.raises(DataError, match="mr.nii.gz"):
        looked_at()


def test_two_places_in_one_header_are_refused(tmp_path: Path) -> None:
    """Programs differ in whether they take sform or qform, so that marks set in one would lie elsewhere in another."""
    image = nibabel.Nifti1Image(np.ones((10, 10, 10), np.float32), np.diag([1.5, 1.5, 2.0, 1.0]))
    image.set_qform(image.affine, code=1)
    nibabel.save(image, tmp_path / "same.nii")
    assert read_mr_grid(tmp_path / "same.nii").shape == (10, 10, 10)
    moved = image.affine.copy()
    moved[0, 3] = 25.0
    image.set_qform(moved, code=1)
    nibabel.save(image, tmp_path / "two.nii")
    with pytest.raises(DataError, match="two places, up to 25 mm apart"):
        read_mr_grid(tmp_path / "two.nii")


def test_several_volumes_in_one_file_are_refused_by_name(tmp_path: Path) -> None:
    nibabel.save(nibabel.Nifti1Image(np.ones((10, 10, 10, 4), np.float32), np.eye(4)), tmp_path / "mr.nii")
    with pytest.raises(
        DataError, match="holds several volumes .10 x 10 x 10 x 4 voxels.; write the one before contrast"
    ):
        read_mr_grid(tmp_path / "mr.nii")


def test_a_scale_factor_that_is_no_number_means_none(tmp_path: Path) -> None:
    """NIfTI: a slope of 0 or NaN leaves the stored values as they are."""
    nibabel.save(
        nibabel.Nifti1Image(np.arange(1000, dtype=np.int16).reshape(10, 10, 10), np.eye(4)), tmp_path / "a.nii"
    )
    raw = bytearray((tmp_path / "a.nii").read_bytes())
    struct.pack_into("<f", raw, 112, float("nan"))
    (tmp_path / "b.nii").write_bytes(bytes(raw))
    assert np.array_equal(read_mr(tmp_path / "b.nii").data, read_mr(tmp_path / "a.nii").data)


def test_truncated_nifti_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "mr.nii.gz"
    nibabel.save(nibabel.Nifti1Image(np.random.default_rng(0).random((20, 20, 20)), np.eye(4)), path)
    path.write_bytes(path.read_bytes()[:20000])
    with pytest.raises(DataError, match="cannot be read"):
        read_mr(path)


def test_nifti_without_orientation_is_refused(tmp_path: Path) -> None:
    nibabel.save(nibabel.Nifti1Image(np.ones((10, 10, 10), np.float32), None), tmp_path / "mr.nii")
    with pytest.raises(DataError, match="orientation"):
        read_mr(tmp_path / "mr.nii")


def test_complex_voxels_are_refused(tmp_path: Path) -> None:
    nibabel.save(nibabel.Nifti1Image(np.ones((10, 10, 10), np.complex64), np.eye(4)), tmp_path / "mr.nii")
    with pytest.raises(DataError, match="grey values"):
        read_mr(tmp_path / "mr.nii")


def write_series(folder: Path, positions: list[float], *, modality: str = "MR", series: str = "1.2.3.4") -> None:
    """Sagittal slices whose voxels hold the linear field, names not in slice order."""
    affine = np.eye(4)
    affine[:3, :3] = np.array([[0.0, 0.0, 1.0], [1.5, 0.0, 0.0], [0.0, -1.5, 0.0]])
    for number, x in enumerate(positions):
        affine[:3, 3] = [x, -10.0, 20.0]
        header = Dataset()
        header.file_meta = FileMetaDataset()
        header.file_meta.TransferSyntaxUID = ExplicitVRLittleEndian
        header.file_meta.MediaStorageSOPClassUID = header.SOPClassUID = MRImageStorage
        header.SOPInstanceUID = generate_uid(entropy_srcs=[series, str(number)])
        header.file_meta.MediaStorageSOPInstanceUID = header.SOPInstanceUID
        header.SeriesInstanceUID, header.StudyInstanceUID, header.Modality = series, "1.2.3", modality
        header.Rows, header.Columns, header.PixelSpacing = 12, 10, [1.5, 1.5]
        header.ImageOrientationPatient = [0, 1, 0, 0, 0, -1]
        header.ImagePositionPatient = affine[:3, 3].tolist()
        header.SliceThickness, header.InstanceNumber = 2.0, number + 1
        header.SamplesPerPixel, header.PhotometricInterpretation = 1, "MONOCHROME2"
        header.BitsAllocated, header.BitsStored, header.HighBit, header.PixelRepresentation = 16, 16, 15, 0
        header.RescaleSlope, header.RescaleIntercept = 0.5, 0.0
        pixels = sampled(affine, (10, 12, 1))[..., 0].T
        header.PixelData = np.round(2.0 * pixels).astype(np.uint16).tobytes()
        header.save_as(folder / f"{(number * 7) % 11:02d}_{series}.dcm", enforce_file_format=True)


def test_dicom_series_is_sorted_by_position(tmp_path: Path) -> None:
    write_series(tmp_path, [2.0 * k for k in range(9)])
    volume = read_mr(tmp_path)
    assert volume.shape == (9, 10, 12)
    assert np.allclose(volume.spacing, [2.0, 1.5, 1.5])
    assert np.abs(volume.data - linear_field(centres(volume))).max() <= 0.26


@pytest.mark.parametrize(
    ("positions", "modality", "message"),
    [
        ([0.0, 2.0, 4.0, 6.0, 10.0, 12.0, 14.0, 16.0, 18.0], "MR", "missing"),
        ([2.0 * k for k in range(9)], "CT", "modality is CT"),
    ],
)
def test_spoiled_series_are_refused(tmp_path: Path, positions: list[float], modality: str, message: str) -> None:
    write_series(tmp_path, positions, modality=modality)
    with pytest.raises(DataError, match=message):
        read_mr(tmp_path)


def test_series_that_nothing_tells_apart_are_refused(tmp_path: Path) -> None:
    write_series(tmp_path, [2.0 * k for k in range(9)])
    write_series(tmp_path, [2.0 * k for k in range(9)], series="1.2.3.5")
    with pytest.raises(DataError, match="nothing in their headers tells apart.*mr_series"):
        read_mr(tmp_path)


def test_an_empty_folder_is_refused(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="no DICOM image"):
        read_mr(tmp_path)


@requires_shared("mri")
def test_dicom_series_equals_its_nifti() -> None:
    series = read_mr(DATA / "mri/69b91dc2_t1_tse_dicom")
    nifti = read_mr(DATA / "mri/69b91dc2_t1_tse.nii.gz")
    assert np.array_equal(series.data, nifti.data[:, 124:392])
    assert np.allclose(series.origin, nifti.to_world(np.array([0, 124, 0])), atol=1e-2)

"""Lesion masks as segmentations: 3D Slicer's `.seg.nrrd` and DICOM SEG, placed as their headers say."""

import json
from pathlib import Path

import numpy as np
import pytest
import SimpleITK
from pydicom.dataset import Dataset, FileDataset, FileMetaDataset
from pydicom.pixels.utils import pack_bits
from pydicom.sequence import Sequence
from pydicom.uid import ExplicitVRLittleEndian

from mammoreg.errors import DataError
from stages.cohort.readers.marks.masks import mask_names, read_masks
from stages.cohort.readers.marks.points import is_list, read_spheres

ORIGIN = np.array([-20.0, -30.0, 5.0])
SPACING = np.array([1.0, 1.5, 3.0])


def _segments(*names: str, **more: str) -> dict[str, str]:
    told = {}
    for number, name in enumerate(names):
        told |= {f"Segment{number}_ID": f"S{number}", f"Segment{number}_Name": name}
        told |= {f"Segment{number}_LabelValue": str(number + 1), f"Segment{number}_Layer": "0"}
    return told | more


def _nrrd(path: Path, voxels: np.ndarray, told: dict[str, str], direction: np.ndarray | None = None) -> Path:
    """Voxels (x, y, z), or (x, y, z, layer)."""
    image = SimpleITK.GetImageFromArray(np.swapaxes(voxels, 0, 2), isVector=voxels.ndim == 4)
    image.SetOrigin(ORIGIN.tolist())
    image.SetSpacing(SPACING.tolist())
    image.SetDirection((np.eye(3) if direction is None else direction).ravel().tolist())
    for key, value in told.items():
        image.SetMetaData(key, value)
    SimpleITK.WriteImage(image, str(path), useCompression=True)
    return path


def _two_balls() -> np.ndarray:
    voxels = np.zeros((12, 10, 8), np.uint8)
    voxels[2:5, 2:5, 2:4] = 1
    voxels[8:10, 6:9, 5:7] = 2
    return voxels


def _centre(first: tuple[int, ...], last: tuple[int, ...]) -> np.ndarray:
    return ORIGIN + SPACING * (np.array(first) + np.array(last)) / 2


def test_each_segment_is_a_lesion(tmp_path):
    path = _nrrd(tmp_path / "S.seg.nrrd", _two_balls(), _segments("mass A", "mass B"))
    found = read_masks(path)
    assert list(found) == mask_names(path) == ["mass A", "mass B"]
    np.testing.assert_allclose(
        found["mass A"].centres(found["mass A"].data).mean(axis=0), _centre((2, 2, 2), (4, 4, 3)), atol=1e-6
    )
    np.testing.assert_allclose(
        found["mass B"].centres(found["mass B"].data).mean(axis=0), _centre((8, 6, 5), (9, 8, 6)), atol=1e-6
    )


def test_the_segment_called_lesion_is_taken_alone(tmp_path):
    path = _nrrd(tmp_path / "S.seg.nrrd", _two_balls(), _segments("breast", "Lesion"))
    found = read_masks(path)
    assert list(found) == ["lesion"]
    assert found["lesion"].data.sum() == 2 * 3 * 2


def test_a_segment_without_voxels_is_left_out(tmp_path):
    told = _segments("mass", "draft", Segment1_Extent="0 -1 0 -1 0 -1")
    found = read_masks(_nrrd(tmp_path / "S.seg.nrrd", _two_balls(), told))
    assert list(found) == ["lesion"]
    assert found["lesion"].data.sum() == 3 * 3 * 2


def test_overlapping_segments_lie_in_layers(tmp_path):
    layers = np.stack([_two_balls() == 1, _two_balls() == 2], axis=-1).astype(np.uint8)
    told = _segments("a", "b") | {"Segment1_Layer": "1", "Segment1_LabelValue": "1"}
    found = read_masks(_nrrd(tmp_path / "S.seg.nrrd", layers, told))
    assert {name: int(mask.data.sum()) for name, mask in found.items()} == {"a": 18, "b": 12}


def test_directions_of_the_file_place_it(tmp_path):
    """Axes along posterior, left and feet."""
    direction = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
    voxels = (_two_balls() == 1).astype(np.uint8)
    found = read_masks(_nrrd(tmp_path / "S.seg.nrrd", voxels, _segments("a"), direction))["lesion"]
    expected = ORIGIN + direction @ (SPACING * np.array([3.0, 3.0, 2.5]))
    np.testing.assert_allclose(found.centres(found.data).mean(axis=0), expected, atol=1e-6)


def test_a_segmentation_of_nothing(tmp_path):
    path = _nrrd(tmp_path / "S.seg.nrrd", np.zeros((1, 1, 1), np.uint8), {})
    with pytest.raises(DataError, match="holds no segment"):
        read_masks(path)


def _item(**elements: object) -> Dataset:
    item = Dataset()
    for keyword, value in elements.items():
        setattr(item, keyword, value)
    return item


def _seg(
    path: Path,
    frames: list[tuple[int, int, np.ndarray]],
    labels: dict[int, str],
    kind: str = "BINARY",
    **measures: object,
) -> Path:
    """A SEG of frames (slice, segment, pixels (rows, columns)), axial, at `ORIGIN` and `SPACING`."""
    meta = FileMetaDataset()
    meta.TransferSyntaxUID = ExplicitVRLittleEndian
    meta.MediaStorageSOPClassUID, meta.MediaStorageSOPInstanceUID = "1.2.840.10008.5.1.4.1.1.66.4", "1.2.3"
    data = FileDataset(str(path), {}, file_meta=meta, preamble=b"\0" * 128)
    data.SOPClassUID, data.Modality, data.SegmentationType = meta.MediaStorageSOPClassUID, "SEG", kind
    data.SamplesPerPixel, data.PhotometricInterpretation, data.PixelRepresentation = 1, "MONOCHROME2", 0
    data.BitsAllocated = data.BitsStored = 1 if kind == "BINARY" else 8
    data.HighBit = data.BitsStored - 1
    data.NumberOfFrames = len(frames)
    data.Rows, data.Columns = frames[0][2].shape
    data.SegmentSequence = Sequence([_item(SegmentNumber=n, SegmentLabel=label) for n, label in labels.items()])
    spacing = {"PixelSpacing": [SPACING[1], SPACING[0]]} | (measures or {"SpacingBetweenSlices": SPACING[2]})
    data.SharedFunctionalGroupsSequence = Sequence(
        [
            _item(
                PixelMeasuresSequence=Sequence([_item(**spacing)]),
                PlaneOrientationSequence=Sequence([_item(ImageOrientationPatient=[1, 0, 0, 0, 1, 0])]),
            )
        ]
    )
    data.PerFrameFunctionalGroupsSequence = Sequence(
        [
            _item(
                PlanePositionSequence=Sequence(
                    [_item(ImagePositionPatient=[*ORIGIN[:2], float(ORIGIN[2] + k * SPACING[2])])]
                ),
                SegmentIdentificationSequence=Sequence([_item(ReferencedSegmentNumber=segment)]),
            )
            for k, segment, _ in frames
        ]
    )
    pixels = np.stack([frame for _, _, frame in frames]).astype(np.uint8)
    data.PixelData = pack_bits(pixels.ravel()) if kind == "BINARY" else pixels.tobytes()
    data.save_as(path, enforce_file_format=True)
    return path


def _square(columns: slice, rows: slice, value: int = 1) -> np.ndarray:
    pixels = np.zeros((10, 12), np.uint8)
    pixels[rows, columns] = value
    return pixels


def test_binary_seg_with_sparse_frames_in_any_order(tmp_path):
    a, b = _square(slice(2, 5), slice(2, 6)), _square(slice(8, 10), slice(1, 3))
    frames = [(9, 2, b), (3, 1, a), (2, 1, a), (8, 2, b), (10, 2, b)]
    path = _seg(tmp_path / "seg.dcm", frames, {1: "mass A", 2: "mass B"})
    found = read_masks(path)
    assert list(found) == mask_names(path) == ["mass A", "mass B"]
    first, second = found["mass A"], found["mass B"]
    assert (first.data.sum(), second.data.sum()) == (2 * 12, 3 * 4)
    np.testing.assert_allclose(first.centres(first.data).mean(axis=0), _centre((2, 2, 2), (4, 5, 3)), atol=1e-6)
    np.testing.assert_allclose(second.centres(second.data).mean(axis=0), _centre((8, 1, 8), (9, 2, 10)), atol=1e-6)


@pytest.mark.parametrize("measures", [{"SliceThickness": 3.0}, {"SliceThickness": 2.2}])
def test_distance_of_slices_where_the_header_does_not_tell(tmp_path, measures):
    square = _square(slice(2, 5), slice(2, 6))
    path = _seg(tmp_path / "seg.dcm", [(k, 1, square) for k in (4, 5, 6)], {1: "x"}, **measures)
    assert read_masks(path)["lesion"].spacing[2] == pytest.approx(SPACING[2])


def test_fractional_seg_is_what_lies_above_half(tmp_path):
    square = _square(slice(2, 9), slice(2, 9), 100) + _square(slice(4, 6), slice(4, 6), 150)
    found = read_masks(_seg(tmp_path / "seg.dcm", [(3, 1, square)], {1: "x"}, "FRACTIONAL"))["lesion"]
    assert found.data.sum() == 4


def test_seg_whose_frames_make_no_grid(tmp_path):
    square = _square(slice(2, 5), slice(2, 6))
    path = _seg(tmp_path / "seg.dcm", [(0, 1, square), (1, 1, square), (2.4, 1, square)], {1: "x"})
    with pytest.raises(DataError, match="do not lie on one grid of slices"):
        read_masks(path)


def test_dicom_that_is_no_segmentation(tmp_path):
    path = _seg(tmp_path / "seg.dcm", [(0, 1, _square(slice(2, 5), slice(2, 6)))], {1: "x"})
    content = path.read_bytes().replace(b"SEG ", b"MR  ", 1)
    path.write_bytes(content)
    with pytest.raises(DataError, match=r"modality MR, not a segmentation \(SEG\)"):
        read_masks(path)
    (tmp_path / "notes.docx").write_text("mass")
    with pytest.raises(DataError, match="is no lesion mask; give"):
        read_masks(tmp_path / "notes.docx")


def _files_of_marks(folder: Path) -> list[Path]:
    square = _square(slice(2, 5), slice(2, 6))
    point = {"label": "F-1", "position": [1.0, 2.0, 3.0], "description": "12 mm", "positionStatus": "defined"}
    node = {"type": "Fiducial", "coordinateSystem": "LPS", "coordinateUnits": "mm", "controlPoints": [point]}
    (folder / "F.mrk.json").write_text(json.dumps({"markups": [node]}))
    columns = "id,x,y,z,ow,ox,oy,oz,vis,sel,lock,label,desc,associatedNodeID"
    head = f"# Markups fiducial file version = 5.6\n# CoordinateSystem = LPS\n# columns = {columns}\n"
    (folder / "F.fcsv").write_text(head + '1,1,2,3,0,0,0,1,1,1,0,"F-1",12 mm,\n')
    (folder / "F.tsv").write_text("name\tx\ty\tz\tdiameter_mm\nF-1\t1\t2\t3\t12\n")
    return [
        folder / "F.mrk.json",
        folder / "F.fcsv",
        folder / "F.tsv",
        _nrrd(folder / "S.seg.nrrd", _two_balls(), _segments("mass A", "mass B")),
        _seg(folder / "seg.dcm", [(3, 1, square), (2, 1, square)], {1: "mass"}),
    ]


@pytest.mark.filterwarnings("ignore")
def test_damaged_files_of_marks_are_read_or_refused(tmp_path):
    """Bytes altered, left out and cut off, by a fixed seed: nothing but a mark or a message comes of it."""
    random = np.random.default_rng(9)
    refused: list[tuple[str, str]] = []
    for path in _files_of_marks(tmp_path):
        whole = path.read_bytes()
        for _ in range(40):
            content = bytearray(whole)
            for place in random.integers(0, len(content), size=random.integers(1, 6)):
                content[place] = random.integers(0, 256)
            cut = len(content) if random.random() < 0.6 else int(random.integers(0, len(content)))
            path.write_bytes(bytes(content[:cut]))
            try:
                assert read_spheres(path) if is_list(path) else read_masks(path)
            except DataError as error:
                refused.append((path.name, str(error)))
    assert len(refused) > 60
    assert all(name in message for name, message in refused)

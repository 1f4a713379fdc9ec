"""Lesion masks as DICOM segmentation objects, placed by the plane positions of their frames."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mammoreg.errors import DataError
from mammoreg.geometry import Volume, volume_of_affine

_SEG_STORAGE = ("1.2.840.10008.5.1.4.1.1.66.4", "1.2.840.10008.5.1.4.1.1.66.7")
_STEP_TOLERANCE = 0.05
"""Frames may lie off whole steps by this share of one."""
_SAME_DIRECTION = 1e-3
_UNIT = 0.01


def read_dicom_seg(path: Path) -> dict[str, Volume]:
    """Segments in LPS mm by name, on the grid of their frames; frames that are left out are empty.

    Raises:
        DataError: unreadable, no segmentation, or frames that make no volume.
    """
    data = _dataset(path)
    try:
        frames = np.asarray(data.pixel_array)
        frames = frames[None] if frames.ndim == 2 else frames
        names = {int(s.SegmentNumber): str(s.get("SegmentLabel") or s.SegmentNumber) for s in data.SegmentSequence}
        places = [_place(data, number) for number in range(len(frames))]
        numbers = [_segment_number(data, number) for number in range(len(frames))]
    except Exception as error:  # damaged elements raise what their types do, pixels what decodes them does
        raise DataError(f"{path}: its frames lack pixels, place or segment; export the segmentation again") from error
    index, affine = _grid(path, data, places)
    if len(set(names.values())) < len(names):
        raise DataError(f"{path}: two segments have the same label; rename one")
    found = {}
    for segment, name in names.items():
        chosen = [k for k, number in enumerate(numbers) if number in (segment, None)]
        layers = np.zeros((frames.shape[2], frames.shape[1], int(index.max()) + 1), dtype=np.float32)
        for k in chosen:
            layers[:, :, index[k]] = (frames[k] if numbers[k] is not None else frames[k] == segment).T
        if layers.any():
            found[name] = volume_of_affine(layers, affine, order=0)
    if not found:
        raise DataError(f"{path}: all its segments are empty; mark the lesion or leave the cell empty")
    return found


def _dataset(path: Path) -> Any:
    from pydicom import dcmread

    files = [p for p in sorted(path.iterdir()) if p.is_file()] if path.is_dir() else [path]
    try:
        (file,) = files
        data = dcmread(file)
    except Exception as error:  # pydicom raises many kinds at damaged files
        raise DataError(
            f"{path}: is no lesion mask; give .nii.gz, .seg.nrrd, a DICOM SEG, or a .tsv with name x y z diameter_mm"
        ) from error
    if str(data.get("SOPClassUID")) not in _SEG_STORAGE or data.get("Modality") != "SEG":
        raise DataError(f"{path}: is DICOM of modality {data.get('Modality', 'none')}, not a segmentation (SEG)")
    return data


def _group(data: Any, number: int, keyword: str) -> Any:
    """The functional group of a frame, or the one that all frames share."""
    frames = data.get("PerFrameFunctionalGroupsSequence") or []
    own = frames[number] if number < len(frames) else None
    if own is not None and keyword in own:
        return own[keyword].value[0]
    return data.SharedFunctionalGroupsSequence[0][keyword].value[0]


def _place(data: Any, number: int) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Position (3,), directions (2, 3) of rows and columns, and spacing (2,) between rows and columns, mm."""
    position = np.array(_group(data, number, "PlanePositionSequence").ImagePositionPatient, dtype=float)
    directions = _group(data, number, "PlaneOrientationSequence").ImageOrientationPatient
    spacing = np.array(_group(data, number, "PixelMeasuresSequence").PixelSpacing, dtype=float)
    return position, np.array(directions, dtype=float).reshape(2, 3), spacing


def _segment_number(data: Any, number: int) -> int | None:
    """Segment that a frame shows; None where its pixels are the numbers themselves."""
    if str(data.SegmentationType) == "LABELMAP":
        return None
    return int(_group(data, number, "SegmentIdentificationSequence").ReferencedSegmentNumber)


def _grid(path: Path, data: Any, places: Sequence[Any]) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """Number of each frame's slice, and the affine (4, 4) from (column, row, slice) to LPS."""
    positions = np.array([p for p, _, _ in places])
    directions, spacing = np.array([d for _, d, _ in places]), np.array([s for _, _, s in places])
    alike = np.ptp(directions, axis=0).max() < _SAME_DIRECTION and np.ptp(spacing, axis=0).max() < _SAME_DIRECTION
    along_row, along_column = directions[0]
    sound = np.allclose(directions[0] @ directions[0].T, np.eye(2), atol=_UNIT) and spacing.min() > 0.0
    if not sound or not np.isfinite(positions).all():
        raise DataError(f"{path}: its header gives no sensible place of the frames; export the segmentation again")
    normal = np.cross(along_row, along_column)
    heights = positions @ normal
    aside = positions - heights[:, None] * normal
    step = _step(data, heights)
    index = (heights - heights.min()) / step
    if not alike or np.ptp(aside, axis=0).max() > 0.1 or np.abs(index - np.rint(index)).max() > _STEP_TOLERANCE:
        raise DataError(f"{path}: its frames do not lie on one grid of slices; export the segmentation on the MR grid")
    affine = np.eye(4)
    between_rows, between_columns = spacing[0]
    start = positions[int(np.argmin(heights))]
    affine[:3] = np.column_stack([along_row * between_columns, along_column * between_rows, normal * step, start])
    return np.rint(index).astype(np.intp), affine


def _step(data: Any, heights: NDArray[np.float64]) -> float:
    """Distance of slices, mm: the declared one where the frames lie whole numbers of it apart, else their own."""
    measures = _group(data, 0, "PixelMeasuresSequence")
    declared = abs(float(measures.get("SpacingBetweenSlices") or measures.get("SliceThickness") or 0.0))
    gaps = np.diff(np.unique(np.round(heights, 3)))
    if not gaps.size:
        return declared or 1.0
    closest = float(gaps.min())
    steps = closest / declared if declared else 0.0
    return declared if steps > 0.5 and abs(steps - round(steps)) < _STEP_TOLERANCE else closest

"""NRRD masks, among them the segmentations of 3D Slicer (`.seg.nrrd`)."""

from pathlib import Path
from typing import Any

import numpy as np

from mammoreg.errors import DataError
from mammoreg.geometry import Volume, volume_of_affine

_ENDINGS = (".nrrd", ".nhdr")


def is_nrrd(path: Path) -> bool:
    """Whether a file is taken for NRRD, by its name."""
    return path.name.lower().endswith(_ENDINGS)


def read_nrrd(path: Path) -> dict[str, Volume]:
    """Segments in LPS mm by name, on the file's own grid; what is no segmentation is one segment called `lesion`.

    Raises:
        DataError: unreadable, without a frame, or without a segment.
    """
    image = _image(path)
    try:
        return _volumes(path, image)
    except DataError:
        raise
    except (ValueError, IndexError, KeyError, RuntimeError) as error:
        raise DataError(f"{path}: its segments are not told as 3D Slicer does; save the segmentation again") from error


def _volumes(path: Path, image: Any) -> dict[str, Volume]:
    affine = np.eye(4)
    affine[:3, :3] = np.array(image.GetDirection()).reshape(3, 3) * np.array(image.GetSpacing())
    affine[:3, 3] = image.GetOrigin()
    layers = _layers(image)
    segments = _segments(path, image)
    if segments is None:
        if len(layers) > 1:
            raise DataError(f"{path}: holds {len(layers)} volumes; give one mask")
        return {"lesion": volume_of_affine(layers[0], affine, order=0)}
    return {
        name: volume_of_affine((layers[layer] == value).astype(np.uint8), affine, order=0)
        for name, (layer, value) in segments.items()
    }


def _image(path: Path) -> Any:
    import SimpleITK

    try:
        image = SimpleITK.ReadImage(str(path))
    except RuntimeError as error:
        raise DataError(f"{path}: cannot be read as NRRD; save the segmentation again") from error
    if image.GetDimension() != 3 or not image.HasMetaDataKey("NRRD_space"):
        what = f"has {image.GetDimension()} dimensions" if image.GetDimension() != 3 else "does not say in which space"
        raise DataError(f"{path}: {what}; save it from 3D Slicer as .seg.nrrd")
    if image.GetNumberOfPixels() == 1:
        raise DataError(f"{path}: holds no segment; mark the lesion or leave the cell empty")
    return image


def _layers(image: Any) -> list[Any]:
    """Voxels (nx, ny, nz) of each layer; segments that overlap lie in several."""
    import SimpleITK

    voxels = SimpleITK.GetArrayFromImage(image)
    if image.GetNumberOfComponentsPerPixel() == 1:
        voxels = voxels[..., None]
    return [voxels[..., layer].transpose(2, 1, 0) for layer in range(voxels.shape[-1])]


def _segments(path: Path, image: Any) -> dict[str, tuple[int, int]] | None:
    """Layer and label of each segment that marks anything, by name; None where the file is no segmentation."""
    found: dict[str, tuple[int, int]] = {}
    number = 0
    while image.HasMetaDataKey(f"Segment{number}_ID"):
        told = {
            key: image.GetMetaData(f"Segment{number}_{key}").strip()
            for key in ("Name", "ID", "Layer", "LabelValue", "Extent")
            if image.HasMetaDataKey(f"Segment{number}_{key}")
        }
        number += 1
        name = told.get("Name") or told["ID"]
        if name in found:
            raise DataError(f"{path}: two segments are called {name!r}; rename one")
        if not _is_empty(told.get("Extent", "")):
            layer = int(told.get("Layer", number - 1 if image.GetNumberOfComponentsPerPixel() >= number else 0))
            found[name] = (layer, int(told.get("LabelValue", 1)))
    if number and not found:
        raise DataError(f"{path}: all its segments are empty; mark the lesion or leave the cell empty")
    return found if number else None


def _is_empty(extent: str) -> bool:
    """Whether a segment's first and last voxels, `0 9 0 9 0 9`, hold none between them."""
    ends = [int(n) for n in extent.split()]
    return len(ends) == 6 and any(last < first for first, last in zip(ends[::2], ends[1::2], strict=True))

"""ITK's HDF5 transforms (`.h5`), which `SimpleITK.ReadTransform` and 3D Slicer open.

ITK's own writer would keep doubles without compression and name the operating system in the file.
"""

import h5py
import numpy as np
from numpy.typing import NDArray

_TYPE = "DisplacementFieldTransform_double_3_3"
_GROUP = "TransformGroup/0"


def displacement_transform(
    vectors_lps: NDArray[np.float32], origin: NDArray[np.float64], spacing: NDArray[np.float64]
) -> bytes:
    """A displacement field as a transform: it takes a point p to p plus the vector at p; beyond its grid p stays.

    Args:
        vectors_lps: (nx, ny, nz, 3), LPS mm.
        origin: centre (3,) of the first voxel, LPS mm.
        spacing: distance (3,) of voxels along x, y and z, mm.
    """
    placed = np.concatenate([vectors_lps.shape[:3], origin, spacing, np.eye(3).ravel()]).astype(float)
    # ITK's x runs fastest.
    moved = np.ascontiguousarray(vectors_lps.transpose(2, 1, 0, 3), dtype=np.float32).ravel()
    with h5py.File("transform", "w", driver="core", backing_store=False) as file:
        group = file.create_group(_GROUP)
        group.create_dataset("TransformType", data=[_TYPE], dtype=h5py.string_dtype("ascii"))
        group.create_dataset("TransformFixedParameters", data=placed)
        packed = {"compression": "gzip", "shuffle": True, "chunks": (min(len(moved), 1 << 18),)}
        group.create_dataset("TransformParameters", data=moved, **packed)
        file.flush()
        return bytes(file.id.get_file_image())

"""MR volumes in NIfTI: axes, spacing, signs, samples and headers."""

import struct
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.random import Generator

from tests.mutants.case_folder import CaseFolder, Effect, edit_dicom, nifti_of, raw_header, save_nifti, world_map
from tests.mutants.mutations.registry import Mutations

VOLUME = Mutations("MR volume", ("nifti",))
_ALL = ("nifti", "both", "twin")


def _columns(with_mask: bool) -> tuple[str, ...]:
    return ("mr", "mr_lesion") if with_mask else ("mr",)


def axes(case: CaseFolder, random: Generator, order: Sequence[int], with_mask: bool = True) -> Effect:
    """The axes of the samples in another order under the old affine, as a careless converter leaves them."""
    voxels = np.eye(4)
    voxels[:3, :3] = np.eye(3)[list(order)]
    effect = Effect(note=f"axes {order}")
    for column in _columns(with_mask):
        path, image, data = nifti_of(case, column)
        save_nifti(path, np.ascontiguousarray(data.transpose(order)), image.affine)
        effect.world = world_map(image.affine, image.affine, voxels) if with_mask else effect.world
    return effect


def flipped(case: CaseFolder, random: Generator, axis: int, with_mask: bool = True) -> Effect:
    """One axis of the samples reversed under the old affine."""
    effect, voxels = Effect(note=f"axis {axis} reversed"), np.eye(4)
    for column in _columns(with_mask):
        path, image, data = nifti_of(case, column)
        save_nifti(path, np.ascontiguousarray(np.flip(data, axis)), image.affine)
        voxels[axis, axis], voxels[axis, 3] = -1.0, data.shape[axis] - 1.0
        effect.world = world_map(image.affine, image.affine, voxels) if with_mask else effect.world
    return effect


def other_affine(case: CaseFolder, matrix: np.ndarray, with_mask: bool, note: str, before: bool = False) -> Effect:
    """Multiply the affine, in the patient's axes or (before) the voxels'."""
    effect = Effect(note=note)
    for column in _columns(with_mask):
        path, image, data = nifti_of(case, column)
        new = image.affine @ matrix if before else matrix @ image.affine
        save_nifti(path, data, new)
        effect.world = world_map(image.affine, new) if with_mask else effect.world
    return effect


def spacing(case: CaseFolder, random: Generator, factors: Sequence[float], with_mask: bool = True) -> Effect:
    """Other voxel sizes, about the volume's origin."""
    return other_affine(case, np.diag([*factors, 1.0]), with_mask, f"voxels times {tuple(factors)}", before=True)


def mirrored_affine(case: CaseFolder, random: Generator, signs: Sequence[float]) -> Effect:
    """RAS taken for LPS, or one sign lost: the volume and the mask in another frame."""
    return other_affine(case, np.diag([*signs, 1.0]), True, f"affine times {tuple(signs)}")


def moved_alone(case: CaseFolder, random: Generator, far: tuple[float, float]) -> Effect:
    """The volume at another place than its mask and its landmarks."""
    step = random.uniform(*far) * np.array([1.0, 0.0, 0.0])
    path, image, data = nifti_of(case)
    affine = np.array(image.affine)
    affine[:3, 3] += step
    save_nifti(path, data, affine)
    return Effect(note=f"moved by {step[0]:.0f} mm")


def blank_slices(case: CaseFolder, random: Generator, share: float, axis: int = 2) -> Effect:
    path, image, data = nifti_of(case)
    count = data.shape[axis]
    first = int(random.integers(0, max(1, count - round(share * count))))
    where: list[Any] = [slice(None)] * 3
    where[axis] = slice(first, first + max(1, round(share * count)))
    data[tuple(where)] = 0
    save_nifti(path, data, image.affine)
    return Effect(note=f"axis {axis}, {share:.0%} from {first}")


def scattered_slices(case: CaseFolder, random: Generator, every: int) -> Effect:
    path, image, data = nifti_of(case)
    data[:, :, ::every] = 0
    save_nifti(path, data, image.affine)
    return Effect(note=f"every slice of {every} is blank")


def not_finite(case: CaseFolder, random: Generator, value: float, count: int) -> Effect:
    path, image, data = nifti_of(case)
    data = data.astype(np.float32)
    data.reshape(-1)[random.integers(0, data.size, size=count)] = value
    save_nifti(path, data, image.affine)
    return Effect(note=f"{count} voxels {value}")


def cut(case: CaseFolder, random: Generator, axis: int, low: float, high: float) -> Effect:
    """A part of the volume alone, mask with it, at its right place."""
    for column in ("mr", "mr_lesion"):
        path, image, data = nifti_of(case, column)
        count, where = data.shape[axis], [slice(None)] * 3
        where[axis] = slice(round(low * count), round(high * count))
        start = np.zeros(3)
        start[axis] = where[axis].start
        affine = np.array(image.affine)
        affine[:3, 3] = image.affine[:3, :3] @ start + image.affine[:3, 3]
        save_nifti(path, np.ascontiguousarray(data[tuple(where)]), affine)
    return Effect(note=f"axis {axis}, {low:.0%} to {high:.0%}")


def every_second_slice(case: CaseFolder, random: Generator) -> Effect:
    """Slices lost, the spacing unchanged."""
    for column in ("mr", "mr_lesion"):
        path, image, data = nifti_of(case, column)
        save_nifti(path, np.ascontiguousarray(data[:, :, ::2]), image.affine)
    return Effect(note="every second slice lost")


def samples(case: CaseFolder, random: Generator, change: Callable[[np.ndarray, Generator], np.ndarray]) -> Effect:
    path, image, data = nifti_of(case)
    save_nifti(path, change(data, random), image.affine)
    return Effect()


def field_bytes(case: CaseFolder, random: Generator, at: int, form: str, values: Sequence[float]) -> Effect:
    """A field of the header as it stands in the file."""
    path = case.path("mr", suffix=".nii.gz")

    def change(content: bytearray) -> None:
        content[at : at + struct.calcsize(form)] = struct.pack(form, *values)

    raw_header(path, change)
    return Effect(note=f"header at {at}: {values}")


def constant(data: np.ndarray, random: Generator) -> np.ndarray:
    return np.full_like(data, 100)


def noise(data: np.ndarray, random: Generator) -> np.ndarray:
    return random.integers(0, int(data.max()), size=data.shape).astype(data.dtype)


def subtraction(data: np.ndarray, random: Generator) -> np.ndarray:
    """What is left when a volume is taken from its own repetition."""
    again = data * (1.0 + 0.01 * random.standard_normal(data.shape))
    return (data - again + 8.0 * random.standard_normal(data.shape)).astype(np.float32)


def low_byte(data: np.ndarray, random: Generator) -> np.ndarray:
    return (data.astype(np.int64) % 256).astype(np.uint8)


def negative(data: np.ndarray, random: Generator) -> np.ndarray:
    return (data.max() - data).astype(data.dtype)


def projection(data: np.ndarray, random: Generator) -> np.ndarray:
    """A maximum intensity projection, repeated."""
    return np.repeat(data.max(axis=1, keepdims=True), data.shape[1], axis=1)


def thresholded(data: np.ndarray, random: Generator) -> np.ndarray:
    """A mask in the volume's place."""
    return (data > np.percentile(data, 70)).astype(np.uint8)


def complex_samples(data: np.ndarray, random: Generator) -> np.ndarray:
    return data.astype(np.complex64)


def two_volumes(data: np.ndarray, random: Generator) -> np.ndarray:
    return np.stack([data, data], axis=-1)


def plane(data: np.ndarray, random: Generator) -> np.ndarray:
    return data[:, :, :1]


def other_side(case: CaseFolder, random: Generator) -> Effect:
    """The table's side, of files that know none or of the MR volume alone."""
    case.case["laterality"] = "R" if case.case["laterality"] == "L" else "L"
    for view in list(case.views):
        if case.path("image", view).suffix == ".dcm":
            _without_side(case, view)
    return Effect(note=f"table says {case.case['laterality']}")


def _without_side(case: CaseFolder, view: str) -> None:
    def change(dataset: Any) -> None:
        for tag in ("ImageLaterality", "PatientOrientation", "Laterality"):
            if tag in dataset:
                del dataset[tag]

    edit_dicom(case.path("image", view), change)


for _order in ((1, 0, 2), (0, 2, 1), (2, 1, 0), (1, 2, 0), (2, 0, 1)):
    VOLUME.add(f"axes in the order {_order}", partial(axes, order=_order))
VOLUME.add("axes in another order, mask not", partial(axes, order=(2, 1, 0), with_mask=False))
for _axis in range(3):
    VOLUME.add(f"axis {_axis} reversed", partial(flipped, axis=_axis), bases=_ALL)
    VOLUME.add(f"axis {_axis} reversed, mask not", partial(flipped, axis=_axis, with_mask=False))
for _factors in (
    (10, 10, 10),
    (0.1, 0.1, 0.1),
    (1, 1, 10),
    (10, 1, 1),
    (1, 0.1, 1),
    (2, 2, 2),
    (1, 1, 2),
    (1.2, 1.2, 1.2),
    (0.8, 0.8, 0.8),
):
    VOLUME.add(f"voxels times {_factors}", partial(spacing, factors=_factors))
VOLUME.add("real: voxels times 1.2", partial(spacing, factors=(1.2, 1.2, 1.2)), bases=("twin",))
VOLUME.add("voxels times 10, mask not", partial(spacing, factors=(10, 10, 10), with_mask=False))
for _signs in ((-1, 1, 1), (1, -1, 1), (-1, -1, 1), (1, 1, -1)):
    VOLUME.add(f"affine times {_signs}", partial(mirrored_affine, signs=_signs), bases=_ALL)
VOLUME.add("moved away from its marks, little", partial(moved_alone, far=(1.0, 8.0)), times=2)
VOLUME.add("moved away from its marks, far", partial(moved_alone, far=(20.0, 200.0)), times=2)
for _share in (0.01, 0.1, 0.3, 0.6):
    VOLUME.add(f"{_share:.0%} of the slices blank", partial(blank_slices, share=_share), times=2)
VOLUME.add("30% of the columns blank", partial(blank_slices, share=0.3, axis=0))
VOLUME.add("30% of the front blank", partial(blank_slices, share=0.3, axis=1))
VOLUME.add("every third slice blank", partial(scattered_slices, every=3))
for _value in (np.nan, np.inf):
    for _count in (1, 5000):
        VOLUME.add(f"{_count} voxels {_value}", partial(not_finite, value=_value, count=_count))
for _cut in ((0, 0.0, 0.5), (0, 0.5, 1.0), (1, 0.0, 0.5), (1, 0.5, 1.0), (2, 0.0, 0.5), (2, 0.5, 1.0)):
    VOLUME.add(f"part {_cut} of an axis alone", partial(cut, axis=_cut[0], low=_cut[1], high=_cut[2]))
VOLUME.add("every second slice lost", every_second_slice)
for _change in (
    constant,
    noise,
    subtraction,
    low_byte,
    negative,
    projection,
    thresholded,
    complex_samples,
    two_volumes,
    plane,
):
    VOLUME.add(_change.__name__.replace("_", " "), partial(samples, change=_change))
VOLUME.add("the other side in the table", other_side, bases=("nifti", "pictures", "both", "twin", "victre"))
for _name, _at, _form, _values in (
    ("no dimensions", 40, "<h", (0,)),
    ("seven dimensions", 40, "<h", (7,)),
    ("dimension negative", 42, "<h", (-5,)),
    ("dimension huge", 42, "<h", (32000,)),
    ("unknown data type", 70, "<h", (9999,)),
    ("type of another size", 70, "<h", (64,)),
    ("pixdim zero", 80, "<f", (0.0,)),
    ("pixdim nan", 80, "<f", (float("nan"),)),
    ("vox_offset 348", 108, "<f", (348.0,)),
    ("vox_offset huge", 108, "<f", (1e9,)),
    ("scl_slope nan", 112, "<f", (float("nan"),)),
    ("scl_slope infinite", 112, "<f", (float("inf"),)),
    ("scl_slope negative", 112, "<f", (-1.0,)),
    ("metres", 123, "<B", (1,)),
    ("micrometres", 123, "<B", (3,)),
    ("sform and qform unset", 252, "<hh", (0, 0)),
    ("sform zero", 280, "<12f", (0.0,) * 12),
    ("sform nan", 280, "<f", (float("nan"),)),
    ("sform and qform differ", 280, "<4f", (5.0, 0.0, 0.0, 0.0)),
    ("magic damaged", 344, "<4s", (b"abcd",)),
):
    VOLUME.add(_name, partial(field_bytes, at=_at, form=_form, values=_values))
MUTATIONS = VOLUME.found

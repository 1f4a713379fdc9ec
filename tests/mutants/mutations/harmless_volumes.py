"""NIfTI volumes and masks that say in another way what they said."""

import gzip
from functools import partial
from typing import Any

import nibabel
import numpy as np
from numpy.random import Generator

from tests.mutants.case_folder import CaseFolder, Effect, nifti_of, save_nifti, world_map
from tests.mutants.mutations.marks import numbers
from tests.mutants.mutations.registry import Mutations

HARMLESS = Mutations("harmless", ("nifti",))


def gz_level(case: CaseFolder, random: Generator, column: str, level: int) -> Effect:
    path = case.path(column, suffix=".nii.gz")
    path.write_bytes(gzip.compress(gzip.decompress(path.read_bytes()), level))
    return Effect(note=f"{column} at level {level}")


def uncompressed(case: CaseFolder, random: Generator) -> Effect:
    content = gzip.decompress(case.path("mr", suffix=".nii.gz").read_bytes())
    case.rename("mr", None, "mr.nii").write_bytes(content)
    return Effect()


def another_type(case: CaseFolder, random: Generator, kind: Any, column: str = "mr") -> Effect:
    path, image, data = nifti_of(case, column)
    save_nifti(path, data.astype(kind), image.affine)
    return Effect(note=f"{column} {np.dtype(kind)}")


def mask_value(case: CaseFolder, random: Generator, value: float, kind: Any) -> Effect:
    path, image, data = nifti_of(case, "mr_lesion")
    save_nifti(path, ((data > 0) * value).astype(kind), image.affine)
    return Effect(note=f"mask of {value}")


def nifti_2(case: CaseFolder, random: Generator) -> Effect:
    path, image, data = nifti_of(case)
    save_nifti(path, data, image.affine, nibabel.Nifti2Image)
    return Effect()


def one_form(case: CaseFolder, random: Generator, keep: str) -> Effect:
    path, image, data = nifti_of(case)
    new = nibabel.Nifti1Image(data, image.affine)
    new.set_qform(image.affine, 1 if keep == "qform" else 0)
    new.set_sform(image.affine, 1 if keep == "sform" else 0)
    new.to_filename(path)
    return Effect(note=f"{keep} alone")


def big_endian(case: CaseFolder, random: Generator) -> Effect:
    path, image, data = nifti_of(case)
    header = nibabel.Nifti1Header(endianness=">")
    new = nibabel.Nifti1Image(data.astype(data.dtype.newbyteorder(">")), image.affine, header)
    new.set_sform(image.affine, 1)
    new.set_qform(image.affine, 1)
    new.to_filename(path)
    return Effect()


def other_axes(case: CaseFolder, random: Generator, code: str) -> Effect:
    """The same volume with its axes in another order and sense, which the affine says."""
    for column in ("mr", "mr_lesion"):
        path, image, data = nifti_of(case, column)
        loaded = nibabel.Nifti1Image(data, image.affine)
        now, then = nibabel.io_orientation(image.affine), nibabel.orientations.axcodes2ornt(code)
        new = loaded.as_reoriented(nibabel.orientations.ornt_transform(now, then))
        save_nifti(path, np.ascontiguousarray(np.asarray(new.dataobj)), new.affine)
    return Effect(note=code)


def one_more_axis(case: CaseFolder, random: Generator) -> Effect:
    path, image, data = nifti_of(case)
    save_nifti(path, data[..., None], image.affine)
    return Effect(note="a fourth axis of one")


def padded_volume(case: CaseFolder, random: Generator) -> Effect:
    """Three voxels of air in front, volume and mask alike."""
    for column in ("mr", "mr_lesion"):
        path, image, data = nifti_of(case, column)
        front = int(np.argmax(image.affine[1, :3] != 0))
        pads = [(0, 0)] * 3
        pads[front] = (3, 0) if image.affine[1, front] < 0 else (0, 3)
        shift = np.zeros(3)
        shift[front] = -float(pads[front][0])
        affine = np.array(image.affine)
        affine[:3, 3] += affine[:3, :3] @ shift
        save_nifti(path, np.pad(data, pads), affine)
    return Effect()


def scaled_values(case: CaseFolder, random: Generator) -> Effect:
    """Half the grey values on disk, twice by the header."""
    path, image, data = nifti_of(case)
    new = nibabel.Nifti1Image(data.astype(np.int16), image.affine)
    new.header.set_slope_inter(2.0, 0.0)
    new.set_sform(image.affine, 1)
    new.set_qform(image.affine, 1)
    nibabel.save(new, path)
    return Effect()


def brighter(case: CaseFolder, random: Generator) -> Effect:
    path, image, data = nifti_of(case)
    save_nifti(path, (data.astype(np.float32) * 3.0).astype(np.int16), image.affine)
    return Effect(note="grey values times 3")


def elsewhere(case: CaseFolder, random: Generator) -> Effect:
    """Volume, mask and landmarks in a patient frame with another origin."""
    step = random.uniform(-30.0, 30.0, 3)
    effect = Effect(note=f"moved by {step.round()}")
    for column in ("mr", "mr_lesion"):
        path, image, data = nifti_of(case, column)
        new = np.array(image.affine)
        new[:3, 3] += step * [-1, -1, 1]
        save_nifti(path, data, new)
        effect.world = world_map(image.affine, new)
    numbers(case, random, "mr_landmarks", lambda p: p + step)
    return effect


for _level in (1, 9):
    HARMLESS.add(f"mr.nii.gz at level {_level}", partial(gz_level, column="mr", level=_level), harmless=True)
HARMLESS.add("mr_lesion.nii.gz at level 1", partial(gz_level, column="mr_lesion", level=1), harmless=True)
for _kind in (np.int16, np.uint16, np.int32, np.float32, np.float64):
    HARMLESS.add(f"volume as {np.dtype(_kind)}", partial(another_type, kind=_kind), harmless=True)
for _value, _kind in ((255, np.uint8), (1, np.float32), (3, np.int16), (0.9999998, np.float64)):
    HARMLESS.add(f"mask of {_value} as {np.dtype(_kind)}", partial(mask_value, value=_value, kind=_kind), harmless=True)
for _form in ("sform", "qform"):
    HARMLESS.add(f"{_form} alone", partial(one_form, keep=_form), harmless=True)
for _code in ("RAS", "LPS", "PSR", "SAL"):
    HARMLESS.add(f"axes {_code}, as the header says", partial(other_axes, code=_code), harmless=True)
for _change in (uncompressed, nifti_2, big_endian, one_more_axis, padded_volume, scaled_values, brighter, elsewhere):
    HARMLESS.add(_change.__name__.replace("_", " "), _change, harmless=True)
_REAL = ("twin", "victre")
HARMLESS.add("real: gz at level 1", partial(gz_level, column="mr", level=1), bases=_REAL, harmless=True)
HARMLESS.add("real: volume as float64", partial(another_type, kind=np.float64), bases=_REAL, harmless=True)
MUTATIONS = HARMLESS.found

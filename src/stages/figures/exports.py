"""Files of a case that other programs open (3D Slicer, ParaView, ITK), by name inside its folder `export`."""

import re
from collections.abc import Sequence

from stages.figures.case import PicturedCase
from stages.figures.deformed import DeformedBreast
from stages.figures.grids import mr_grid, on_grid
from stages.formats.images import mask_png
from stages.formats.nifti import nifti_bytes

README = """Research use only.

Everything is in the patient's coordinates, in mm: DICOM's LPS (x towards the left, y to the back, z to the head).
NIfTI files say the same in their RAS, which their readers turn; VTU files are LPS.

lesion_<name>_<method>_mr.nii.gz     lesion predicted from the mammograms, on the voxels of the MR volume as given
lesion_<name>_<method>_<view>.png    lesion predicted from the MR volume, in the mammogram's pixels as stored
lesions.tsv                          each lesion's <name> in these files, its name as marked, and where it is marked
mr_<view>_<method>.nii.gz            MR volume as deformed between the plates of a view
mesh.vtu, mesh_<view>_<method>.vtu   undeformed and deformed mesh, with the displacement of the nodes
displacement_<view>_<method>_<way>   displacement field: .nii.gz, and .h5 as an ITK transform
displacement_..._mask.nii.gz         1 where the field is the model's own. Beyond, it is continued smoothly, so that
                                     interpolation is right up to the skin; it predicts nothing there

Which points go where
  forward   takes a point of the undeformed breast (the MR volume as given) to its place between the plates:
            place between the plates = point + vector at the point
  inverse   takes a point between the plates back to the undeformed breast
To carry points (landmarks, contours) take the way that they go: ReadTransform("..._forward.h5").TransformPoint(p).
To resample an image take the opposite one, for resampling asks for each voxel of the result where it came from:
the MR volume is shown between the plates by ..._inverse.h5, a compressed volume is shown undeformed by ..._forward.h5.
3D Slicer takes .h5 files as resampling asks: put the MR volume and its markups under ..._inverse.h5.
"""
_PLACED = """
Where the breast lies between the plates of {view}: the second MR volume's outline places it, by a shift from where
views.csv has the plates; files named {view}_<method> lie on that volume. The shifts (x, y, z):
"""
_POSED = """
Between the plates of {view} the breast lies where views.csv has its plates; how high the patient was held over them is
not known, so the middle of the breast stays at its height.
"""


def case_exports(case: PicturedCase) -> dict[str, bytes]:
    """All files of a case as far as its stages came.

    Returns:
        Contents by file name; empty where not even the mesh exists.
    """
    if case.block is None:
        return {}
    deformed = DeformedBreast(case, case.block)
    files = {"README.txt": _readme(case, deformed).encode()} | deformed.files()
    return files | _lesion_names(case) | _lesions_in_mr(case) | _lesions_in_mammograms(case)


def _readme(case: PicturedCase, deformed: DeformedBreast) -> str:
    text = README
    for view in deformed.best:
        if view != case.second_view:
            text += _POSED.format(view=view)
            continue
        text += _PLACED.format(view=view)
        shifts = {method: shift for (v, method), shift in deformed.placings.items() if v == view}
        text += "".join(f"  {method:10}" + "{:8.2f} {:8.2f} {:8.2f}\n".format(*s) for method, s in shifts.items())
    return text


def file_names(names: Sequence[str]) -> dict[str, str]:
    """A lesion's name in file names: letters, digits, "-" and "_" alone, and each once."""
    found: dict[str, str] = {}
    for name in names:
        plain = label = re.sub(r"[^A-Za-z0-9_-]+", "_", name)
        number = 1
        while label in found.values():
            number += 1
            label = f"{plain}_{number}"
        found[name] = label
    return found


def _lesion_names(case: PicturedCase) -> dict[str, bytes]:
    """Each lesion's name in the files, as marked, and where it is marked."""
    labels = file_names(case.lesions)
    where = {"mr": case.mr_lesions, "mammograms": case.mammogram_lesions}
    lines = [f"{labels[n]}\t{n}\t{'+'.join(w for w, names in where.items() if n in names)}" for n in case.lesions]
    return {"lesions.tsv": "\n".join(["file_name\tname\tmarked_in", *lines, ""]).encode()} if lines else {}


def _lesions_in_mr(case: PicturedCase) -> dict[str, bytes]:
    """Regions in the MR volume, on the voxels of the volume that the user gave."""
    path, predictions, labels = case.inputs.path("mr"), case.predictions, file_names(case.lesions)
    if path is None or predictions is None or not case.mammogram_lesions:
        return {}
    shape, affine = mr_grid(path, case.laterality, case.mr_series)
    files = {}
    for name in case.mammogram_lesions:
        for method in sorted({method for view in case.imaged for method in case.methods[view]}):
            region = predictions.region(method, name)
            if region is not None:
                mask = on_grid(region, shape, affine)
                files[f"lesion_{labels[name]}_{method}_mr.nii.gz"] = nifti_bytes(mask, affine)
    return files


def _lesions_in_mammograms(case: PicturedCase) -> dict[str, bytes]:
    """Predicted lesions as pictures of the stored mammogram's size."""
    files: dict[str, bytes] = {}
    predictions, labels = case.predictions, file_names(case.lesions)
    if predictions is None:
        return files
    for view, pose in case.imaged.items():
        for method in sorted(case.methods[view]):
            for name in case.mr_lesions:
                area = predictions.area(view, method, name)
                if area is not None:
                    canonical = area.on_image(pose.geometry.rows, pose.geometry.columns)
                    files[f"lesion_{labels[name]}_{method}_{view}.png"] = mask_png(pose.stored_image(canonical))
    return files

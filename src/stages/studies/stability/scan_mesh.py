"""The breast of the scan that the key `stability_scan` names, meshed for the stability study."""

from mammoreg.errors import DataError
from mammoreg.geometry import breast_to_lps, lps_to_breast
from mammoreg.geometry.frames import Laterality
from mammoreg.meshing.breast import build_mesh
from mammoreg.scenes.scenario import LEVELS
from stages.engine.contract import Array, Fields, Inputs, SettingsModel, Stage, Subject
from stages.segment import stage as segment


class Settings(SettingsModel):
    """`stability_scan_mesh` has no settings: segmentation and mesher work as for a case."""


def run(inputs: Inputs, settings: Settings, subject: Subject) -> Fields:
    """Segment the right breast, or the left one where the scan shows no right one, and mesh it at every size."""
    side, found = _segmented(inputs)
    mask = found.volumes["breast_mask"].volume.to_breast(side)
    back, nipple = (lps_to_breast(found.arrays[name].data, side) for name in ("chest_wall_surface", "nipple"))
    meshes = {n: build_mesh(mask, back, nipple, n).mesh for n in LEVELS["elements"]}
    arrays = {
        f"points/{n}": Array(breast_to_lps(mesh.points, side), "mm", f"nodes of the block of {n} elements a side")
        for n, mesh in meshes.items()
    }
    return Fields(arrays=arrays, values={"laterality": side})


def _segmented(inputs: Inputs) -> tuple[Laterality, Fields]:
    scan = inputs.path("scan")
    assert scan is not None
    faults = []
    sides: tuple[Laterality, Laterality] = ("R", "L")
    for side in sides:
        try:
            return side, segment.run(Inputs({"mr": scan}), segment.Settings(), Subject("stability", side))
        except DataError as error:
            faults.append(str(error))
    raise DataError(f"key stability_scan: {faults[0]}")


STAGE = Stage(name="stability_scan_mesh", schema=1, inputs=("scan",), settings=Settings, run=run)

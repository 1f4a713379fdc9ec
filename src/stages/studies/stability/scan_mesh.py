"""The breast of the scan that the key `stability_scan` names, meshed for the stability study."""

import numpy as np

from mammoreg.errors import DataError
from mammoreg.geometry.frames import Laterality
from mammoreg.imaging.mr_segment import Segmentation, SegmentSettings, segment_volume
from mammoreg.meshing.breast import build_mesh
from mammoreg.scenes.scenario import LEVELS
from stages.bias import n4_field
from stages.cohort.readers.mr.volume import read_mr
from stages.engine.contract import Fields, Inputs, NoSettings, Stage, Subject
from stages.studies.stability.record import scan_mesh_fields


def run(inputs: Inputs, settings: NoSettings, subject: Subject) -> Fields:
    """Segment the right breast, or the left one where the scan shows no right one, and mesh it at every size."""
    side, found = _segmented(inputs)
    mask = found.mr.with_data(found.breast.astype(np.uint8))
    meshes = {n: build_mesh(mask, found.back, found.nipple, n).mesh for n in LEVELS["elements"]}
    return scan_mesh_fields(meshes, side)


def _segmented(inputs: Inputs) -> tuple[Laterality, Segmentation]:
    scan = inputs.path("scan")
    assert scan is not None
    mr, faults = read_mr(scan), []
    sides: tuple[Laterality, Laterality] = ("R", "L")
    for side in sides:
        try:
            return side, segment_volume(mr.to_breast(side), None, SegmentSettings(), n4_field)
        except DataError as error:
            faults.append(str(error))
    raise DataError(f"key stability_scan: {faults[0]}")


STAGE = Stage(name="stability_scan_mesh", schema=1, inputs=("scan",), settings=NoSettings, run=run)

"""Coordinate frames, axis-aligned volumes and the imaging geometry of a view.

Three frames are used, all in mm:

* LPS: DICOM patient coordinates, the frame of every file and artefact.
* breast: (medial, posterior, superior) = (-s x, y, z) with s = +1 for a left and -1 for a right breast. A right
  breast's equals LPS; a left breast is mirrored, so that the numerics see one side only and predictions of mirrored
  patients mirror exactly.
* plate: the breast frame turned about the posterior axis by the projection angle, (medial along the plate, posterior,
  height towards the source).

A point source stands above the chest-wall edge of the detector, in its middle row; the detector lies on the lower
plate's far side. From the breast the source lies along (-s sin a, 0, cos a) in LPS, a the projection angle: positive a
turns it towards the middle of the body. CC: a small signed roll, 0 in headers; MLO: the absolute value of the header's
angle; those of the other views stand in `mammoreg.imaging.views`. In an image as usually stored, rows of pixels run
between chest wall and nipple and follow each other along (-s cos a, 0, -sin a), which is towards medial in CC and MLO.
Plates end at the detector's chest-wall edge; the image shows only what lies in front of it.
"""

from mammoreg.geometry.affine import volume_of_affine
from mammoreg.geometry.frames import breast_to_lps, breast_to_plate, lps_to_breast, plate_to_breast
from mammoreg.geometry.view import ViewGeometry
from mammoreg.geometry.volume import Volume

__all__ = [
    "ViewGeometry",
    "Volume",
    "breast_to_lps",
    "breast_to_plate",
    "lps_to_breast",
    "plate_to_breast",
    "volume_of_affine",
]

"""Coordinate frames, axis-aligned volumes and the imaging geometry of a view.

Three frames are used, all in mm:

* LPS: DICOM patient coordinates, the frame of every file and artefact.
* breast: (medial, posterior, superior) = (-s x, y, z) with s = +1 for a left and -1 for a right breast. A right
  breast's equals LPS; a left breast is mirrored, so that the numerics see one side only and predictions of mirrored
  patients mirror exactly.
* plate: the breast frame turned about the posterior axis by the projection angle, (medial along the plate, posterior,
  height towards the source).
"""

from mammoreg.geometry.frames import breast_to_lps, breast_to_plate, lps_to_breast, plate_to_breast
from mammoreg.geometry.view import ViewGeometry
from mammoreg.geometry.volume import Volume

__all__ = ["ViewGeometry", "Volume", "breast_to_lps", "breast_to_plate", "lps_to_breast", "plate_to_breast"]

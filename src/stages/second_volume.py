"""The second MR volume of a case, between the plates, as what is placed in it knows it."""

from collections.abc import Container

from mammoreg.localization.to_compressed import SecondVolume
from mammoreg.meshing.block import BlockMesh
from stages.segment.record import SegmentRecord
from stages.views import IMAGED, SECOND_VOLUME

_SKIN_PARTS = 2


def second_volume(segment: SegmentRecord, block: BlockMesh) -> SecondVolume | None:
    """The second volume of a case, None without one."""
    mask = segment.compressed_mask
    return None if mask is None else SecondVolume(mask, block.skin_points(_SKIN_PARTS))


def view_in_second_volume(views: Container[str]) -> str | None:
    """The view whose compression the second volume shows."""
    return next((view for view in (SECOND_VOLUME, *IMAGED) if view in views), None)

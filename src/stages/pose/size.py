"""Whether a mammogram and the breast of the MR volume are of one size.

Pixel spacing and thickness are what users and exports get wrong. Three views of the breast's size are compared: the
image's area times the thickness, the volume of the breast in the MR volume, and its silhouette between the plates.
The bands are those of 31 views of 15 patients whose sizes are known (twins, standing, VICTRE, embedded), with a margin.
"""

import numpy as np

from mammoreg.errors import DataError
from mammoreg.geometry import ViewGeometry
from mammoreg.pose.size import imaged_volume_ml
from stages.engine.contract import Value
from stages.pose.view_facts import ViewFacts
from stages.segment.record import SegmentRecord

IMPOSSIBLE_SHARE = (0.2, 3.0)
"""Imaged volume over the MR breast's beyond which a view fails."""
ODD_SHARE = (0.4, 2.0)
"""The same, beyond which a view is flagged; views of known size have 0.63 to 1.45, where the model is cut off 1.9."""
ODD_SIZE = (0.75, 1.14)
"""Relative size beyond which a view is flagged; views of known size have 0.81 to 1.10."""
IMPOSSIBLE_SIZE = (0.65, 1.5)
"""Relative size beyond which a view fails."""

_CAUSES = "check pixel spacing, thickness, magnification, and that MR volume and mammogram belong to one breast"


def check_imaged_volume(facts: ViewFacts, segment: SegmentRecord) -> tuple[dict[str, Value], tuple[str, ...]]:
    """Volume that the image shows, the muscle left out, beside the MR breast's: values to keep, and doubts.

    Raises:
        DataError: they cannot be of one breast.
    """
    view = facts.seen.geometry
    if facts.tissue is None or not np.isfinite(view.thickness_mm):
        return {}, ()
    shown_ml = imaged_volume_ml(int(np.count_nonzero(facts.tissue == 1)), view)
    breast_ml = _volume_ml(segment)
    share = shown_ml / breast_ml
    text = (
        f"the mammogram shows {shown_ml:.0f} ml (area x thickness, pixels of {view.pixel_mm:.3g} mm, "
        f"{view.thickness_mm:.3g} mm thick), the MR volume a breast of {breast_ml:.0f} ml"
    )
    if not IMPOSSIBLE_SHARE[0] <= share <= IMPOSSIBLE_SHARE[1]:
        raise DataError(f"{text}: they are not of one size; {_CAUSES}{_unit_hint(view)}")
    odd = not ODD_SHARE[0] <= share <= ODD_SHARE[1]
    return {"imaged_ml": round(shown_ml, 1), "imaged_share": round(share, 4)}, (
        (f"sizes differ: {text}",) if odd else ()
    )


def _volume_ml(segment: SegmentRecord) -> float:
    mask = segment.breast_mask
    return float(np.count_nonzero(mask.data)) * mask.voxel_mm3 / 1000.0


def _unit_hint(view: ViewGeometry) -> str:
    return " (the thickness is in mm, not cm)" if view.thickness_mm < 15.0 else ""


def check_size(size: float, view: ViewGeometry) -> tuple[str, ...]:
    """Doubts about a view whose outline is of another size than the compressed breast's silhouette.

    Raises:
        DataError: they cannot be of one breast.
    """
    text = size_text(size)
    if not IMPOSSIBLE_SIZE[0] <= size <= IMPOSSIBLE_SIZE[1]:
        given = f"pixels of {view.pixel_mm:.3g} mm, plates {view.thickness_mm:.3g} mm apart"
        raise DataError(f"{text} ({given}); {_CAUSES}{_unit_hint(view)}")
    return () if ODD_SIZE[0] <= size <= ODD_SIZE[1] else (f"{text}: {_CAUSES}",)


def size_text(size: float) -> str:
    """A relative size in words."""
    off = f"{abs(1.0 / size - 1.0):.0%}"
    return (
        f"the mammogram's breast is {off} {'smaller' if size > 1.0 else 'larger'} than the MR volume's between plates"
    )

"""The projection angle of a view from what a header or a table says: vendors differ in its sign and its zero."""

from mammoreg.errors import DataError
from mammoreg.imaging.views import PROJECTIONS, View


def projection_angle(value_deg: float, view: View) -> tuple[float, str]:
    """The angle a of `mammoreg.geometry` that an angle of a header or a table means in a view.

    Of MLO, ML, LM and LMO only its size counts. An LMO within 90 degrees and an FB near 0 are told from the opposite
    side, as the unit stands upside down in these.

    Returns:
        a in degrees, and what was done to the angle, empty where it is clear.

    Raises:
        DataError: no such view is taken at this angle.
    """
    turned = (value_deg + 180.0) % 360.0 - 180.0
    size = abs(turned)
    angle, remark = turned, ""
    if view in ("MLO", "ML"):
        angle = size
        remark = f"negative angle {value_deg:g} degrees in {view}: its absolute value is used" if turned < 0.0 else ""
    elif view == "LM":
        angle = -size
    elif view == "LMO":
        angle = -size if size > 90.0 else size - 180.0
        remark = "" if size > 90.0 else f"angle {value_deg:g} degrees in LMO read as {angle:g}: the source is below"
    elif view == "FB":
        angle = turned % 360.0 if size > 90.0 else 180.0 + turned
        remark = "" if size > 90.0 or turned == 0.0 else f"angle {value_deg:g} degrees in FB read from below"
    projection = PROJECTIONS[view]
    if not projection.lowest_deg <= angle <= projection.highest_deg:
        raise DataError(f"angle {value_deg:g} degrees is impossible in {view}")
    return angle, remark


def is_no_angle(view: View) -> bool:
    """Whether an angle of zero, which some write for unknown, cannot be meant in a view."""
    try:
        projection_angle(0.0, view)
    except DataError:
        return True
    return False

"""Which way the rows of a picture without orientation run: both orders are posed, and the better one tells."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from mammoreg.errors import DataError, NotConvergedError
from mammoreg.geometry.frames import Laterality
from mammoreg.imaging.mammogram_orientation import orientation_of_flips
from mammoreg.imaging.views import PROJECTIONS, View
from mammoreg.pose.outlined import OutlinedMammogram, OutlinedView
from mammoreg.pose.search import FoundPose

DECISIVE = 6.0
"""Chosen: difference of the misfits (minus twice a log likelihood), 20 to 1, that decides the order."""
ORDER_ASSUMED = "row order not determined by the image, taken as usually stored"


@dataclass(frozen=True)
class OrderedPose:
    """The pose of the row order that explains an image.

    Attributes:
        chosen: which of the orders that were tried.
        found: its pose.
        doubts: what speaks against the order, in words.
    """

    chosen: int
    found: FoundPose
    doubts: tuple[str, ...] = ()


def pose_in_order(
    orders: Sequence[OutlinedMammogram],
    find: Callable[[OutlinedView], FoundPose],
    laterality: Laterality,
    view: View,
) -> OrderedPose:
    """Pose a view, in both orders of its rows where its orientation is not known.

    Args:
        orders: the image in the order that is known, or in both, the usual one first.
        find: seeks the pose of a view.

    Raises:
        DataError: the misfits do not decide, and the view is stored either way, or the chest wall lies at the edge at
            which it is not usually stored, so that the picture is mirrored or turned; or whatever `find` raises of the
            usual order.
    """
    if len(orders) == 1:
        return OrderedPose(0, find(orders[0].view))
    tried = [_attempt(find, order.view) for order in orders]
    usual, turned = (_misfit(one) + extra for one, extra in zip(tried, _without_muscle(orders), strict=True))
    chosen = int(turned < usual)
    found = tried[chosen]
    decided = abs(usual - turned) >= DECISIVE if min(usual, turned) < float("inf") else True
    if not decided:
        if not (_usual_side(orders[0], laterality) and PROJECTIONS[view].hung_as_canonical):
            raise DataError(_asked_for(orders, laterality, view))
        chosen, found = 0, tried[0]
    if isinstance(found, Exception):
        raise found
    return OrderedPose(chosen, found, () if decided else (ORDER_ASSUMED,))


def _attempt(
    find: Callable[[OutlinedView], FoundPose], view: OutlinedView
) -> FoundPose | DataError | NotConvergedError:
    try:
        return find(view)
    except (DataError, NotConvergedError) as error:
        return error


def _misfit(found: FoundPose | DataError | NotConvergedError) -> float:
    estimate = None if isinstance(found, Exception) else found.estimate
    return float("inf") if estimate is None else min(candidate.misfit for candidate in estimate.candidates)


def _without_muscle(orders: Sequence[OutlinedMammogram]) -> list[float]:
    """What speaks against each order: the pectoral muscle shows in its superior corner in another one alone."""
    seen = [order.found.pectoral is not None for order in orders]
    return [DECISIVE if any(seen) and not one else 0.0 for one in seen]


def _usual_side(order: OutlinedMammogram, laterality: Laterality) -> bool:
    return order.image.flips.chest_wall_side == ("left" if laterality == "L" else "right")


def _asked_for(orders: Sequence[OutlinedMammogram], laterality: Laterality, view: View) -> str:
    mirrored, turned = (orientation_of_flips(order.image.flips, laterality, view) for order in orders)
    side = orders[0].image.flips.chest_wall_side
    if _usual_side(orders[0], laterality):
        return (
            f"the picture does not tell which way its rows run, and a {view} is stored either way; fill the column "
            f"'orientation' in the views table, with {mirrored} or {turned}"
        )
    return (
        f"the picture does not tell which way its rows run: its chest wall lies at the {side} edge, so that it is "
        f"mirrored or turned by 180 degrees; fill the column 'orientation' in the views table, with {mirrored} if it "
        f"is mirrored, {turned} if it is turned"
    )

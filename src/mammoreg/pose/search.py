"""The pose of a view from nothing but what its image shows: start, coarse compressions, best angle."""

from dataclasses import dataclass

from mammoreg.breast.mechanics import BreastMechanics
from mammoreg.meshing.block import BlockMesh
from mammoreg.meshing.skin import skin_facets
from mammoreg.pose.coarse import coarse_compression
from mammoreg.pose.estimate import DenseTissue, PoseEstimate, estimate_pose
from mammoreg.pose.outlined import OutlinedView
from mammoreg.pose.start import Start, start_view

_FACETS = 2


@dataclass(frozen=True)
class PoseSearch:
    """How the projection angle is sought.

    Attributes:
        angle_step_deg: distance of the angles tried; 0 keeps the header's angle.
        angle_bound_deg: largest offset from it.
        angle_sd_deg: its standard deviation.
    """

    angle_step_deg: float = 4.0
    angle_bound_deg: float = 16.0
    angle_sd_deg: float = 5.0


@dataclass(frozen=True)
class FoundPose:
    """What a search has come to.

    Attributes:
        start: where the search began.
        estimate: the pose; None where the coarse compression converged at no angle.
    """

    start: Start
    estimate: PoseEstimate | None


def find_pose(
    view: OutlinedView,
    mesh: BlockMesh,
    mechanics: BreastMechanics,
    mu_kpa: float,
    tissue: DenseTissue | None,
    search: PoseSearch,
) -> FoundPose:
    """Seek angle, edge, middle and height of a view.

    Args:
        view: as its image shows it.
        mesh: undeformed, breast frame.
        mechanics: of the coarse compression.
        mu_kpa: shear modulus.
        tissue: dense tissue that judges the angle beside the outline, if it shall.
        search: how the angle is sought; a second volume shows it, and it is kept then.

    Raises:
        DataError: the thickness is no compression of this breast, or cannot be estimated.
    """
    compress = coarse_compression(mesh, mechanics, mu_kpa, plates_known=view.placed)
    start = start_view(view, mesh, compress)
    estimate = estimate_pose(
        start.view,
        view.outline,
        compress,
        skin_facets(mesh.skin_quads(), len(mesh.points), _FACETS),
        0.0 if view.placed else search.angle_step_deg,
        search.angle_bound_deg,
        search.angle_sd_deg,
        None if view.placed else tissue,
        view.density,
    )
    return FoundPose(start, estimate)

"""Surface of a compressed breast drawn to a mammogram's outline, and which of its nodes are known by that."""

from dataclasses import dataclass

import numpy as np

from mammoreg.arrays import Integers, Points
from mammoreg.fem.plates.closing import Closed, Closing
from mammoreg.geometry import ViewGeometry
from mammoreg.meshing.block import BlockMesh
from mammoreg.meshing.skin import skin_facets
from mammoreg.pose.outline import RadialOutline
from mammoreg.shape.estimate import ShapeEstimate, estimate_shape

TOUCHING_MM = 1.0  # a node nearer to a plate's flat face lies on it


@dataclass(frozen=True)
class ShapeOptions:
    """How a silhouette is drawn onto an outline.

    Attributes:
        tie_stiffness: of the outline's ties, in units of the shear modulus.
        rounds: renewals of the ties at most.
        settled_mm: mean misfit at which the silhouette is settled.
        facets: per face and side, for silhouettes.
    """

    tie_stiffness: float = 20.0
    rounds: int = 4
    settled_mm: float = 0.1
    facets: int = 3


@dataclass(frozen=True)
class DrawnSurface:
    """A breast between plates whose silhouette lies on the outline.

    Attributes:
        nodes: numbers (B,) of the mesh nodes on the skin, and of the back on the plates.
        closed: the breast between the plates, drawn to the outline.
        estimate: how well the outline was met before and after; None without one.
        contact_drift_mm: largest motion along the compression of nodes that lay on the plates.
    """

    nodes: Integers
    closed: Closed
    estimate: ShapeEstimate | None = None
    contact_drift_mm: float = 0.0

    @property
    def surface(self) -> Points:
        """Places (B, 3) of the nodes, in the frame of the closing, mm."""
        return np.asarray(self.closed.deformed[self.nodes])


def drawn_surface(
    mesh: BlockMesh,
    closing: Closing,
    closed: Closed,
    view: ViewGeometry,
    outline: RadialOutline | None,
    stiffness_ratio: float,
    options: ShapeOptions,
) -> DrawnSurface:
    """Draw the silhouette of a compressed breast onto the outline; without one the surface stays as it is.

    Args:
        mesh: undeformed, breast frame.
        closing: the plates; `closed` is what they came to.
        view: geometry of the image, in the frame of `closed`.
        outline: of the image.
        stiffness_ratio: of the tissue at the compression over the initial one.
        options: how.

    Raises:
        NotConvergedError: with the reason.
    """
    nodes = np.union1d(mesh.skin_nodes(), _on_plates(mesh.back_nodes(), closing, closed))
    if outline is None:
        return DrawnSurface(nodes, closed)
    found = estimate_shape(
        closing,
        closed,
        mesh.skin_quads(),
        skin_facets(mesh.skin_quads(), len(mesh.points), options.facets),
        view,
        outline,
        options.tie_stiffness * stiffness_ratio,
        options.rounds,
        options.settled_mm,
    )
    drift = _drift(_on_plates(mesh.skin_nodes(), closing, closed), closed, found.closed)
    return DrawnSurface(nodes, found.closed, found, drift)


def _on_plates(nodes: Integers, closing: Closing, closed: Closed) -> Integers:
    """Those of `nodes` (B,) that lie on the plates' flat faces."""
    flat = nodes if closing.edge is None else nodes[closed.deformed[nodes, 1] < closing.edge - closing.lip]
    height = closed.deformed[flat, 2] - closed.height_mm
    return np.asarray(flat[(height < TOUCHING_MM) | (height > closed.gap_mm - TOUCHING_MM)])


def _drift(nodes: Integers, before: Closed, after: Closed) -> float:
    """Largest motion along the compression of nodes (B,) that lay on the plates, mm."""
    heights = [closed.deformed[nodes, 2] - closed.height_mm for closed in (before, after)]
    return float(np.abs(heights[1] - heights[0]).max(initial=0.0))

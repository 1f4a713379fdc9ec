"""A breast and the plates of a view around it, before they close."""

from dataclasses import dataclass, replace

from mammoreg.arrays import Floats
from mammoreg.breast.mechanics import BreastMechanics
from mammoreg.breast.placed import PlacedBreast, closing_plates, place_breast
from mammoreg.contact.soft import touching
from mammoreg.fem.plates.closing import Closing, ClosingOptions
from mammoreg.geometry import ViewGeometry, breast_to_plate
from mammoreg.meshing.block import BlockMesh


@dataclass(frozen=True)
class Compression:
    """A breast ready to be compressed.

    Attributes:
        breast: in the plate frame.
        closing: the plates around it.
        share: of the thickness between the plates that they are to take away.
    """

    breast: PlacedBreast
    closing: Closing
    share: float


def prepare_compression(
    mesh: BlockMesh,
    view: ViewGeometry,
    mechanics: BreastMechanics,
    mu_kpa: float,
    gland: Floats | None = None,
    options: ClosingOptions | None = None,
    lower_mm: float | None = None,
) -> Compression:
    """Turn a breast to a view's angle and put the view's plates around it.

    Args:
        mesh: undeformed, breast frame.
        view: angle, chest-wall edge and thickness.
        mechanics: tissue, plates and back.
        mu_kpa: shear modulus of the homogeneous tissue, the volume's mean where gland differs from fat.
        gland: fraction of gland in each element (E,), where the material tells gland from fat.
        options: numerical settings, the contact's stiffness for tissue that does not stiffen.
        lower_mm: height of the lower plate where a second volume shows it.
    """
    skin = breast_to_plate(mesh.points[mesh.skin_nodes()], view.angle_deg)
    low, high = touching(skin, view.edge_p_mm if mechanics.plates_end else None, mechanics.lip_radius_mm)
    share = max(0.0, 1.0 - view.thickness_mm / (high - low))
    breast = place_breast(mesh, view.angle_deg, mechanics, mu_kpa, gland, share)
    options = options if options is not None else ClosingOptions()
    options = replace(options, penalty_per_mm=options.penalty_per_mm * breast.stiffness_ratio)
    return Compression(breast, closing_plates(breast, view.edge_p_mm, mechanics, options, lower_mm), share)

"""A scenario as a breast between plates, with the pipeline's own back, plates and numerical settings."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mammoreg.fem.elements.model import HyperelasticModel
from mammoreg.fem.parts.back import BackCondition, back_condition
from mammoreg.fem.plates.closing import Closed, Closing, ClosingOptions
from mammoreg.meshing.block import BlockMesh
from mammoreg.scenes.gland import Floats, gland_share
from mammoreg.scenes.scenario import Scenario
from mammoreg.scenes.tissue import FAT_KPA, SceneTissue, scene_tissue

EDGE_MM = 8.0
"""The plates end this far in front of the back's mean place; where a scan's back bends forward they press it too, as in
the pipeline."""
LIP_RADIUS_MM = 8.0
BACK_LAYER_MM = 35.0
"""Tissue between the back and the chest wall, which shears as the back slides; as in the pipeline."""
TOLERANCE_MM, RESTS = 0.01, 24
FACTORS = (3.0, 10.0, 30.0, 100.0)
STIFFEST_PER_MM = 120.0
"""Contact at rest, in shear moduli of fat: the skin lies on fat, whatever the gland within."""


@dataclass(frozen=True)
class Scene:
    """A breast, its tissue and the plates, in the plate frame of a CC view at 0 degrees, which is the breast frame.

    Attributes:
        scenario: what it was made of.
        points: undeformed nodes (N, 3), mm.
        hexes: corners (E, 8), VTK order.
        contact_quads: faces (F, 4) that may touch the plates, the skin's and the back's.
        tissue: constants of the elements.
        back: condition of the back.
        edge_p_mm: where the plates end.
        closing: the solver's side of it.
    """

    scenario: Scenario
    points: Floats
    hexes: NDArray[np.int64]
    contact_quads: NDArray[np.int64]
    tissue: SceneTissue
    back: BackCondition
    edge_p_mm: float
    closing: Closing

    def closed(self) -> Closed:
        """Close the plates to the scenario's compression.

        Raises:
            NotConvergedError: with the reason.
        """
        return self.closing.close((1.0 - self.scenario.compression) * self.closing.uncompressed_mm)


def build_scene(scenario: Scenario, mesh: BlockMesh) -> Scene:
    """The scene of a scenario on a mesh of its shape (breast frame, `scenario.elements` a side)."""
    gland = gland_share(scenario.elements)
    tissue = scene_tissue(scenario.material, scenario.poisson, scenario.contrast, scenario.compression, gland)
    model = HyperelasticModel(mesh.points, mesh.hexes(), tissue.material())
    shear = FAT_KPA / BACK_LAYER_MM
    back = back_condition("shear_layer", mesh.points, mesh.back_quads(), along_kpa_per_mm=shear)
    edge = float(mesh.points[mesh.back_nodes(), 1].mean()) - EDGE_MM
    faces = np.concatenate([mesh.skin_quads(), mesh.back_quads()])
    options = contact_options(model.mean_mu_kpa)
    closing = Closing(model, faces, back, edge, LIP_RADIUS_MM, scenario.friction, options)
    return Scene(scenario, mesh.points, mesh.hexes(), faces, tissue, back, edge, closing)


def contact_options(mean_kpa: float) -> ClosingOptions:
    """The pipeline's settings for a mean shear modulus, but for a stiffer contact and forces that balance closer.

    The pipeline's contact is measured by that mean: around a gland of 1000 kPa it is stiff for the fat that it meets,
    in homogeneous tissue it lets the lips in by millimetres.
    """
    plain = ClosingOptions()
    most = STIFFEST_PER_MM * FAT_KPA / (plain.penalty_per_mm * mean_kpa)
    factors = tuple(f for f in FACTORS if f <= max(most, plain.contact_factors[-1]))
    return replace(plain, tolerance_mm=TOLERANCE_MM, rests=RESTS, contact_factors=factors)

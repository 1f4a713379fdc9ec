"""A scenario as a breast between plates, with the pipeline's own back, plates and numerical settings."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mammoreg.fem.boundary import BackCondition, back_condition
from mammoreg.fem.closing import Closed, Closing, ClosingOptions
from mammoreg.fem.model import HyperelasticModel
from mammoreg.meshing.block import BlockMesh
from mammoreg.scenes.gland import Floats, gland_share
from mammoreg.scenes.scenario import Scenario
from mammoreg.scenes.tissue import FAT_KPA, Tissue, scene_tissue

EDGE_MM = 8.0
"""The plates end this far in front of the back's mean place."""
LIP_RADIUS_MM = 8.0
BACK_LAYER_MM = 35.0
"""Tissue between the back and the chest wall, which shears as the back slides; as in the pipeline."""
OPTIONS = ClosingOptions(rests=24, stiffening=(3.0, 10.0, 30.0, 100.0, 300.0))
"""The pipeline's settings, but for a contact that ends stiffer: laws that stiffen press through the pipeline's by
several millimetres at the lips, whose stiffness is measured by the mean initial shear modulus."""


@dataclass(frozen=True)
class Scene:
    """A breast, its tissue and the plates, in the plate frame of a CC view at 0 degrees, which is the breast frame.

    Attributes:
        scenario: what it was made of.
        points: undeformed nodes (N, 3), mm.
        hexes: corners (E, 8), VTK order.
        skin_quads: faces (F, 4) that may touch the plates.
        tissue: constants of the elements.
        back: condition of the back.
        edge_p_mm: where the plates end.
        closing: the solver's side of it.
    """

    scenario: Scenario
    points: Floats
    hexes: NDArray[np.int64]
    skin_quads: NDArray[np.int64]
    tissue: Tissue
    back: BackCondition
    edge_p_mm: float
    closing: Closing

    def closed(self) -> Closed:
        """Close the plates to the scenario's compression.

        Raises:
            NotConvergedError: with the reason.
        """
        return self.closing.close((1.0 - self.scenario.compression) * self.closing.uncompressed_mm)


def build_scene(scenario: Scenario, mesh: BlockMesh, options: ClosingOptions = OPTIONS) -> Scene:
    """The scene of a scenario on a mesh of its shape (breast frame, `scenario.elements` a side)."""
    gland = gland_share(scenario.elements)
    tissue = scene_tissue(scenario.material, scenario.poisson, scenario.contrast, scenario.compression, gland)
    model = HyperelasticModel(mesh.points, mesh.hexes(), tissue.material())
    shear = FAT_KPA / BACK_LAYER_MM
    back = back_condition("slide_compression", mesh.points, mesh.back_quads(), along_kpa_per_mm=shear)
    edge = float(mesh.points[mesh.back_nodes(), 1].mean()) - EDGE_MM
    closing = Closing(model, mesh.skin_quads(), back, edge, LIP_RADIUS_MM, scenario.friction, options)
    return Scene(scenario, mesh.points, mesh.hexes(), mesh.skin_quads(), tissue, back, edge, closing)

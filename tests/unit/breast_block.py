"""A half-ellipsoid breast as a structured block, for tests of solvers on blocks."""

import numpy as np

from mammoreg.fem.elements.model import HyperelasticModel
from mammoreg.fem.parts.back import BackCondition, held_back
from mammoreg.fem.plates.closing import Closing, ClosingOptions
from mammoreg.materials.elastic import ElasticMaterial, neo_hookean
from mammoreg.meshing.block import BlockMesh

HEIGHT_MM = 110.0
UNDAMPED = ClosingOptions(
    damping=1e-9, rests=1, contact_factors=(), rule="nodes", steps=2, penalty_per_mm=20.0, band_mm=0.1
)


def breast_block(n: int) -> BlockMesh:
    """Half axes 65 (medial), 80 (posterior) and 55 mm (height), by the smooth map of the cube to the ball."""
    across, depth = np.linspace(-1.0, 1.0, n + 1), np.linspace(0.0, 1.0, n + 1)
    s, v, u = np.meshgrid(depth, across, across, indexing="ij")
    x, y, z = (
        a * np.sqrt(1.0 - b**2 / 2 - c**2 / 2 + (b * c) ** 2 / 3) for a, b, c in ((u, s, v), (s, u, v), (v, s, u))
    )
    return BlockMesh(n, np.stack([65.0 * x, -80.0 * y, 55.0 * z], axis=-1).reshape(-1, 3))


def sliding_back(block: BlockMesh) -> BackCondition:
    """Slides in its plane, its middle third fixed."""
    nodes = block.back_nodes()
    held = np.zeros((len(nodes), 3), dtype=bool)
    held[:, 1] = True
    held[np.abs(block.points[nodes] / [65.0, 80.0, 55.0]).max(axis=1) < 0.25] = True
    return held_back(nodes, held)


def breast_closing(
    n: int,
    material: ElasticMaterial | None = None,
    options: ClosingOptions = UNDAMPED,
    friction: float = 0.0,
    edge_p_mm: float | None = None,
) -> Closing:
    """Plates around the breast."""
    block = breast_block(n)
    material = neo_hookean(10.0, 0.49) if material is None else material
    model = HyperelasticModel(block.points, block.hexes(), material)
    return Closing(model, block.skin_quads(), sliding_back(block), edge_p_mm, friction=friction, options=options)

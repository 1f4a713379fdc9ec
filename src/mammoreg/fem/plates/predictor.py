"""Guess of the deformation at the next plate gap: affine, and the volume is kept."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from mammoreg.arrays import Floats, Integers
from mammoreg.contact.plate import Plate
from mammoreg.fem.parts.back import BackCondition

FADE_MM = 25.0
"""Distance over which the squeeze fades out behind the plates' edge, and the spread in front of a held back."""


@dataclass(frozen=True)
class AffinePredictor:
    """Squeezes heights by the ratio of the gaps and spreads the rest by its inverse square root.

    Attributes:
        reach: share (N,) of the spread that a node takes part in: 0 on a held back, 1 far from it.
        body: how many of the nodes are the body's, about whose middle and root the spread is.
    """

    reach: Floats
    body: int

    def predict(self, positions: Floats, height: float, plates: Sequence[Plate], ratio: float) -> Floats:
        """Nodes (N, 3) for plates (lower, upper) whose gap has shrunk by `ratio`, both shifted by `height`."""
        lower, upper = plates
        low, high = lower.height_mm + height, upper.height_mm + height
        imaged = np.ones(len(positions))
        if lower.edge_p_mm is not None:
            # Tissue bulges over the lips: pushing it back under the flat faces would undo the last step.
            flat_end = lower.edge_p_mm - lower.lip_radius_mm
            imaged = np.clip(1.0 - (positions[:, 1] - flat_end) / FADE_MM, 0.0, 1.0)
        squeeze = 1.0 + imaged * (ratio - 1.0)
        spread = 1.0 + self.reach * imaged * (ratio**-0.5 - 1.0)
        centre = positions[: self.body].mean(axis=0)
        root = positions[: self.body, 1].max()
        moved = positions.copy()
        moved[:, 2] = 0.5 * (low + high) + squeeze * (positions[:, 2] - 0.5 * (low + high))
        moved[:, 2] = np.where(imaged >= 1.0, np.clip(moved[:, 2], low, high), moved[:, 2])
        moved[:, 0] = centre[0] + spread * (positions[:, 0] - centre[0])
        moved[:, 1] = root + spread * (positions[:, 1] - root)
        return moved


def affine_predictor(points: Floats, back: BackCondition, body: int) -> AffinePredictor:
    """Predictor of nodes (N, 3), the first `body` of them the body's.

    The spread grows from zero at nodes held across the plates' direction.
    """
    pinned: Integers = back.nodes[back.held[:, :2].all(axis=1)]
    if len(pinned) == 0:
        return AffinePredictor(np.ones(len(points)), body)
    nearest = cKDTree(points[pinned]).query(points)[0]
    return AffinePredictor(np.clip(nearest / FADE_MM, 0.0, 1.0), body)

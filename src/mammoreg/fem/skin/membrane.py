"""Incompressible hyperelastic membrane of bilinear quadrilaterals: skin, without bending stiffness.

Plane stress with the thickness that incompressibility leaves; the energy per undeformed area is h W(I1), W the skin's
isochoric law. In-plane compression makes skin wrinkle instead of carrying load: the tension-field (relaxed) energy
applies, with a small share of the unrelaxed one that keeps a slack membrane from moving at no cost.
"""

import numpy as np
from numpy.typing import NDArray

from mammoreg.arrays import Floats, Integers
from mammoreg.fem.linear.system import node_dofs
from mammoreg.fem.skin.invariants import full_invariant, relaxed_invariant
from mammoreg.materials.isochoric import IsochoricLaw

SKIN_THICKNESS_MM = 1.5
"""Breast skin by dedicated breast CT: 1.44 +- 0.25 mm, range 0.87 to 2.34 mm (doi 10.1118/1.4793257), rounded."""
COMPRESSION_SHARE = 0.01
"""Share of the unrelaxed energy: a wrinkled membrane resists compression with a hundredth of its stiffness."""


class Membrane:
    """A membrane on quadrilaterals, a part of an equilibrium.

    Args:
        points: undeformed nodes (N, 3), mm, those of the body and behind them those of a membrane of its own.
        quads: corners of its faces (F, 4), cyclic.
        law: isochoric law of the skin, kPa.
        thickness_mm: undeformed thickness.
        compression_share: 0: pure tension field; 1: a membrane that resists compression as it does tension.

    Attributes:
        dofs: degrees of freedom (F, 12) of the faces.
        area: undeformed area (F, 4) of each quadrature point, mm2.
    """

    def __init__(
        self,
        points: Floats,
        quads: NDArray[np.integer],
        law: IsochoricLaw,
        thickness_mm: float = SKIN_THICKNESS_MM,
        compression_share: float = COMPRESSION_SHARE,
    ) -> None:
        self.quads: Integers = np.asarray(quads, dtype=np.int64)
        self.law, self.thickness_mm, self.compression_share = law, thickness_mm, compression_share
        self.gradients, self.area = _reference(np.asarray(points, dtype=float)[self.quads])
        self._dofs = node_dofs(self.quads)

    @property
    def dofs(self) -> Integers:
        """Degrees of freedom (F, 12)."""
        return self._dofs

    def terms(self, positions: Floats) -> tuple[Floats, Floats]:
        """Residual (F, 12) in mN and symmetric stiffness (F, 12, 12) in mN/mm at nodes (N, 3)."""
        tangents = self._tangents(positions)
        stress, moduli = self._response(_stretch(tangents))
        weight = self.thickness_mm * self.area
        strain = _strain_matrix(tangents, self.gradients)
        force = np.einsum("fqvk,fqv->fk", strain, stress * weight[..., None])
        product = strain.swapaxes(-1, -2) @ ((moduli * weight[..., None, None]) @ strain)
        stiffness = product.sum(axis=1)
        blocks = stiffness.reshape(-1, 4, 3, 4, 3)
        carried = self.gradients @ _tensor(stress * weight[..., None])
        geometric = (carried @ self.gradients.swapaxes(-1, -2)).sum(axis=1)
        for axis in range(3):
            blocks[:, :, axis, :, axis] += geometric
        return force, stiffness

    def energy_mj(self, positions: Floats) -> float:
        """Strain energy in mJ at nodes (N, 3)."""
        stretch = _stretch(self._tangents(positions))
        fraction = self.compression_share
        density = (1.0 - fraction) * self.law.energy_kpa(relaxed_invariant(stretch).value)
        if fraction > 0.0:
            density = density + fraction * self.law.energy_kpa(full_invariant(stretch).value)
        return float((density * self.area).sum()) * self.thickness_mm * 1e-3

    def renewed(self, _positions: Floats) -> "Membrane":
        """Itself: it remembers nothing."""
        return self

    def _tangents(self, positions: Floats) -> Floats:
        """In-plane deformation gradients (F, 4, 3, 2)."""
        return np.asarray(positions[self.quads].transpose(0, 2, 1)[:, None] @ self.gradients)

    def _response(self, stretch: Floats) -> tuple[Floats, Floats]:
        """Second Piola-Kirchhoff stress (F, 4, 3), kPa, and its derivative by the Green strain (F, 4, 3, 3)."""
        fraction = self.compression_share
        stress, moduli = np.zeros(stretch.shape), np.zeros((*stretch.shape, 3))
        kinds = ((1.0 - fraction, relaxed_invariant), (fraction, full_invariant))
        for part, kind in kinds:
            if part == 0.0:
                continue
            invariant = kind(stretch)
            value = np.maximum(invariant.value, 3.0)
            slope, curvature = self.law.slope_kpa(value), self.law.curvature_kpa(value)
            gradient = invariant.gradient
            stress += (part * slope)[..., None] * gradient
            moduli += (part * curvature)[..., None, None] * (gradient[..., :, None] * gradient[..., None, :])
            moduli += (part * slope)[..., None, None] * invariant.hessian
        return stress, moduli


def _reference(corners: Floats) -> tuple[Floats, Floats]:
    """Gradients (F, 4, 4, 2) of the shape functions in each tangent plane, 1/mm, and areas (F, 4) at 2 x 2 points."""
    sign = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    place = sign / np.sqrt(3.0)
    slopes = np.stack(
        [
            0.25 * sign[:, 0] * (1.0 + place[:, None, 1] * sign[:, 1]),
            0.25 * sign[:, 1] * (1.0 + place[:, None, 0] * sign[:, 0]),
        ],
        axis=-1,
    )
    tangents = np.einsum("fai,qad->fqid", corners, slopes)
    first = tangents[..., 0] / np.linalg.norm(tangents[..., 0], axis=-1, keepdims=True)
    normal = np.cross(tangents[..., 0], tangents[..., 1])
    area = np.linalg.norm(normal, axis=-1)
    second = np.cross(normal / area[..., None], first)
    jacobian = np.einsum("dfqi,fqie->fqde", np.stack([first, second]), tangents)
    return np.asarray(slopes @ np.linalg.inv(jacobian)), area


def _stretch(tangents: Floats) -> Floats:
    """In-plane right Cauchy-Green tensor (..., 3): C11, C22, C12."""
    one, two = tangents[..., 0], tangents[..., 1]
    return np.stack([(one * one).sum(axis=-1), (two * two).sum(axis=-1), (one * two).sum(axis=-1)], axis=-1)


def _tensor(stress: Floats) -> Floats:
    """(..., 3) to (..., 2, 2)."""
    return np.asarray(stress[..., [[0, 2], [2, 1]]])


def _strain_matrix(tangents: Floats, gradients: Floats) -> Floats:
    """Derivative of the Green strain (F, 4, 3, 12) by the corners' displacements."""
    one, two = tangents[..., None, :, 0], tangents[..., None, :, 1]
    along, across = gradients[..., 0, None], gradients[..., 1, None]
    rows = np.stack([along * one, across * two, along * two + across * one], axis=2)
    return np.asarray(rows.reshape(*rows.shape[:3], 12))

"""Nearly incompressible hyperelastic body: displacement-pressure hexahedra (u-p0), residual and tangent.

Perturbed Lagrangian with the isochoric split and a pressure constant per element that stays an unknown of the Newton
iteration (design note on the solver, recipe 1):

    Pi(u, p) = integral of  W(F / J^(1/3)) + p (J - 1) - p^2 / (2 K)
    W = W1(I1bar) + W4(I4bar)

W1 is the isochoric law, neo-Hookean or any other; W4 the reinforcement, active in tension along the fibre only.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mammoreg.fem.hexahedra import Array, Integers, hexahedra
from mammoreg.materials.elastic import ElasticMaterial

VOIGT = ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 0))
_UNIT = np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])
_IDENTITY = np.diag([1.0, 1.0, 1.0, 0.5, 0.5, 0.5])
_DEVIATOR = _IDENTITY - np.outer(_UNIT, _UNIT) / 3.0
_VOLUMETRIC = np.outer(_UNIT, _UNIT) - 2.0 * _IDENTITY


@dataclass(frozen=True)
class ElementState:
    """Kinematics and stress of all elements at one deformation.

    Attributes:
        gradients: spatial gradients of the shape functions (E, Q, 8, 3), 1/mm.
        det: det F (E, Q).
        fictitious: Kirchhoff stress before its deviator is taken, isotropic part, trace (E, Q), kPa.
        deviator: deviatoric Kirchhoff stress, Voigt (E, Q, 6), kPa.
        bends: further terms of the isochoric tangent, c d x d: c (E, Q) in kPa and deviators d, Voigt (E, Q, 6). The
            law's own, 4 W1'' and dev(bbar), where it has a curvature; the fibre's, 4 W4'' and its structure tensor's.
    """

    gradients: Array
    det: Array
    fictitious: Array
    deviator: Array
    bends: tuple[tuple[Array, Array], ...]


@dataclass(frozen=True)
class Residual:
    """Internal forces of the elements: `force` (E, 24) in mN, `volume` the residual of the pressures (E,) in mm3."""

    force: Array
    volume: Array
    coupling: Array


class HyperelasticModel:
    """A body of u-p0 hexahedra.

    Args:
        points: undeformed nodes (N, 3), mm.
        hexes: corners (E, 8) in VTK order with positive Jacobians.
        material: constants of each element.

    Forces inside the package are kPa mm2 = mN.
    """

    def __init__(self, points: Array, hexes: NDArray[np.integer], material: ElasticMaterial) -> None:
        self.points = np.array(points, dtype=float)
        self.hexes: Integers = np.array(hexes, dtype=np.int64)
        self.material = material.of_elements(len(self.hexes))
        mesh = hexahedra(self.points, self.hexes)
        self.gradients, self.weights, self.volume = mesh.gradients, mesh.weights, mesh.volume
        self.dofs = (3 * self.hexes[:, :, None] + np.arange(3)).reshape(len(self.hexes), 24)

    @property
    def bulk_per_volume(self) -> Array:
        """K / V (E,), the stiffness of each element's pressure equation."""
        return np.asarray(self.material.bulk_kpa / self.volume)

    def deformation_gradients(self, positions: Array) -> Array:
        """F (E, Q, 3, 3) of deformed nodes (N, 3) in mm."""
        corners = positions[self.hexes].transpose(0, 2, 1)[:, None]
        return np.asarray(corners @ self.gradients)

    def determinants(self, positions: Array) -> Array:
        """Determinants of F (E, Q) at deformed nodes (N, 3) in mm."""
        return _cofactors(self.deformation_gradients(positions))[1]

    def state(self, positions: Array) -> ElementState:
        """Kinematics and deviatoric stress at deformed nodes (N, 3) in mm; needs det F > 0."""
        gradient = self.deformation_gradients(positions)
        cofactors, det = _cofactors(gradient)
        inverse = cofactors.swapaxes(-1, -2) / det[..., None, None]
        scale = det ** (-2.0 / 3.0)
        left = gradient @ gradient.transpose(0, 1, 3, 2)
        stress, bends = self._law_stress(_voigt(left), scale)
        fibres = self.material.fibres
        if fibres is not None:
            structure = _voigt_dyad(gradient @ fibres.direction[:, None, :, None]) * scale[..., None]
            stretch = structure[..., :3].sum(axis=-1)
            stress = stress + (2.0 * fibres.slope_kpa(stretch))[..., None] * structure
            bends = (*bends, (4.0 * fibres.curvature_kpa(stretch), _deviator(structure)))
        return ElementState(self.gradients @ inverse, det, stress[..., :3].sum(axis=-1), _deviator(stress), bends)

    def _law_stress(self, left: Array, scale: Array) -> tuple[Array, tuple[tuple[Array, Array], ...]]:
        """Stress 2 W1' bbar, Voigt (E, Q, 6), and the law's term of curvature, if it has one."""
        law = self.material.law
        if law is None:
            return (self.material.mu_kpa[:, None] * scale)[..., None] * left, ()
        isochoric = scale[..., None] * left
        i1 = isochoric[..., :3].sum(axis=-1)
        bend = (4.0 * law.curvature_kpa(i1), _deviator(isochoric))
        return (2.0 * law.slope_kpa(i1))[..., None] * isochoric, (bend,)

    def residual(self, state: ElementState, pressure: Array) -> Residual:
        """Internal forces at element pressures (E,) in kPa (positive in tension)."""
        stress = state.deviator + (pressure[:, None] * state.det)[..., None] * _UNIT
        force = (state.gradients @ (_tensor(stress) * self.weights[..., None, None])).sum(axis=1)
        coupling = ((self.weights * state.det)[:, :, None, None] * state.gradients).sum(axis=1)
        volume = (self.weights * (state.det - 1.0)).sum(axis=1) - pressure / self.bulk_per_volume
        elements = len(self.hexes)
        return Residual(force.reshape(elements, 24), volume, coupling.reshape(elements, 24))

    def stiffness(self, state: ElementState, pressure: Array, coupling: Array) -> Array:
        """Tangent (E, 24, 24) in mN/mm with the pressures eliminated element by element."""
        elements, quadrature = state.det.shape
        strain = _strain_matrix(state.gradients)
        moduli = self._moduli(state, pressure)
        product = (moduli @ strain).reshape(elements, 6 * quadrature, 24)
        tangent = strain.reshape(elements, 6 * quadrature, 24).transpose(0, 2, 1) @ product
        stress = state.deviator + (pressure[:, None] * state.det)[..., None] * _UNIT
        weighted = state.gradients @ (_tensor(stress) * self.weights[..., None, None])
        geometric = _stacked(weighted) @ _stacked(state.gradients).transpose(0, 2, 1)
        blocks = tangent.reshape(elements, 8, 3, 8, 3)
        for axis in range(3):
            blocks[:, :, axis, :, axis] += geometric
        tangent += (self.bulk_per_volume[:, None] * coupling)[:, :, None] * coupling[:, None, :]
        return tangent

    def _moduli(self, state: ElementState, pressure: Array) -> Array:
        """Spatial elasticity times weight (E, Q, 6, 6): isochoric, volumetric and fibre parts."""
        cross = state.deviator[..., :, None] * _UNIT
        moduli = (2.0 / 3.0 * state.fictitious)[..., None, None] * _DEVIATOR
        moduli -= 2.0 / 3.0 * (cross + cross.swapaxes(-1, -2))
        moduli += (pressure[:, None] * state.det)[..., None, None] * _VOLUMETRIC
        for stiffness, deviator in state.bends:
            moduli += (stiffness[..., None] * deviator)[..., :, None] * deviator[..., None, :]
        return np.asarray(moduli * self.weights[..., None, None])

    def energy_mj(self, positions: Array) -> float:
        """Isochoric strain energy in mJ (N mm)."""
        gradient = self.deformation_gradients(positions)
        scale = np.linalg.det(gradient) ** (-2.0 / 3.0)
        size = (gradient**2).sum(axis=(-1, -2)) * scale
        law, fibres = self.material.law, self.material.fibres
        density = 0.5 * self.material.mu_kpa[:, None] * (size - 3.0) if law is None else law.energy_kpa(size)
        if fibres is not None:
            along = (gradient @ fibres.direction[:, None, :, None])[..., 0]
            density += fibres.energy_kpa((along**2).sum(axis=-1) * scale)
        return float((self.weights * density).sum()) * 1e-3

    def volumetric_energy_mj(self, pressure: Array) -> float:
        """Energy in mJ that element pressures (E,) in kPa store in the change of volume: V p^2 / (2 K)."""
        return float((pressure**2 / (2.0 * self.bulk_per_volume)).sum()) * 1e-3

    def volume_change(self, positions: Array) -> float:
        """Relative change of the body's volume at deformed nodes (N, 3)."""
        return float((self.weights * self.determinants(positions)).sum() / self.weights.sum() - 1.0)


def _cofactors(matrix: Array) -> tuple[Array, Array]:
    """Cofactors and determinants of matrices (..., 3, 3), in closed form: much faster than LAPACK on small blocks."""
    rows = [[matrix[..., i, j] for j in range(3)] for i in range(3)]
    cofactors = np.empty_like(matrix)
    for i in range(3):
        above, below = rows[(i + 1) % 3], rows[(i + 2) % 3]
        for j in range(3):
            k, m = (j + 1) % 3, (j + 2) % 3
            cofactors[..., i, j] = above[k] * below[m] - above[m] * below[k]
    return cofactors, sum((rows[0][j] * cofactors[..., 0, j] for j in range(3)), np.zeros(matrix.shape[:-2]))


def _voigt(tensor: Array) -> Array:
    return np.stack([tensor[..., i, j] for i, j in VOIGT], axis=-1)


def _voigt_dyad(column: Array) -> Array:
    """Voigt form of a dyad a a^T of columns (..., 3, 1)."""
    return np.stack([column[..., i, 0] * column[..., j, 0] for i, j in VOIGT], axis=-1)


def _deviator(stress: Array) -> Array:
    return np.asarray(stress - (stress[..., :3].sum(axis=-1, keepdims=True) / 3.0) * _UNIT)


def _tensor(stress: Array) -> Array:
    full = np.empty((*stress.shape[:-1], 3, 3))
    for k, (i, j) in enumerate(VOIGT):
        full[..., i, j] = stress[..., k]
        full[..., j, i] = stress[..., k]
    return full


def _stacked(gradients: Array) -> Array:
    """(E, Q, 8, 3) to (E, 8, Q * 3), so that one product sums over quadrature points."""
    elements, quadrature = gradients.shape[:2]
    return gradients.transpose(0, 2, 1, 3).reshape(elements, 8, 3 * quadrature)


def _strain_matrix(gradients: Array) -> Array:
    """Strain-displacement matrix (E, Q, 6, 24), engineering shear strains."""
    strain = np.zeros((*gradients.shape[:2], 6, 8, 3))
    for k, (i, j) in enumerate(VOIGT):
        strain[:, :, k, :, i] = gradients[..., j]
        strain[:, :, k, :, j] = gradients[..., i]
    return strain.reshape(*gradients.shape[:2], 6, 24)

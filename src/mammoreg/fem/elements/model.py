"""Nearly incompressible hyperelastic body: displacement-pressure hexahedra (u-p0), residual and tangent.

Perturbed Lagrangian with the isochoric split and a pressure constant per element, which stays an unknown of the Newton
iteration; substituted away before linearising (mean dilatation), it cost 5 to 10 times the iterations at nu 0.499:

    Pi(u, p) = integral of  W1(I1bar) + W4(I4bar) + p (J - 1) - p^2 / (2 K)

W1 is the isochoric law, neo-Hookean or any other; W4 the reinforcement, active in tension along the fibre only.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mammoreg.arrays import Floats, Integers
from mammoreg.fem.elements.batches import ElementRun, determinants, element_runs
from mammoreg.fem.elements.hexahedra import hexahedra
from mammoreg.fem.elements.state import RunState, run_energy, run_forces, run_state
from mammoreg.fem.elements.tangent import TangentWork, run_tangent
from mammoreg.materials.elastic import ElasticMaterial


@dataclass(frozen=True)
class ElementState:
    """Kinematics and stress of all elements at one deformation.

    Attributes:
        runs: states of the model's runs of elements.
        elements: these runs.
    """

    runs: tuple[RunState, ...]
    elements: tuple[ElementRun, ...]

    @property
    def det(self) -> Floats:
        """Determinants of F (E, Q)."""
        return np.concatenate([run.det for run in self.runs])

    @property
    def gradients(self) -> Floats:
        """Spatial gradients of the shape functions (E, Q, 8, 3), 1/mm."""
        pairs = zip(self.elements, self.runs, strict=True)
        return np.concatenate([run.gradients.transpose(0, 2, 1, 3) @ state.inverse for run, state in pairs])

    @property
    def deviator(self) -> Floats:
        """Deviatoric Kirchhoff stress (E, Q, 6), kPa: 11, 22, 33, 12, 23, 31."""
        stress = np.concatenate([np.linalg.inv(run.inverse) @ run.stress for run in self.runs])
        stress -= np.trace(stress, axis1=-2, axis2=-1)[..., None, None] / 3.0 * np.eye(3)
        return np.asarray(stress[..., [0, 1, 2, 0, 1, 2], [0, 1, 2, 1, 2, 0]])


@dataclass(frozen=True)
class Residual:
    """Internal forces of the elements.

    Attributes:
        force: (E, 24), mN.
        volume: residual of the pressures (E,), mm3.
        coupling: derivative of the volumes (E, 24), mm2.
    """

    force: Floats
    volume: Floats
    coupling: Floats


class HyperelasticModel:
    """A body of u-p0 hexahedra.

    Args:
        points: undeformed nodes (N, 3), mm.
        hexes: corners (E, 8) in VTK order with positive Jacobians.
        material: constants of each element.

    Forces inside the package are kPa mm2 = mN.
    """

    def __init__(self, points: Floats, hexes: NDArray[np.integer], material: ElasticMaterial) -> None:
        self.points = np.array(points, dtype=float)
        self.hexes: Integers = np.array(hexes, dtype=np.int64)
        self.material = material.of_elements(len(self.hexes))
        mesh = hexahedra(self.points, self.hexes)
        self.weights, self.volume = mesh.weights, mesh.volume
        gradients = np.ascontiguousarray(mesh.gradients.transpose(0, 2, 1, 3))
        self._runs = tuple(element_runs(self.hexes, gradients, self.weights, self.material))
        self.dofs = (3 * self.hexes[:, :, None] + np.arange(3)).reshape(len(self.hexes), 24)

    @property
    def bulk_per_volume(self) -> Floats:
        """K / V (E,), the stiffness of each element's pressure equation."""
        return np.asarray(self.material.bulk_kpa / self.volume)

    @property
    def mean_mu_kpa(self) -> float:
        """Initial shear modulus, the mean over the volume."""
        return float(np.average(self.material.mu_kpa, weights=self.volume))

    def determinants(self, positions: Floats) -> Floats:
        """Determinants of F (E, Q) at deformed nodes (N, 3) in mm."""
        return np.concatenate([determinants(run.deformation_gradients(positions)) for run in self._runs])

    def state(self, positions: Floats) -> ElementState:
        """Kinematics and deviatoric stress at deformed nodes (N, 3) in mm; needs det F > 0."""
        return ElementState(tuple(run_state(run, positions) for run in self._runs), self._runs)

    def residual(self, state: ElementState, pressure: Floats) -> Residual:
        """Internal forces at element pressures (E,) in kPa (positive in tension)."""
        force, coupling = np.empty((len(self.hexes), 24)), np.empty((len(self.hexes), 24))
        volume = -pressure / self.bulk_per_volume
        for run, part in zip(self._runs, state.runs, strict=True):
            force[run.elements], coupling[run.elements] = run_forces(run, part, pressure[run.elements])
            volume[run.elements] += (run.weights * (part.det - 1.0)).sum(axis=1)
        return Residual(force, volume, coupling)

    def stiffness(self, state: ElementState, pressure: Floats, coupling: Floats) -> Floats:
        """Tangent (E, 24, 24) in mN/mm with the pressures eliminated element by element."""
        tangent = np.empty((len(self.hexes), 24, 24))
        work = TangentWork(self.weights.shape[1], len(state.runs[0].bends))
        rate = self.bulk_per_volume
        for run, part in zip(self._runs, state.runs, strict=True):
            at = run.elements
            run_tangent(run, part, pressure[at], rate[at], coupling[at], work, tangent[at])
        return tangent

    def energy_mj(self, positions: Floats) -> float:
        """Isochoric strain energy in mJ (N mm)."""
        return sum(run_energy(run, positions) for run in self._runs) * 1e-3

    def volumetric_energy_mj(self, pressure: Floats) -> float:
        """Energy in mJ that element pressures (E,) in kPa store in the change of volume: V p^2 / (2 K)."""
        return float((pressure**2 / (2.0 * self.bulk_per_volume)).sum()) * 1e-3

    def volume_change(self, positions: Floats) -> float:
        """Relative change of the body's volume at deformed nodes (N, 3)."""
        return float((self.weights * self.determinants(positions)).sum() / self.weights.sum() - 1.0)

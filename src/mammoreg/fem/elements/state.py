"""Kinematics and isochoric stress of a run of hexahedra at one deformation.

With the isochoric scale s = J^(-2/3), bbar = s b and the fibre abar = sqrt(s) F a, the fictitious Kirchhoff stress is

    tau = 2 W1' bbar + 2 W4' abar x abar,

and its deviator the stress. Tensors are kept as F^-1 tau: a product with the undeformed gradients of the shape
functions then gives tau times the spatial ones.
"""

from dataclasses import dataclass

import numpy as np

from mammoreg.arrays import Floats
from mammoreg.fem.elements.batches import ElementRun, by_point, cofactors, determinants


@dataclass(frozen=True)
class Bend:
    """A term c d x d of the isochoric tangent, from the curvature of an energy.

    Attributes:
        stiffness: c = 4 W'' (C, Q), kPa.
        tensor: F^-1 d (C, Q, 3, 3), d = dev(bbar) or dev(abar x abar).
    """

    stiffness: Floats
    tensor: Floats


@dataclass(frozen=True)
class RunState:
    """What residual and tangent need, at the quadrature points of a run of C elements.

    Attributes:
        det: det F (C, Q).
        inverse: F^-1 (C, Q, 3 undeformed, 3 deformed).
        stress: F^-1 tau (C, Q, 3, 3), kPa.
        trace: of tau (C, Q), kPa.
        shear: 2 W1' s (C, Q), kPa.
        fibre: 2 W4' s (C, Q), kPa; None without fibres.
        bends: of laws with curvature and of fibres.
    """

    det: Floats
    inverse: Floats
    stress: Floats
    trace: Floats
    shear: Floats
    fibre: Floats | None
    bends: tuple[Bend, ...]


def run_state(run: ElementRun, positions: Floats) -> RunState:
    """State of a run at deformed nodes (N, 3) in mm; needs det F > 0."""
    gradient = run.deformation_gradients(positions)
    cofactor, det = cofactors(gradient)
    inverse = by_point((cofactor / det).swapaxes(0, 1))
    transposed = by_point(gradient.swapaxes(0, 1))
    scale = det ** (-2.0 / 3.0)
    size = (gradient**2).sum(axis=(0, 1))
    shear, bends = _law(run, scale, size, transposed, inverse)
    stress, trace, fibre = shear[..., None, None] * transposed, shear * size, None
    if run.material.fibres is not None:
        along = transposed.swapaxes(-1, -2) @ run.material.fibres.direction[:, None, :, None]
        stretch = scale * (along[..., 0] ** 2).sum(axis=-1)
        fibre = 2.0 * run.material.fibres.slope_kpa(stretch) * scale
        dyad = run.material.fibres.direction[:, None, :, None] * along.swapaxes(-1, -2)
        stress += fibre[..., None, None] * dyad
        trace = trace + fibre * stretch / scale
        tensor = scale[..., None, None] * dyad - (stretch / 3.0)[..., None, None] * inverse
        bends = (*bends, Bend(4.0 * run.material.fibres.curvature_kpa(stretch), tensor))
    return RunState(det, inverse, stress, trace, shear, fibre, bends)


def _law(
    run: ElementRun, scale: Floats, size: Floats, transposed: Floats, inverse: Floats
) -> tuple[Floats, tuple[Bend, ...]]:
    """2 W1' s (C, Q), and the law's term of the tangent if it has a curvature."""
    law = run.material.law
    if law is None:
        return run.material.mu_kpa[:, None] * scale, ()
    i1 = scale * size
    tensor = scale[..., None, None] * transposed - (i1 / 3.0)[..., None, None] * inverse
    return 2.0 * law.slope_kpa(i1) * scale, (Bend(4.0 * law.curvature_kpa(i1), tensor),)


def run_forces(run: ElementRun, state: RunState, pressure: Floats) -> tuple[Floats, Floats]:
    """Internal forces (C, 24) in mN at pressures (C,) in kPa, and the derivative (C, 24) of the volumes in mm2."""
    count, corners, quadrature = run.gradients.shape[:3]
    flat = run.gradients.reshape(count, corners, 3 * quadrature)
    tensors = np.empty((count, quadrature, 3, 6))
    isotropic = pressure[:, None] * state.det - state.trace / 3.0
    tensors[..., :3] = run.weights[..., None, None] * (state.stress + isotropic[..., None, None] * state.inverse)
    tensors[..., 3:] = (run.weights * state.det)[..., None, None] * state.inverse
    both = flat @ tensors.reshape(count, 3 * quadrature, 6)
    return both[..., :3].reshape(count, 24), both[..., 3:].reshape(count, 24)


def run_energy(run: ElementRun, positions: Floats) -> float:
    """Isochoric energy in uJ (mN mm) of a run at deformed nodes (N, 3) in mm."""
    gradient = run.deformation_gradients(positions)
    scale = determinants(gradient) ** (-2.0 / 3.0)
    i1 = (gradient**2).sum(axis=(0, 1)) * scale
    law, fibres = run.material.law, run.material.fibres
    density = 0.5 * run.material.mu_kpa[:, None] * (i1 - 3.0) if law is None else law.energy_kpa(i1)
    if fibres is not None:
        along = (gradient.transpose(2, 3, 0, 1) @ fibres.direction[:, None, :, None])[..., 0]
        density = density + fibres.energy_kpa((along**2).sum(axis=-1) * scale)
    return float((run.weights * density).sum())

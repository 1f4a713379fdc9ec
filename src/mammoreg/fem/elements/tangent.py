"""Tangent stiffness of a run of hexahedra, pressures eliminated element by element.

With the spatial gradients g of the shape functions, the stress tau before its deviator is taken, its trace t, its
deviator tau', the pressure p and the quadrature weight w, a pair of nodes (a, b) has

    K_ij = sum of w [ (p J - 2t/9) g_ai g_bj - 2/3 (tau' g_a)_i g_bj - 2/3 g_ai (tau' g_b)_j
                      + t/3 delta_ij g_a.g_b + (t/3 - p J) g_aj g_bi            isochoric and volumetric moduli
                      + delta_ij g_a.(tau' g_b) + sum of c (d g_a)_i (d g_b)_j ]  stress itself; curvatures
           + K/V c_ai c_bj                                                        pressure, c the volume's derivative

where the two terms of delta_ij unite to g_a.(tau g_b). The first three are A G' + G A', hence one product of dense
matrices over all quadrature points and its transpose; g_aj g_bi is another one, G G', with i and j exchanged.
"""

import numpy as np

from mammoreg.arrays import Floats
from mammoreg.fem.elements.batches import RUN, ElementRun
from mammoreg.fem.elements.state import RunState


class TangentWork:
    """Arrays that the tangents of all runs share; `bends` is the number of curvatures."""

    def __init__(self, quadrature: int, bends: int) -> None:
        rows = (1 + bends) * quadrature + 1
        self.left, self.right = np.empty((RUN, rows, 24)), np.empty((RUN, rows, 24))
        self.scaled = np.empty((RUN, quadrature, 24))
        self.product, self.swapped = np.empty((RUN, 24, 24)), np.empty((RUN, 24, 24))


def run_tangent(
    run: ElementRun,
    state: RunState,
    pressure: Floats,
    rate: Floats,
    coupling: Floats,
    work: TangentWork,
    tangent: Floats,
) -> None:
    """Write the tangents (C, 24, 24) in mN/mm.

    Args:
        run, state: elements and their state.
        pressure: (C,), kPa.
        rate: K / V (C,).
        coupling: derivative of the volumes (C, 24), mm2.
        work: scratch.
        tangent: where they go.
    """
    count, _, quadrature = run.gradients.shape[:3]
    by_point = run.gradients.transpose(0, 2, 1, 3)
    left, right, weights = work.left[:count], work.right[:count], run.weights
    spatial = right[:, :quadrature]
    np.matmul(by_point, state.inverse, out=_vectors(spatial))
    volumetric = pressure[:, None] * state.det
    isotropic = weights * (state.trace / 9.0 + 0.5 * volumetric)
    mixed = isotropic[..., None, None] * state.inverse - (2.0 / 3.0 * weights)[..., None, None] * state.stress
    np.matmul(by_point, mixed, out=_vectors(left[:, :quadrature]))
    _bends(run, state, by_point, left[:, quadrature:-1], right[:, quadrature:-1])
    right[:, -1] = coupling
    np.multiply(0.5 * rate[:, None], coupling, out=left[:, -1])
    product, swapped = work.product[:count], work.swapped[:count]
    np.matmul(left.transpose(0, 2, 1), right, out=product)
    np.add(product, product.transpose(0, 2, 1), out=tangent)
    scaled = work.scaled[:count]
    np.multiply(spatial, (weights * (state.trace / 3.0 - volumetric))[..., None], out=scaled)
    np.matmul(scaled.transpose(0, 2, 1), spatial, out=swapped)
    blocks = tangent.reshape(count, 8, 3, 8, 3)
    blocks += swapped.reshape(count, 8, 3, 8, 3).transpose(0, 1, 4, 3, 2)
    geometric = _geometric(run, state)
    for axis in range(3):
        blocks[:, :, axis, :, axis] += geometric


def _bends(run: ElementRun, state: RunState, by_point: Floats, left: Floats, right: Floats) -> None:
    """Rows of the curvatures, half their stiffness at the left."""
    quadrature = run.weights.shape[1]
    for number, bend in enumerate(state.bends):
        rows = slice(number * quadrature, (number + 1) * quadrature)
        np.matmul(by_point, bend.tensor, out=_vectors(right[:, rows]))
        np.multiply(right[:, rows], (0.5 * run.weights * bend.stiffness)[..., None], out=left[:, rows])


def _geometric(run: ElementRun, state: RunState) -> Floats:
    """Sum of w g_a.(tau g_b) (C, 8, 8), by the undeformed gradients."""
    count, corners, quadrature = run.gradients.shape[:3]
    loaded = run.gradients * (run.weights * state.shear)[:, None, :, None]
    if state.fibre is not None and run.material.fibres is not None:
        direction = run.material.fibres.direction
        along = (run.gradients.reshape(count, -1, 3) @ direction[:, :, None]).reshape(count, corners, quadrature)
        loaded += ((run.weights * state.fibre)[:, None] * along)[..., None] * direction[:, None, None]
    flat = run.gradients.reshape(count, corners, 3 * quadrature)
    return np.asarray(loaded.reshape(flat.shape) @ flat.transpose(0, 2, 1))


def _vectors(rows: Floats) -> Floats:
    """Rows (C, Q, 24) as vectors of nodes (C, Q, 8, 3)."""
    return rows.reshape(*rows.shape[:2], 8, 3)

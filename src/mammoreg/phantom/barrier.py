"""A barrier against collapse at single points of the elements, whose pressure sees only their mean volume.

    W = kappa (J - 1 - ln J)

at every Gauss point: its Kirchhoff stress is kappa (J - 1) times the identity, and its energy grows without bound as a
corner of an element turns inside out.
"""

import numpy as np

from mammoreg.fem.elements.model import ElementState
from mammoreg.phantom.shape import Array


def barrier_force(state: ElementState, weights: Array, kappa: Array) -> Array:
    """Forces (E, 24) in mN of a barrier kappa (E,) in kPa, integrated with weights (E, Q) in mm3."""
    amount = weights * kappa[:, None] * (state.det - 1.0)
    return np.asarray((amount[:, :, None, None] * state.gradients).sum(axis=1).reshape(len(weights), 24))


def barrier_stiffness(state: ElementState, weights: Array, kappa: Array) -> Array:
    """Derivative (E, 24, 24) in mN/mm of `barrier_force`."""
    rate = weights * kappa[:, None]
    straight = _products(state.gradients, rate * state.det)
    crossed = _products(state.gradients, rate * (state.det - 1.0)).reshape(-1, 8, 3, 8, 3)
    return np.asarray(straight - crossed.transpose(0, 1, 4, 3, 2).reshape(-1, 24, 24))


def _products(gradients: Array, amount: Array) -> Array:
    """Sums over the Gauss points of dyads of gradients (E, Q, 8, 3) times an amount (E, Q): (E, 24, 24)."""
    flat = gradients.reshape(*amount.shape, 24)
    return np.asarray((flat * amount[..., None]).transpose(0, 2, 1) @ flat)

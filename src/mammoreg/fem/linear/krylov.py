"""Flexible GMRES for preconditioned systems that need not be symmetric."""

from collections.abc import Callable

import numpy as np

from mammoreg.arrays import Floats
from mammoreg.errors import NotConvergedError

Operator = Callable[[Floats], Floats]

RESTART = 80


def fgmres(
    operator: Operator, preconditioner: Operator, rhs: Floats, tolerance: float, most: int, restart: int = RESTART
) -> tuple[Floats, int]:
    """Solve a linear system; preconditioned from the right, so that the residual is the true one.

    Args:
        operator, preconditioner: the matrix and an approximate inverse, as products with vectors (n,).
        rhs: right-hand side (n,).
        tolerance: on the residual's norm as a share of that of the right-hand side.
        most: iterations at most.
        restart: iterations after which the basis is dropped.

    Returns:
        the solution and the number of iterations.

    Raises:
        NotConvergedError: the tolerance is not reached, or values are not finite.
    """
    size = float(np.linalg.norm(rhs))
    solution, residual, done = np.zeros_like(rhs), rhs, 0
    if size == 0.0:
        return solution, 0
    while done < most:
        change, steps, left = _cycle(operator, preconditioner, residual, tolerance * size, min(restart, most - done))
        solution, done = solution + change, done + steps
        if not np.isfinite(left):
            raise NotConvergedError("the iteration of the linear system holds values that are not finite")
        if left <= tolerance * size:
            return solution, done
        residual = rhs - operator(solution)
    raise NotConvergedError(f"GMRES came to {left / size:.1e} of its first residual in {done} iterations")


def _cycle(
    operator: Operator, preconditioner: Operator, residual: Floats, goal: float, most: int
) -> tuple[Floats, int, float]:
    """Iterations until a restart: change of the solution, their number and the residual's norm."""
    first = float(np.linalg.norm(residual))
    basis, corrections = [residual / first], []
    triangle, turned = np.zeros((most, most)), np.zeros(most + 1)
    turned[0] = first
    rotations: list[tuple[float, float]] = []
    for step in range(most):
        corrections.append(preconditioner(basis[-1]))
        product = operator(corrections[-1])
        column = _orthogonalised(product, basis)
        below = float(np.linalg.norm(product))
        for row, (cosine, sine) in enumerate(rotations):
            column[row : row + 2] = (
                cosine * column[row] + sine * column[row + 1],
                cosine * column[row + 1] - sine * column[row],
            )
        length = float(np.hypot(column[step], below))
        if not (np.isfinite(length) and length > 0.0):
            return np.zeros_like(residual), step + 1, np.nan
        cosine, sine = column[step] / length, below / length
        rotations.append((cosine, sine))
        triangle[: step + 1, step] = column[: step + 1]
        triangle[step, step] = length
        turned[step], turned[step + 1] = cosine * turned[step], -sine * turned[step]
        if abs(turned[step + 1]) <= goal or below == 0.0:
            break
        basis.append(product / below)
    count = len(corrections)
    weights = np.linalg.solve(triangle[:count, :count], turned[:count])
    change = np.zeros_like(residual)
    for weight, correction in zip(weights, corrections, strict=True):
        change += weight * correction
    return change, count, abs(float(turned[count]))


def _orthogonalised(product: Floats, basis: list[Floats]) -> Floats:
    """Make a vector orthogonal to a basis, in place; its components, and room for one more."""
    column = np.zeros(len(basis) + 1)
    for row, direction in enumerate(basis):
        column[row] = direction @ product
        product -= column[row] * direction
    return column

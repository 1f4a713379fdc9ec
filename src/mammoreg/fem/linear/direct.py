"""Sparse direct solver with a pattern that is analysed once: MKL PARDISO, or SuperLU where MKL is missing."""

import ctypes
import functools
import weakref
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.linalg import splu

from mammoreg.arrays import Floats
from mammoreg.errors import NotConvergedError

Indices = NDArray[np.int32]

_UNSYMMETRIC, _SYMMETRIC_INDEFINITE = 11, -2
_ANALYSE, _FACTORISE, _SOLVE, _RELEASE = 11, 22, 33, -1


@functools.cache
def mkl() -> Any:
    """The MKL library that PyPardiso found, or None; looked for when first needed, for it takes a second."""
    try:
        import pypardiso
    except ImportError:  # the wrapper, or the MKL library that it looks for, is not installed
        return None
    return pypardiso.ps.libmkl


class PardisoSolver:
    """PARDISO for one sparsity pattern (CSR, zero-based; the upper triangle if symmetric).

    Attributes:
        factorisations: so far.
    """

    def __init__(self, indptr: Indices, indices: Indices, symmetric: bool) -> None:
        self._indptr, self._indices = np.ascontiguousarray(indptr), np.ascontiguousarray(indices)
        self._size = len(indptr) - 1
        self._type = _SYMMETRIC_INDEFINITE if symmetric else _UNSYMMETRIC
        self._handle = np.zeros(64, dtype=np.int64)
        self._iparm = np.zeros(64, dtype=np.int32)
        self._iparm[0] = 1  # no defaults
        self._iparm[1] = 2  # nested dissection
        self._iparm[7] = 2  # refinement steps at most
        self._iparm[9] = 8 if symmetric else 13  # pivots perturbed by 10^-this
        self._iparm[10] = self._iparm[12] = 0 if symmetric else 1  # scaling and matching
        self._iparm[20] = 1  # Bunch-Kaufman pivots
        self._iparm[34] = 1  # zero-based
        self._analysed, self.factorisations = False, 0
        weakref.finalize(self, _release, self._handle, self._type, self._size, self._iparm.copy())

    def solve(self, values: Floats, rhs: Floats) -> Floats:
        """Factorise the matrix with these entries and solve for one right-hand side."""
        _refuse_infinite(values, rhs)
        self.factorise(values)
        return self._call(_SOLVE, self._values, rhs)

    def factorise(self, values: Floats) -> None:
        """Factorise the matrix with these entries; the first time the pattern is analysed too."""
        _refuse_infinite(values)
        self._values, nothing = values, np.zeros(self._size)
        if not self._analysed:
            self._call(_ANALYSE, values, nothing)
            self._analysed = True
        self._call(_FACTORISE, values, nothing)
        self.factorisations += 1

    def back_substitute(self, rhs: Floats) -> Floats:
        """Solve for one more right-hand side with the factors at hand."""
        _refuse_infinite(rhs)
        return self._call(_SOLVE, self._values, rhs)

    def _call(self, phase: int, values: Floats, rhs: Floats) -> Floats:
        # MKL gets bare addresses: a strided view would be read as if it were not one.
        values, rhs = (np.ascontiguousarray(array, dtype=float) for array in (values, rhs))
        solution = np.zeros(self._size)
        error = _pardiso(
            self._handle, self._type, phase, self._size, values, self._indptr, self._indices, self._iparm, rhs, solution
        )
        if error != 0:
            raise NotConvergedError(f"the linear solver failed (PARDISO error {error} in phase {phase})")
        return solution


def _pardiso(
    handle: NDArray[np.int64],
    kind: int,
    phase: int,
    size: int,
    values: Floats,
    indptr: Indices,
    indices: Indices,
    iparm: Indices,
    rhs: Floats,
    solution: Floats,
) -> int:
    """One call of MKL's pardiso; its error code."""
    error, unused = ctypes.c_int32(0), np.zeros(1, dtype=np.int32)
    mkl().pardiso(
        _pointer(handle, ctypes.c_int64), _integer(1), _integer(1), _integer(kind), _integer(phase), _integer(size),
        _pointer(values, ctypes.c_double), _pointer(indptr, ctypes.c_int32), _pointer(indices, ctypes.c_int32),
        _pointer(unused, ctypes.c_int32), _integer(1), _pointer(iparm, ctypes.c_int32), _integer(0),
        _pointer(rhs, ctypes.c_double), _pointer(solution, ctypes.c_double), ctypes.byref(error),
    )  # fmt: skip
    return error.value


def _release(handle: NDArray[np.int64], kind: int, size: int, iparm: Indices) -> None:
    """Give a solver's memory back to MKL."""
    none, empty = np.zeros(1, dtype=np.int32), np.zeros(1)
    _pardiso(handle, kind, _RELEASE, size, empty, none, none, iparm, empty, empty)


class SuperLuSolver:
    """SciPy's SuperLU with the interface of `PardisoSolver`; slower."""

    def __init__(self, indptr: Indices, indices: Indices, symmetric: bool) -> None:
        self._indptr, self._indices, self._symmetric = indptr, indices, symmetric
        self.factorisations = 0

    def solve(self, values: Floats, rhs: Floats) -> Floats:
        """Factorise the matrix with these entries and solve for one right-hand side."""
        self.factorise(values)
        return self.back_substitute(rhs)

    def factorise(self, values: Floats) -> None:
        """Factorise the matrix with these entries."""
        size = len(self._indptr) - 1
        matrix = sp.csr_array((values, self._indices, self._indptr), shape=(size, size))
        if self._symmetric:
            matrix = matrix + sp.triu(matrix, 1).T
        try:
            self._factors = splu(sp.csc_array(matrix))
        except RuntimeError as error:
            raise NotConvergedError(f"the linear solver failed ({error})") from error
        self.factorisations += 1

    def back_substitute(self, rhs: Floats) -> Floats:
        """Solve for one more right-hand side with the factors at hand."""
        return np.asarray(self._factors.solve(rhs))


def _refuse_infinite(*arrays: Floats) -> None:
    if not all(np.isfinite(array).all() for array in arrays):
        raise NotConvergedError("the linear system holds values that are not finite")


def linear_solver(indptr: Indices, indices: Indices, symmetric: bool) -> PardisoSolver | SuperLuSolver:
    """The fastest solver at hand for a pattern."""
    kind: Any = PardisoSolver if mkl() is not None else SuperLuSolver
    solver: PardisoSolver | SuperLuSolver = kind(indptr, indices, symmetric)
    return solver


def _integer(value: int) -> Any:
    return ctypes.byref(ctypes.c_int32(value))


def _pointer(array: NDArray[Any], kind: Any) -> Any:
    return array.ctypes.data_as(ctypes.POINTER(kind))

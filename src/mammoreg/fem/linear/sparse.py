"""Assembly into a sparse matrix whose pattern is found once."""

from collections.abc import Sequence

import numpy as np

from mammoreg.arrays import Floats, Integers


class Assembler:
    """Sums dense blocks into a CSR matrix over the free degrees of freedom.

    Args:
        groups: for each kind of block, the degrees of freedom (blocks, size) of its rows and columns.
        free: the unknowns, ascending, (n,).
        total: number of all degrees of freedom.
        symmetric: keep the upper triangle only.

    Attributes:
        indptr, indices: CSR structure, zero-based, indices ascending, with the whole diagonal.
    """

    def __init__(self, groups: Sequence[Integers], free: Integers, total: int, symmetric: bool) -> None:
        self.size = len(free)
        number = np.full(total, -1, dtype=np.int64)
        number[free] = np.arange(self.size)
        rows, columns = [], []
        for group in groups:
            width = group.shape[1]
            rows.append(np.repeat(number[group], width, axis=1).ravel())
            columns.append(np.tile(number[group], (1, width)).ravel())
        row, column = np.concatenate(rows), np.concatenate(columns)
        kept = (row >= 0) & (column >= (row if symmetric else 0))
        diagonal = np.arange(self.size) * (self.size + 1)
        keys = np.concatenate([row[kept] * self.size + column[kept], diagonal])
        unique, place = np.unique(keys, return_inverse=True)
        self._slot = np.full(row.size, len(unique), dtype=np.int64)
        self._slot[kept] = place[: np.count_nonzero(kept)]
        self.indices = (unique % self.size).astype(np.int32)
        counts = np.bincount(unique // self.size, minlength=self.size)
        self.indptr = np.concatenate([[0], np.cumsum(counts)]).astype(np.int32)

    def values(self, blocks: Sequence[Floats]) -> Floats:
        """Entries of the matrix from the blocks (blocks, size, size) of each group."""
        flat = np.concatenate([block.ravel() for block in blocks])
        sums = np.bincount(self._slot, weights=flat, minlength=len(self.indices) + 1)
        return np.asarray(sums[: len(self.indices)], dtype=float)

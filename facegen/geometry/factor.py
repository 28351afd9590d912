"""One sparse symmetric positive definite matrix, factored once, solved often.

SuperLU in symmetric mode is what SciPy brings. Where the package qdldl is installed it is used instead: the same
result in two thirds of the time.
"""

from __future__ import annotations

import warnings
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from facegen.errors import InputError

# SuperLU solves this many right-hand sides at a time: wide blocks leave the cache and take several times as long.
_COLUMNS = 3
# qdldl takes one; so many are turned into columns at a time, because single ones are far apart in memory.
_COPIED = 24
# Because a pivot this much smaller than the largest is what remains of a zero after rounding.
_LEAST_PIVOT = 1e-13


class Factor:
    """The factorised matrix A (n, n): ``Factor(A).solve(b)``. InputError if A is singular to working precision.

    spent: the factor of another matrix, which is no longer needed. If that has its entries at the same places, qdldl
    uses its order of elimination again, which saves half the time.
    """

    def __init__(self, matrix: sparse.sparray, *, what: str = "the system", spent: Factor | None = None) -> None:
        matrix = sparse.csc_array(matrix)
        matrix.sum_duplicates()
        diagonal = matrix.diagonal()
        if not np.isfinite(matrix.data).all() or not len(diagonal) or diagonal.min() <= 0:
            raise InputError(f"{what} cannot be solved: a vertex is tied to nothing, or a number is not finite")
        # Scaled to a unit diagonal: pivots of different places can then be compared.
        self._scale = 1 / np.sqrt(diagonal)
        columns = np.repeat(np.arange(len(diagonal)), np.diff(matrix.indptr))
        scaled = matrix.data * self._scale[matrix.indices] * self._scale[columns]
        library = _qdldl()
        try:
            if library is None:
                matrix = sparse.csc_array((scaled, matrix.indices, matrix.indptr), shape=matrix.shape)
                self._factor = sparse.linalg.splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0,
                                                  options={"SymmetricMode": True})
                pivots = np.abs(self._factor.U.diagonal())
            else:
                upper = matrix.indices <= columns
                starts = np.concatenate([[0], np.cumsum(np.bincount(columns[upper], minlength=len(diagonal)))])
                self._upper = sparse.csc_matrix((scaled[upper], matrix.indices[upper], starts), shape=matrix.shape)
                if spent is not None and spent._has_places_of(self._upper):
                    self._factor = spent._factor
                    self._factor.update(self._upper, upper=True)
                else:
                    self._factor = library.Solver(self._upper, upper=True)
                pivots = np.abs(self._factor.factors()[1])
        except RuntimeError as error:
            raise InputError(f"{what} is singular ({error}): a part of the mesh is tied to nothing") from None
        if not np.isfinite(pivots).all() or pivots.min() < _LEAST_PIVOT * pivots.max():
            raise InputError(f"{what} is singular to working precision (pivots {pivots.min():.1e} to "
                             f"{pivots.max():.1e}): a part of the mesh is tied to nothing")

    def _has_places_of(self, upper: sparse.csc_matrix) -> bool:
        """Whether qdldl factored a matrix with entries where this one has them."""
        own = getattr(self, "_upper", None)
        return own is not None and np.array_equal(own.indptr, upper.indptr) and \
            np.array_equal(own.indices, upper.indices)

    def solve(self, right: NDArray) -> NDArray[np.float64]:
        """Return x (n, ...) with A x = right (n, ...)."""
        right = np.asarray(right, dtype=np.float64)
        columns, result = right.reshape(len(right), -1), np.empty((len(right), right[:1].size))
        superlu = isinstance(self._factor, sparse.linalg.SuperLU)
        width = _COLUMNS if superlu else _COPIED
        for start in range(0, columns.shape[1], width):
            part = slice(start, start + width)
            scaled = columns[:, part] * self._scale[:, None]
            if superlu:
                solved = self._factor.solve(scaled)
            else:
                solved = np.stack([self._factor.solve(column) for column in np.ascontiguousarray(scaled.T)], axis=1)
            result[:, part] = solved * self._scale[:, None]
        return result.reshape(right.shape)


@cache
def _qdldl():
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            import qdldl
    except ImportError:
        return None
    return qdldl

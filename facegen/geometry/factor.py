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
# SuperLU eliminates this many columns together: of matrices as sparse as a skin's a sixth faster than its own twenty.
_PANEL = 4
# qdldl takes one; so many are turned into columns at a time, because single ones are far apart in memory.
_COPIED = 24
# Because a pivot this much smaller than the largest is what remains of a zero after rounding.
_LEAST_PIVOT = 1e-13


class Factor:
    """The factorised matrix A (n, n): ``Factor(A).solve(b)``. InputError if A is singular to working precision.

    spent: the factor of another matrix, which is no longer needed. If that has its entries at the same places, its
    order of elimination is used again, which saves a third of the time, with qdldl half.
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
        scaled = sparse.csc_array((matrix.data * self._scale[matrix.indices] * self._scale[columns], matrix.indices,
                                   matrix.indptr), shape=matrix.shape)
        self._places = matrix.indptr, matrix.indices
        alike = spent is not None and all(map(np.array_equal, spent._places, self._places))
        kind = _SuperLU if _qdldl() is None else _Qdldl
        try:
            self._inside = kind(scaled, spent._inside if alike else None)
        except RuntimeError as error:
            raise InputError(f"{what} is singular ({error}): a part of the mesh is tied to nothing") from None
        pivots = np.abs(self._inside.pivots())
        if not np.isfinite(pivots).all() or pivots.min() < _LEAST_PIVOT * pivots.max():
            raise InputError(f"{what} is singular to working precision (pivots {pivots.min():.1e} to "
                             f"{pivots.max():.1e}): a part of the mesh is tied to nothing")

    def solve(self, right: NDArray) -> NDArray[np.float64]:
        """Return x (n, ...) with A x = right (n, ...)."""
        right = np.asarray(right, dtype=np.float64)
        columns, result = right.reshape(len(right), -1), np.empty((len(right), right[:1].size))
        for start in range(0, columns.shape[1], self._inside.width):
            part = slice(start, start + self._inside.width)
            result[:, part] = self._inside.solve(columns[:, part] * self._scale[:, None]) * self._scale[:, None]
        return result.reshape(right.shape)


class _SuperLU:
    """SciPy's. ``order``: which rows and columns its matrix has, where another one's order of elimination is used."""

    width = _COLUMNS

    def __init__(self, matrix: sparse.csc_array, spent: _SuperLU | None) -> None:
        self._order = None if spent is None else spent._elimination()
        if self._order is not None:
            matrix = matrix[self._order][:, self._order]
        self._factor = sparse.linalg.splu(
            matrix, permc_spec="MMD_AT_PLUS_A" if self._order is None else "NATURAL", diag_pivot_thresh=0.0,
            panel_size=_PANEL, options={"SymmetricMode": True})

    def _elimination(self) -> NDArray[np.int64]:
        return np.argsort(self._factor.perm_c) if self._order is None else self._order

    def pivots(self) -> NDArray[np.float64]:
        return self._factor.U.diagonal()

    def solve(self, right: NDArray) -> NDArray[np.float64]:
        if self._order is None:
            return self._factor.solve(right)
        result = np.empty_like(right)
        result[self._order] = self._factor.solve(right[self._order])
        return result


class _Qdldl:
    """The accelerator, which takes the upper half."""

    width = _COPIED

    def __init__(self, matrix: sparse.csc_array, spent: _Qdldl | None) -> None:
        columns = np.repeat(np.arange(matrix.shape[1]), np.diff(matrix.indptr))
        upper = matrix.indices <= columns
        starts = np.concatenate([[0], np.cumsum(np.bincount(columns[upper], minlength=matrix.shape[1]))])
        upper = sparse.csc_matrix((matrix.data[upper], matrix.indices[upper], starts), shape=matrix.shape)
        if spent is None:
            self._factor = _qdldl().Solver(upper, upper=True)
        else:
            self._factor = spent._factor
            self._factor.update(upper, upper=True)

    def pivots(self) -> NDArray[np.float64]:
        return self._factor.factors()[1]

    def solve(self, right: NDArray) -> NDArray[np.float64]:
        return np.stack([self._factor.solve(column) for column in np.ascontiguousarray(right.T)], axis=1)


@cache
def _qdldl():
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            import qdldl
    except ImportError:
        return None
    return qdldl

"""Factors of sparse symmetric matrices, by SuperLU with minimum degree ordering."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_matrix
from scipy.sparse.linalg import splu

__all__ = ["SymmetricFactor"]


class SymmetricFactor:
    """Factor of a symmetric or Hermitian matrix; ``solve`` applies the inverse.

    Rows are shuffled first: in the order of a regularly subdivided mesh, minimum degree may take
    minutes where it takes a second in any other.

    Parameters
    ----------
    matrix : (n, n) sparse
        Real or complex, single or double precision.
    like : SymmetricFactor, optional
        Of a matrix with about the same entries: its elimination order is taken over, which is a
        third of the work.
    definite : bool
        False for a matrix with negative eigenvalues: rows then change places for the sake of
        pivots. Without, single precision would lose three digits; few change, so the factor stays
        as sparse.

    Attributes
    ----------
    order : (n,) int64
        Row i of the factor is row ``order[i]`` of the matrix.
    """

    def __init__(
        self, matrix: Any, like: SymmetricFactor | None = None, definite: bool = True
    ) -> None:
        if like is None:
            self.order = np.random.default_rng(0).permutation(matrix.shape[0])
        else:
            self.order = like.order[np.argsort(like._factor.perm_c)]
        shuffled = matrix.tocsr()[self.order][:, self.order]
        # Without pivoting the ordering holds for certain, and the factor stays sparse.
        self._factor: Any = splu(
            csc_matrix(shuffled),
            permc_spec="MMD_AT_PLUS_A" if like is None else "NATURAL",
            diag_pivot_thresh=0.0 if definite else 1.0,
            options={"SymmetricMode": True},
        )

    def solve(self, right: NDArray[Any]) -> NDArray[Any]:
        """The matrix's inverse times a vector (n,) or some columns (n, c)."""
        found = self.solve_in_order(right[self.order])
        out = np.zeros_like(found)
        out[self.order] = found
        return out

    def solve_in_order(self, right: NDArray[Any]) -> NDArray[Any]:
        """The same, with all rows in the order of the factor: saves two shuffles."""
        return np.asarray(self._factor.solve(right))

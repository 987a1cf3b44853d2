"""Smallest eigenpairs of a Laplacian, orthonormal in the mass."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh
from scipy.sparse import csr_matrix, diags_array
from scipy.sparse.linalg import LinearOperator, eigsh, splu

__all__ = ["Spectrum", "smallest_eigenpairs"]

_DENSE_BELOW = 400


@dataclass(frozen=True, eq=False)
class Spectrum:
    """Eigenpairs ``L phi = lambda M phi``, ascending.

    Attributes
    ----------
    eigenvalues : (k,) float64
        Not negative (rounding below zero is cut off).
    eigenvectors : (n, k) float64 or complex128
        ``Phi^H M Phi = I``.
    """

    eigenvalues: NDArray[np.float64]
    eigenvectors: NDArray


def smallest_eigenpairs(laplacian: csr_matrix, mass: NDArray[np.float64], k: int) -> Spectrum:
    """The k smallest eigenpairs of (L, M); all of them where n <= k.

    Fewer than k pairs come back only from meshes of fewer than k vertices: then the basis is
    complete and spectral diffusion exact, so no padding is needed. Repeatable: the start vector
    is fixed.

    Parameters
    ----------
    laplacian : (n, n) sparse, symmetric or Hermitian, positive semidefinite
    mass : (n,) float64
        Diagonal of M, positive.
    k : int
    """
    n = laplacian.shape[0]
    k = min(k, n)
    root = np.sqrt(mass)
    scale = diags_array(1.0 / root)
    if n < _DENSE_BELOW or k > n - 2:
        standard = (scale @ laplacian @ scale).toarray()
        values, vectors = eigh(standard, subset_by_index=(0, k - 1))
    else:
        shift = -0.02 * 4.0 * np.pi * k / mass.sum()
        shifted = (laplacian - shift * diags_array(mass)).tocsc()
        factor = splu(shifted, permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True})

        def solve(x: NDArray) -> NDArray:
            return root * factor.solve(root * x.reshape(-1).astype(laplacian.dtype))

        inverse = LinearOperator((n, n), matvec=solve, dtype=laplacian.dtype)
        standard = scale @ laplacian @ scale
        start = np.random.default_rng(0).standard_normal(n).astype(laplacian.dtype)
        values, vectors = eigsh(standard, k=k, sigma=shift, OPinv=inverse, v0=start)
        order = np.argsort(values)
        values, vectors = values[order], vectors[:, order]
    return Spectrum(np.maximum(values, 0.0), vectors / root[:, None])

"""Smallest eigenpairs of a Laplacian, orthonormal in the mass.

Large meshes get a block Lanczos iteration of the inverse in single precision (double where slivers
ask for it), closed by a Rayleigh-Ritz step in double: three to four times faster than ARPACK, the
span good to 1e-3 (sine of the largest angle) and the eigenvalues to 1e-5, which is all that
diffusion uses. Small meshes get ARPACK or a dense solver, in double precision; so does whatever
block Lanczos gives up on.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh
from scipy.sparse import csr_matrix, diags_array
from scipy.sparse.linalg import LinearOperator, eigsh

from vhquad.geometry.sparse import PositiveFactor

__all__ = ["Spectrum", "smallest_eigenpairs"]

_DENSE_BELOW = 400
_EXACT_BELOW = 2000

_SHIFT = 0.02  # of the operator inverted, in units of the expected k-th eigenvalue
_BLOCK = 8
_RESIDUAL = 3e-4  # of the inverse's Ritz pairs, relative, at which the iteration stops
_DISAGREEMENT = 1e-3  # with the Rayleigh quotients in double, in units of the k-th eigenvalue
_SINGLE_UP_TO = 1e7  # largest diagonal entry, in that unit, that single precision may see


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


def smallest_eigenpairs(
    laplacian: csr_matrix, mass: NDArray[np.float64], k: int, exact: bool | None = None
) -> Spectrum:
    """The k smallest eigenpairs of (L, M); all of them where n <= k.

    Fewer than k pairs come back only from meshes of fewer than k vertices: then the basis is
    complete and spectral diffusion exact, so no padding is needed. Repeatable: start vectors are
    fixed. Where an eigenvalue repeats, the basis of its eigenspace is arbitrary.

    Parameters
    ----------
    laplacian : (n, n) sparse, symmetric or Hermitian, positive semidefinite
    mass : (n,) float64
        Diagonal of M, positive.
    k : int
    exact : bool, optional
        Double precision throughout (True), the fast way (False), or what the size suggests.
    """
    n = laplacian.shape[0]
    k = min(k, n)
    root = np.sqrt(mass)
    unit = 4.0 * np.pi * k / mass.sum()  # Weyl's estimate of the k-th eigenvalue
    standard = (diags_array(1.0 / root) @ laplacian @ diags_array(1.0 / root) / unit).tocsc()
    found = None
    if n < _DENSE_BELOW or 4 * k > n:
        found = eigh(standard.toarray(), subset_by_index=(0, k - 1))
    elif n >= _EXACT_BELOW if exact is None else not exact:
        tame = standard.diagonal().real.max() < _SINGLE_UP_TO
        found = _block_lanczos(standard, k, single=True) if tame else None
        found = _block_lanczos(standard, k, single=False) if found is None else found
    values, vectors = _arpack(standard, k) if found is None else found
    return Spectrum(unit * np.maximum(values, 0.0), vectors / root[:, None])


def _factor(standard: csr_matrix, dtype: np.dtype) -> PositiveFactor:
    """Factors of the matrix shifted to be positive definite."""
    shifted = (standard + _SHIFT * diags_array(np.ones(standard.shape[0]))).astype(dtype)
    return PositiveFactor(shifted)


def _arpack(standard: csr_matrix, k: int) -> tuple[NDArray, NDArray]:
    """Shift-invert Lanczos in double precision, to machine precision."""
    n, dtype = standard.shape[0], standard.dtype
    factor = _factor(standard, dtype)
    inverse = LinearOperator(
        (n, n), matvec=lambda x: factor.solve(x.reshape(-1).astype(dtype)), dtype=dtype
    )
    start = np.random.default_rng(0).standard_normal(n).astype(dtype)
    values, vectors = eigsh(standard, k=k, sigma=-_SHIFT, OPinv=inverse, v0=start)
    order = np.argsort(values)
    # ARPACK's complex solver leaves repeated eigenvalues' vectors independent, not orthogonal.
    return _rayleigh_ritz(standard, vectors[:, order])


def _block_lanczos(standard: csr_matrix, k: int, single: bool) -> tuple[NDArray, NDArray] | None:
    """Shift-invert block Lanczos in single or double precision; None if that is not enough.

    Full reorthogonalisation, no restart. The projected matrix is block tridiagonal; its last block
    row times the Ritz vectors gives the residuals.
    """
    n = standard.shape[0]
    kind = standard.dtype.kind
    dtype = np.dtype(f"{kind}{standard.dtype.itemsize // (2 if single else 1)}")
    try:
        factor = _factor(standard, dtype)
    except RuntimeError:  # singular in this precision
        return None
    most = _BLOCK * (min(n - _BLOCK, 6 * k + 10 * _BLOCK) // _BLOCK)
    basis = np.zeros((n, most), dtype=dtype, order="F")
    projected = np.zeros((most, most), dtype=np.result_type(dtype, np.float64))
    rng = np.random.default_rng(0)
    # Smooth from the start: the least share of a stiff mode (a sliver's) would have much energy.
    block = np.linalg.qr(factor.solve(rng.standard_normal((n, _BLOCK)).astype(dtype)))[0]
    link = np.zeros((_BLOCK, _BLOCK), dtype=dtype)
    for j in range(0, most, _BLOCK):
        end = j + _BLOCK
        basis[:, j:end] = block
        image = factor.solve(block)
        if j:
            image -= basis[:, j - _BLOCK : j] @ link.conj().T
            projected[j:end, j - _BLOCK : j] = link
            projected[j - _BLOCK : j, j:end] = link.conj().T
        diagonal = block.conj().T @ image
        image -= block @ diagonal
        projected[j:end, j:end] = 0.5 * (diagonal + diagonal.conj().T)
        image -= basis[:, :end] @ (image.conj().T @ basis[:, :end]).conj().T
        block, link = np.linalg.qr(image)
        if not np.isfinite(link).all():
            return None
        if end >= 2.4 * k and (end // _BLOCK) % 2 == 0:
            inverses, ritz = eigh(projected[:end, :end], subset_by_index=(end - k, end - 1))
            residual = np.linalg.norm(link @ ritz[j:end], axis=0) / inverses
            if residual.max() < _RESIDUAL:
                break
    else:
        return None
    expected = 1.0 / inverses[::-1] - _SHIFT
    values, vectors = _rayleigh_ritz(standard, basis[:, :end] @ ritz[:, ::-1].astype(dtype))
    good = np.abs(values - expected).max() < _DISAGREEMENT * values.max()
    return (values, vectors) if good else None


def _rayleigh_ritz(standard: csr_matrix, vectors: NDArray) -> tuple[NDArray, NDArray]:
    """Eigenvalues and orthonormal eigenvectors within the span of some vectors, in double."""
    y = np.asarray(vectors, dtype=standard.dtype)
    adjoint = y.conj().T
    gram, energy = adjoint @ y, adjoint @ (standard @ y)
    values, mix = eigh(0.5 * (energy + energy.conj().T), 0.5 * (gram + gram.conj().T))
    return values, y @ mix

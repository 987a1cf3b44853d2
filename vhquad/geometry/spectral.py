"""Smallest eigenpairs of a Laplacian, orthonormal in the mass.

Large meshes get a block Lanczos iteration of a shifted inverse in single precision (double where
slivers ask for it), closed by Rayleigh quotients in double: about five times faster than ARPACK,
the span good to 1e-3 (sine of the largest angle) and the eigenvalues to 1e-5, which is all that
diffusion uses. Small meshes get ARPACK or a dense solver, in double precision; so does whatever
block Lanczos gives up on.

The shift lies amid the wanted eigenvalues: those above it are the largest of the inverse, those
below it negative, all others crowd between 0 and the least of the former. That takes two thirds of
the steps which a shift below all of them takes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError, cholesky, eigh, get_blas_funcs
from scipy.sparse import csr_matrix, diags_array
from scipy.sparse.linalg import LinearOperator, eigsh

from vhquad.geometry.sparse import SymmetricFactor

__all__ = ["Spectrum", "smallest_eigenpairs"]

_DENSE_BELOW = 400
_EXACT_BELOW = 1000  # ARPACK in double precision takes half a second there, and more beyond

_AMID = 0.5  # shift, in units of the expected k-th eigenvalue; 0.7 takes as many steps
_BELOW = -0.1  # where the matrix must stay definite
_ROUNDING = 1e-2  # of an eigenvalue 0
_BLOCK = 8
_SKEW = 1e-4  # of the Ritz vectors, that a correction of second order still mends
_RESIDUAL = 2e-4  # of the inverse's Ritz pairs, relative, at which the iteration stops
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
        found = _block_lanczos(standard, k, _AMID, single=True) if tame else None
        found = _block_lanczos(standard, k, _BELOW, single=False) if found is None else found
    values, vectors = _arpack(standard, k) if found is None else found
    vectors /= root[:, None]
    return Spectrum(unit * np.maximum(values, 0.0), vectors)


def _factor(standard: csr_matrix, shift: float, dtype: np.dtype) -> SymmetricFactor:
    """Factors of the matrix less a multiple of the unit matrix."""
    shifted = standard - shift * diags_array(np.ones(standard.shape[0]))
    return SymmetricFactor(shifted.astype(dtype), definite=shift < 0)


def _arpack(standard: csr_matrix, k: int) -> tuple[NDArray, NDArray]:
    """Shift-invert Lanczos in double precision, to machine precision."""
    n, dtype = standard.shape[0], standard.dtype
    factor = _factor(standard, _BELOW, dtype)
    inverse = LinearOperator(
        (n, n), matvec=lambda x: factor.solve(x.reshape(-1).astype(dtype)), dtype=dtype
    )
    start = np.random.default_rng(0).standard_normal(n).astype(dtype)
    values, vectors = eigsh(standard, k=k, sigma=_BELOW, OPinv=inverse, v0=start)
    order = np.argsort(values)
    # ARPACK's complex solver leaves repeated eigenvalues' vectors independent, not orthogonal.
    return _rayleigh_ritz(standard, vectors[:, order])


def _block_lanczos(
    standard: csr_matrix, k: int, shift: float, single: bool
) -> tuple[NDArray, NDArray] | None:
    """Shift-invert block Lanczos in single or double precision; None if that is not enough.

    No restart. Rows stand in the factor's order throughout. The projected matrix is block
    tridiagonal; its last block row times the Ritz vectors gives the residuals.

    References
    ----------
    Grimes, Lewis & Simon 1994, "A shifted block Lanczos algorithm for solving sparse symmetric
    generalized eigenproblems".
    """
    n = standard.shape[0]
    dtype = np.dtype(f"{standard.dtype.kind}{standard.dtype.itemsize // (2 if single else 1)}")
    try:
        factor = _factor(standard, shift, dtype)
    except RuntimeError:  # singular in this precision
        return None
    most = _BLOCK * (min(n - _BLOCK, 6 * k + 10 * _BLOCK) // _BLOCK)
    basis = np.zeros((n, most), dtype=dtype, order="F")
    projected = np.zeros((most, most), dtype=np.result_type(dtype, np.float64))
    start = np.random.default_rng(0).standard_normal((n, _BLOCK)).astype(dtype)
    # Smooth from the start: the least share of a stiff mode (a sliver's) would have much energy.
    block, link = _orthonormal(factor.solve_in_order(start))
    for j in range(0, most, _BLOCK):
        end = j + _BLOCK
        basis[:, j:end] = block
        image = factor.solve_in_order(block)
        if j:
            image -= basis[:, j - _BLOCK : j] @ link.conj().T
            projected[j:end, j - _BLOCK : j] = link
            projected[j - _BLOCK : j, j:end] = link.conj().T
        diagonal = block.conj().T @ image
        image -= block @ diagonal
        projected[j:end, j:end] = 0.5 * (diagonal + diagonal.conj().T)
        block, link = _orthonormal(_cleaned(basis[:, :end], image))
        if not np.isfinite(link).all():
            return None
        if end >= 1.5 * k and (end // _BLOCK) % 2 == 0:
            inverses, ritz = eigh(projected[:end, :end])
            least = _least(inverses, shift)[:k]
            inverses, ritz = inverses[least], ritz[:, least]
            residual = np.linalg.norm(link @ ritz[j:end], axis=0) / np.abs(inverses)
            if len(least) == k and (residual < _RESIDUAL).all():
                break
    else:
        return None
    vectors = np.empty((n, k), dtype=dtype)
    vectors[factor.order] = basis[:, :end] @ ritz.astype(dtype)
    return _closed(standard, vectors, shift + 1.0 / inverses)


def _least(inverses: NDArray, shift: float) -> NDArray[np.int64]:
    """Which of some Ritz values of the shifted inverse are of the least eigenvalues, in order.

    A Ritz value of an eigenvalue below zero is of none: it lies in a gap of the spectrum.
    """
    values = shift + 1.0 / inverses
    order = np.argsort(values)
    return np.asarray(order[values[order] > -_ROUNDING])


def _orthonormal(columns: NDArray) -> tuple[NDArray, NDArray]:
    """Orthonormal columns Q and small R with ``Q R`` the given columns (Cholesky, twice)."""
    q, r = columns, np.eye(columns.shape[1], dtype=columns.dtype)
    try:
        for _ in range(2):
            gram = (q.conj().T @ q).astype(np.result_type(q.dtype, np.float64))
            upper = cholesky(gram, check_finite=False)
            q = q @ np.linalg.inv(upper).astype(q.dtype)
            r = upper.astype(q.dtype) @ r
    except LinAlgError:  # columns that depend on each other, or are not finite
        q, r = np.linalg.qr(columns)
    return np.asfortranarray(q), r


def _cleaned(basis: NDArray, image: NDArray) -> NDArray:
    """A block less what it has of the basis.

    Every block needs it: an inverse with large eigenvalues soon brings their vectors back.
    """
    overlap = (image.conj().T @ basis).conj().T  # the adjoint of the small factor is cheap
    image -= basis @ overlap
    return image


def _closed(
    standard: csr_matrix, vectors: NDArray, expected: NDArray
) -> tuple[NDArray, NDArray] | None:
    """Ritz vectors made orthonormal in double precision, with their Rayleigh quotients.

    The inverse root of the Gram matrix comes from its series: ``(I + S)^-1/2 = I - S/2 + 3/8 S^2``.
    None where that or the expected eigenvalues are too far off.
    """
    y = np.asarray(vectors, dtype=standard.dtype, order="F")
    name, adjoint = ("herk", 2) if y.dtype.kind == "c" else ("syrk", 1)
    half = get_blas_funcs(name, (y,))(1.0, y, trans=adjoint)  # the upper triangle
    skew = np.triu(half, 1)
    skew = skew + skew.conj().T + np.diag(half.diagonal().real - 1.0)
    if not np.abs(skew).max() < _SKEW:
        return None
    # The correction is small: single precision does for it.
    y -= vectors @ (0.5 * skew - 0.375 * skew @ skew).astype(vectors.dtype)
    # Column by column: what is as large as y costs more to allocate than to compute.
    values = np.array([np.vdot(column, standard @ column).real for column in y.T])
    if np.abs(values - expected).max() >= _DISAGREEMENT * values.max():
        return None
    order = np.argsort(values, kind="stable")
    same = (order == np.arange(len(order))).all()
    return (values, y) if same else (values[order], y[:, order])


def _rayleigh_ritz(standard: csr_matrix, vectors: NDArray) -> tuple[NDArray, NDArray]:
    """Eigenvalues and orthonormal eigenvectors within the span of some vectors, in double."""
    y = np.asarray(vectors, dtype=standard.dtype)
    adjoint = y.conj().T
    gram, energy = adjoint @ y, adjoint @ (standard @ y)
    values, mix = eigh(0.5 * (energy + energy.conj().T), 0.5 * (gram + gram.conj().T))
    return values, y @ mix

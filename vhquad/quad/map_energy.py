"""Distortion of a map as a function of the free unknowns of a linear space, with derivatives.

The Jacobian of a triangle, relative to the wanted one, is kept as two complex numbers: A, by which
it turns and scales, and B, by which it mirrors; the ideal is A = 1, B = 0. With F the four real
numbers (A, B) and K = diag(1, 1, -1, -1), the determinant is D = F·KF and the symmetric Dirichlet
energy ``|J|^2 + |J^-1|^2 = 2 |F|^2 (1 + 1/D^2)`` (Smith & Schaefer 2015), which grows without bound
before a triangle folds.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import bsr_matrix, csr_matrix, diags_array

from vhquad.geometry.sparse import SymmetricFactor
from vhquad.mesh.triangle import TriMesh

__all__ = ["MapEnergy", "largest_step"]

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

_K = np.array([1.0, 1.0, -1.0, -1.0])
_IDEAL = np.array([1.0, 0.0, 0.0, 0.0])


class MapEnergy:
    """Energies of the maps ``basis @ x`` on a mesh.

    Parameters
    ----------
    mesh : TriMesh
    wedge : (m, 3) int64
        Wedge of each corner; wedge w has the coordinates 2w and 2w + 1.
    basis : (2 w, d) csr_matrix
    target : (m,) complex128
        Wanted gradient of u in the frame of each face (axis along halfedge 0); that of v is i
        times as much.
    """

    def __init__(
        self,
        mesh: TriMesh,
        wedge: NDArray[np.int64],
        basis: csr_matrix,
        target: NDArray[np.complex128],
    ) -> None:
        self.mesh = mesh
        self.area = mesh.face_areas / mesh.area
        corner = np.zeros((mesh.n_faces, 3), dtype=np.complex128)
        corner[:, 1] = mesh.edge_lengths[:, 0]
        corner[:, 2] = mesh.edge_lengths[:, 2] * np.exp(1j * mesh.corner_angles[:, 0])
        opposite = np.roll(corner, 1, axis=1) - np.roll(corner, -1, axis=1)
        area = np.maximum(mesh.face_areas, 1e-12 * mesh.face_areas.max())
        hat = 1j * opposite / (2 * area[:, None])  # gradients of the hat functions
        a = 0.5 * hat.conj() / target.conj()[:, None]
        b = 0.5 * hat / target[:, None]
        # c (u + i v) in real numbers: rows Re, Im; columns u, v.
        values = np.stack(
            [np.stack([c.real, -c.imag, c.imag, c.real], axis=2) for c in (a, b)], axis=1
        ).reshape(-1, 2, 3, 2, 2)
        rows = 4 * np.arange(mesh.n_faces)[:, None, None, None, None] + (
            2 * np.arange(2)[:, None, None, None] + np.arange(2)[:, None]
        )
        columns = 2 * wedge[:, None, :, None, None] + np.arange(2)
        rows, columns = (np.broadcast_to(x, values.shape).ravel() for x in (rows, columns))
        gradient = csr_matrix(
            (values.ravel(), (rows, columns)), shape=(4 * mesh.n_faces, basis.shape[0])
        )
        self.jacobian: csr_matrix = (gradient @ basis).tocsr()

    def frames(self, x: Floats) -> Floats:
        """F of each face; (m, 4)."""
        return np.asarray((self.jacobian @ x).reshape(-1, 4))

    def restricted(self, columns: NDArray[np.int64]) -> csr_matrix:
        """The Jacobian over some unknowns."""
        return self.jacobian[:, columns].tocsr()

    def least_squares(self, weight: Floats, x: Floats, free: NDArray[np.int64]) -> Floats:
        """Minimise the weighted squared distance to the ideal over some unknowns; all of them."""
        out = x.copy()
        out[free] = 0.0
        j = self.restricted(free)
        w = np.repeat(weight * self.area, 4)
        rest = (_IDEAL - self.frames(out)).ravel()
        out[free] = solve_positive((j.T @ (diags_array(w) @ j)).tocsc(), j.T @ (w * rest))
        return out

    def value(self, frames: Floats) -> float:
        """Mean symmetric Dirichlet energy; infinite where a triangle is folded."""
        d = determinants(frames)
        if not (d > 0).all():
            return float(np.inf)
        n = (frames**2).sum(axis=1)
        return float((self.area * 2 * n * (1 + 1 / d**2)).sum())

    def derivatives(self, frames: Floats) -> tuple[Floats, bsr_matrix]:
        """Gradient (4m,) and positive semidefinite Hessian (4m, 4m) over the frames."""
        d = determinants(frames)
        n = (frames**2).sum(axis=1)
        k = frames * _K
        first = 4 * frames * (1 + d**-2)[:, None] - 8 * (n * d**-3)[:, None] * k
        mixed = np.einsum("fi,fj->fij", frames, k)
        second = (
            4 * (1 + d**-2)[:, None, None] * np.eye(4)
            - 16 * (d**-3)[:, None, None] * (mixed + mixed.transpose(0, 2, 1))
            + 48 * (n * d**-4)[:, None, None] * np.einsum("fi,fj->fij", k, k)
            - 8 * (n * d**-3)[:, None, None] * np.diag(_K)
        )
        value, vector = np.linalg.eigh(second)
        value = np.maximum(value, 1e-3 * value[:, -1:]) * self.area[:, None]
        second = np.einsum("fik,fk,fjk->fij", vector, value, vector)
        m = len(d)
        hessian = bsr_matrix((second, np.arange(m), np.arange(m + 1)), shape=(4 * m, 4 * m))
        return (first * self.area[:, None]).ravel(), hessian


def determinants(frames: Floats) -> Floats:
    """Determinant of each face's Jacobian relative to the wanted one; (m,)."""
    return np.asarray((frames**2 * _K).sum(axis=1))


def largest_step(frames: Floats, move: Floats) -> float:
    """Largest t for which no triangle of ``frames + t * move`` has lost its area."""
    c = determinants(frames)
    b = 2 * (frames * move * _K).sum(axis=1)
    a = determinants(move)
    # The smallest positive root of a t^2 + b t + c, as 2c / (-b + sqrt(b^2 - 4ac)).
    root = np.sqrt(np.maximum(b * b - 4 * a * c, 0.0))
    real = b * b - 4 * a * c >= 0
    below = -b + root
    t = np.where(real & (below > 0), 2 * c / np.where(below > 0, below, 1.0), np.inf)
    return float(t.min())


def solve_positive(matrix: csr_matrix, right: Floats) -> Floats:
    """Solution of a symmetric positive definite system."""
    return SymmetricFactor(matrix).solve(right)

"""Cotan and connection Laplacians, lumped mass, gradient, and implicit heat diffusion.

All are built from an intrinsic triangulation; take the Delaunay one (``vhquad.geometry.delaunay``),
whose weights are not negative inside. At a border they may be: a triangle with an obtuse angle
opposite to its boundary edge gives that a negative one. The cotan Laplacian is positive
semidefinite even so. The connection Laplacian is not, as the frames of border vertices turn around
the triangle: it gets no negative weights.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix, diags_array

from vhquad.geometry.delaunay import IntrinsicTriangulation
from vhquad.geometry.sparse import SymmetricFactor

__all__ = [
    "connection_laplacian",
    "cotan_laplacian",
    "diffuse",
    "gradient_operator",
    "lumped_mass",
]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]


def lumped_mass(tri: IntrinsicTriangulation) -> Floats:
    """Area of each vertex, a third of its faces'; (n,) float64, in squared mesh units."""
    share = np.repeat(tri.face_areas / 3.0, 3)
    mass = np.bincount(tri.faces.reshape(-1), weights=share, minlength=tri.n_vertices)
    return mass.astype(np.float64)


def cotan_laplacian(tri: IntrinsicTriangulation) -> csr_matrix:
    """Scalar Laplacian; (n, n) float64, symmetric positive semidefinite, integrated (no mass)."""
    return _assemble(tri, tri.halfedge_weights, np.ones(tri.faces.size))


def connection_laplacian(tri: IntrinsicTriangulation, order: int = 1) -> csr_matrix:
    """Connection Laplacian of order-N fields; (n, n) complex128, Hermitian, semidefinite.

    ``(L u)_i = sum_j w_ij (u_i - r_ji^N u_j)`` with the cotan weights w, those of boundary edges
    not below 0. (Eq. 3 of the paper prints ``r_ij`` in row i, column j, which must be read as the
    rotation that brings j's vector to i.)

    Parameters
    ----------
    tri : IntrinsicTriangulation
    order : int
        N: 1 for vectors, 2 for lines, 4 for crosses.

    References
    ----------
    "Vector Heat Network", eq. 3; Knoeppel et al. 2013; Sharp et al. 2019.
    """
    inside = tri.twin >= 0
    weight = np.where(inside, tri.halfedge_weights, np.maximum(tri.halfedge_weights, 0.0))
    return _assemble(tri, weight, tri.transport**order)


def _assemble(
    tri: IntrinsicTriangulation, weight: Floats, rotation: Floats | Complexes
) -> csr_matrix:
    """Sum the weights of all halfedges; ``rotation[h]`` takes the tail's value to the head."""
    tail = tri.faces.reshape(-1)
    head = np.roll(tri.faces, -1, axis=1).reshape(-1)
    rows = np.concatenate([head, tail, tail, head])
    columns = np.concatenate([tail, head, tail, head])
    off = weight * rotation
    values = np.concatenate([-off, -off.conj(), weight, weight])
    n = tri.n_vertices
    matrix = csr_matrix((values, (rows, columns)), shape=(n, n))
    return csr_matrix(0.5 * (matrix + matrix.conj().T))


def gradient_operator(tri: IntrinsicTriangulation) -> csr_matrix:
    """Gradient of a vertex function as vectors in the vertex frames; (n, n) complex128.

    The constant gradients of the faces around a vertex, brought to its frame and averaged by area.
    """
    lengths, angle = tri.lengths, tri.corner_angles
    p1 = lengths[:, 0].astype(np.complex128)
    p2 = lengths[:, 2] * np.exp(1j * angle[:, 0])
    # Gradient of corner k's hat function: the opposite side turned by +90 degrees, over twice the
    # area. Integrated over a third of the face it is (side turned) / 6, the area cancels.
    opposite = np.stack([p2 - p1, -p2, p1], axis=1)
    hat = 1j * opposite / 6.0
    to_vertex = tri.vertex_to_face.conj()
    values = to_vertex[:, :, None] * hat[:, None, :]
    rows = np.repeat(tri.faces, 3, axis=1).reshape(-1)
    columns = np.tile(tri.faces, (1, 3)).reshape(-1)
    n = tri.n_vertices
    integrated = csr_matrix((values.reshape(-1), (rows, columns)), shape=(n, n))
    mass = lumped_mass(tri)
    inverse = np.divide(1.0, mass, out=np.zeros_like(mass), where=mass > 0)
    return csr_matrix(diags_array(inverse) @ integrated)


def diffuse(laplacian: csr_matrix, mass: Floats, time: float, u: NDArray) -> NDArray:
    """One implicit Euler step of the heat equation, ``(M + t L)^-1 M u``; the paper's eq. 4.

    The exact counterpart, in one step, of the spectral diffusion that the network uses.

    Parameters
    ----------
    laplacian : (n, n) sparse
        Cotan or connection Laplacian.
    mass : (n,) float64
    time : float
        In squared mesh units, not negative.
    u : (n,) or (n, c)
        Scalars, or vectors in the frames of the Laplacian's order.

    Returns
    -------
    Same shape as ``u``.
    """
    weight = mass.reshape((-1,) + (1,) * (u.ndim - 1))
    dtype = np.result_type(laplacian.dtype, u.dtype)
    system = (diags_array(mass) + time * laplacian).astype(dtype)
    return SymmetricFactor(system).solve((weight * u).astype(dtype))

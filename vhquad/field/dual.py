"""The faces of a mesh as a graph: connection, weights and Dirichlet energy across edges.

A vector of face ``f`` is carried over halfedge ``h`` to the frame of the next face ``g`` by
unfolding the two faces along their edge. Crosses are fourth powers, so they are carried by
``carry4[h] = exp(4i (alpha_g(twin) - alpha_f(h)))``: the half turn between the two halfedges
drops out. The energy is ``sum over edges of w |z_g - carry4[h] z_f|^2``, with ``w`` the edge's
length over the distance between the face centres, so that it tends to the integral of |grad z|^2.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix, csc_matrix

from vhquad.mesh.triangle import TriMesh

__all__ = ["carry4", "dirichlet", "dual_weights", "face_angles"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

WEIGHT_RANGE = 1e3  # slivers: weights are kept within this factor of their median


def face_angles(mesh: TriMesh) -> Floats:
    """Angle of halfedge k in the frame of its face, whose axis is halfedge 0; (3m,), radians."""
    corner = mesh.corner_angles
    zero = np.zeros(mesh.n_faces)
    return np.stack([zero, np.pi - corner[:, 1], np.pi + corner[:, 0]], axis=1).reshape(-1)


def carry4(mesh: TriMesh) -> Complexes:
    """What takes a cross across each halfedge to the next face; 1 on boundaries; (3m,)."""
    angle = face_angles(mesh)
    return np.where(mesh.twin >= 0, np.exp(4j * (angle[mesh.twin] - angle)), 1.0)


def dual_weights(mesh: TriMesh) -> Floats:
    """Weight of the edge under each halfedge, equal on twins, 0 on boundaries; (3m,)."""
    area = np.repeat(mesh.face_areas, 3)
    length = mesh.edge_lengths.reshape(-1)
    both = np.maximum(area + area[mesh.twin], np.finfo(np.float64).tiny)
    inner = mesh.twin >= 0
    weight = np.where(inner, 1.5 * length**2 / both, 0.0)
    if not inner.any():
        return weight
    middle = float(np.median(weight[inner]))
    return np.where(inner, np.clip(weight, middle / WEIGHT_RANGE, middle * WEIGHT_RANGE), 0.0)


def dirichlet(mesh: TriMesh, weight: Floats, carry: NDArray[np.inexact]) -> csc_matrix:
    """Matrix E of the energy ``z^H E z = sum over edges of w |z_g - carry z_f|^2``; (m, m).

    Parameters
    ----------
    mesh : TriMesh
    weight, carry : (3m,)
        Of each halfedge; of a twin the same weight and the conjugate carry.
    """
    h = np.flatnonzero(weight > 0)
    f, g = h // 3, mesh.twin[h] // 3
    row, column = np.concatenate([g, f]), np.concatenate([f, f])
    value = np.concatenate([-weight[h] * carry[h], weight[h].astype(carry.dtype)])
    shape = (mesh.n_faces, mesh.n_faces)
    return csc_matrix(coo_matrix((value, (row, column)), shape=shape))

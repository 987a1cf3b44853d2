"""Welding: vertices at exactly one place become one where a surface was left open there.

Only ends of open edges (edges with a single face) are joined. That closes the seams that
texture coordinates, normals or STL cut into a surface, and leaves closed parts that merely touch
as they are.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from vhquad.mesh.quad import QuadMesh

__all__ = ["components", "open_vertices", "position_classes", "weld_quads", "weld_seams"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]


def position_classes(points: Floats) -> Ints:
    """Lowest index of a vertex at exactly the same place, for each vertex; (n,)."""
    p = points + 0.0  # -0.0 and 0.0 are one place
    order = np.lexsort((p[:, 2], p[:, 1], p[:, 0]))
    new = np.ones(len(p), dtype=bool)
    new[1:] = (p[order[1:]] != p[order[:-1]]).any(axis=1)
    first = np.minimum.reduceat(order, np.flatnonzero(new)) if len(p) else order
    result = np.zeros(len(p), dtype=np.int64)
    result[order] = first[np.cumsum(new) - 1]
    return result


def open_vertices(faces: Ints, n: int) -> Bools:
    """Whether a vertex ends an edge with a single face; faces of any one size; (n,)."""
    tail, head = faces.reshape(-1), np.roll(faces, -1, axis=1).reshape(-1)
    key = np.minimum(tail, head) * np.int64(n) + np.maximum(tail, head)
    unique, count = np.unique(key, return_counts=True)
    single = unique[(count == 1) & (unique // n != unique % n)]
    flag = np.zeros(n, dtype=bool)
    flag[single // n] = True
    flag[single % n] = True
    return flag


def weld_seams(points: Floats, faces: Ints) -> Ints:
    """Class of each vertex, named by its lowest index, after joining open vertices at one place.

    Parameters
    ----------
    points : (n, 3) float64
    faces : (m, s) int64
        Faces of s corners each.

    Returns
    -------
    (n,) int64
        ``result[i]`` is the vertex that vertex i is joined to, i itself for most.
    """
    n = len(points)
    result = np.arange(n)
    border = np.flatnonzero(open_vertices(faces, n))
    result[border] = border[position_classes(points[border])]
    return result


def weld_quads(mesh: QuadMesh) -> QuadMesh:
    """A quad mesh with its seams welded and its unused vertices gone.

    Exporters split vertices where texture coordinates or normals jump; this joins them again.
    """
    welded = weld_seams(mesh.vertices, mesh.quads)[mesh.quads]
    used, local = np.unique(welded, return_inverse=True)
    return QuadMesh(mesh.vertices[used], local.reshape(-1, 4))


def components(n: int, a: Ints, b: Ints) -> Ints:
    """Component of each of n nodes joined by pairs (a, b), numbered by lowest node; (n,)."""
    graph = coo_matrix((np.ones(len(a), dtype=bool), (a, b)), shape=(n, n))
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)

"""Edge flips towards a Delaunay triangulation, where the surface is flat enough to allow them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vhquad.mesh.triangle import TriMesh

__all__ = ["flip_edges"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

FLAT = 0.9  # least cosine between the two faces, and of the new ones with their mean
SLACK = 1e-6  # radians that opposite angles must exceed 180 degrees by
ROUNDS = 4


def flip_edges(mesh: TriMesh, keep: Ints) -> TriMesh:
    """Flip interior edges whose opposite angles add up to more than 180 degrees.

    Many at once, the worst first, no two of a face; a few rounds leave few such edges.

    Parameters
    ----------
    mesh : TriMesh
        Manifold.
    keep : (k, 2) int64
        Edges that stay, as vertex pairs.

    Returns
    -------
    TriMesh
        The same vertices and topology.
    """
    faces, n = np.array(mesh.faces), mesh.n_vertices
    kept = np.sort(_keys(keep[:, 0], keep[:, 1], n))
    for _ in range(ROUNDS):
        part = TriMesh(mesh.vertices, faces)
        h, g = part.edge_halfedges[(part.edge_halfedges >= 0).all(axis=1)].T
        angle, normal = part.corner_angles.reshape(-1), part.face_normals
        excess = angle[_apex(h)] + angle[_apex(g)] - np.pi
        some = np.flatnonzero(excess > SLACK)
        h, g, excess = h[some], g[some], excess[some]
        a, b, c, d = part.tail[h], part.head[h], part.tail[_apex(h)], part.tail[_apex(g)]
        mean = normal[h // 3] + normal[g // 3]
        some = np.flatnonzero(
            (np.einsum("ei,ei->e", normal[h // 3], normal[g // 3]) > FLAT)
            & ~_among(_keys(a, b, n), kept)
            & ~_among(_keys(c, d, n), _keys(part.edges[:, 0], part.edges[:, 1], n))
            & _faces_up(mesh.vertices[np.stack([a, d, c], axis=1)], mean)
            & _faces_up(mesh.vertices[np.stack([d, b, c], axis=1)], mean)
        )
        some = some[_one_a_face(h[some] // 3, g[some] // 3, excess[some], part.n_faces)]
        # Two flips may want the same new edge: the first has it.
        some = some[np.unique(_keys(c[some], d[some], n), return_index=True)[1]]
        if some.size == 0:
            break
        faces[h[some] // 3] = np.stack([a, d, c], axis=1)[some]
        faces[g[some] // 3] = np.stack([d, b, c], axis=1)[some]
    return TriMesh(mesh.vertices, faces)


def _keys(i: Ints, j: Ints, n: int) -> Ints:
    return np.minimum(i, j) * np.int64(n) + np.maximum(i, j)


def _among(keys: Ints, ordered: Ints) -> Bools:
    """Whether keys are in an ascending list."""
    if len(ordered) == 0:
        return np.zeros(len(keys), dtype=bool)
    place = np.minimum(np.searchsorted(ordered, keys), len(ordered) - 1)
    return np.asarray(ordered[place] == keys)


def _apex(h: Ints) -> Ints:
    """Halfedge whose tail is opposite, in the same face."""
    return h - h % 3 + (h + 2) % 3


def _faces_up(corners: Floats, normal: Floats) -> Bools:
    """Whether triangles have an area vector near the direction of given normals."""
    own = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    size = np.linalg.norm(own, axis=1) * np.linalg.norm(normal, axis=1)
    return np.asarray((np.einsum("fi,fi->f", own, normal) > FLAT * size) & (size > 0))


def _one_a_face(f: Ints, g: Ints, excess: Floats, n_faces: int) -> Bools:
    """Edges of the largest excess in both of their faces."""
    rank = np.zeros(len(excess), dtype=np.int64)
    rank[np.argsort(-excess, kind="stable")] = np.arange(len(excess))
    first = np.full(n_faces, len(excess))
    np.minimum.at(first, f, rank)
    np.minimum.at(first, g, rank)
    return np.asarray((first[f] == rank) & (first[g] == rank))

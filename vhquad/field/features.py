"""Crease edges: found by the angle between faces, or given; dropped where no quad fits."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from vhquad.errors import ConfigError, MeshError
from vhquad.field.matching import MatchedField
from vhquad.field.sharpness import LEAST_AROUND, is_sudden
from vhquad.mesh.triangle import TriMesh, next_halfedge

__all__ = [
    "crease_halfedges",
    "dihedral_angles",
    "drop_short_creases",
    "find_creases",
    "hopeless_creases",
    "sharp_edges",
]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]


def dihedral_angles(mesh: TriMesh) -> Floats:
    """Angle between the normals of an edge's two faces, in [0, pi], 0 on boundaries; (ne,)."""
    either = mesh.edge_halfedges.max(axis=1)
    return np.asarray(np.abs(mesh.dihedral_angles[either]))


def sharp_edges(mesh: TriMesh, degrees: float) -> Ints:
    """All edges sharper than an angle; (k,) edge indices."""
    return _above(dihedral_angles(mesh), degrees)


def _above(angles: Floats, degrees: float) -> Ints:
    if not 0.0 < degrees <= 180.0:
        raise ConfigError(f"a crease angle lies between 0 and 180 degrees, not at {degrees}")
    return np.flatnonzero(angles > np.radians(degrees))


def find_creases(mesh: TriMesh, degrees: float = 40.0, shortest: float = 0.0) -> Ints:
    """Creases: chains of sharp edges that bend the surface all at once, if long enough.

    Sharp edges of noise and of round folds are no creases, see ``vhquad.field.sharpness``.

    Parameters
    ----------
    mesh : TriMesh
    degrees : float
        Least angle between the normals of the two faces.
    shortest : float
        Connected pieces whose edges sum to less are left out.

    Returns
    -------
    (k, 2) int64
        Vertex pairs (lower, higher), sorted.
    """
    angles = dihedral_angles(mesh)
    edges = _above(angles, degrees)
    edges = edges[is_sudden(mesh, edges, angles[edges], LEAST_AROUND * np.radians(degrees))]
    return drop_short_creases(mesh, mesh.edges[edges], shortest)


def drop_short_creases(mesh: TriMesh, pairs: Ints, shortest: float) -> Ints:
    """The pairs whose connected piece is at least ``shortest`` long."""
    label = crease_pieces(mesh, pairs)
    return pairs[piece_lengths(mesh, pairs, label)[label] >= shortest]


def crease_pieces(mesh: TriMesh, pairs: Ints) -> Ints:
    """Label of the connected piece of each crease edge; (k,)."""
    shape = (mesh.n_vertices, mesh.n_vertices)
    graph = coo_matrix((np.ones(len(pairs), dtype=np.int8), (pairs[:, 0], pairs[:, 1])), shape)
    label = connected_components(graph, directed=False)[1][pairs[:, 0]]
    return np.unique(label, return_inverse=True)[1].astype(np.int64)


def piece_lengths(mesh: TriMesh, pairs: Ints, label: Ints) -> Floats:
    """Total edge length of each piece."""
    span = mesh.vertices[pairs[:, 1]] - mesh.vertices[pairs[:, 0]]
    return np.bincount(label, np.linalg.norm(span, axis=1)).astype(np.float64)


def crease_halfedges(mesh: TriMesh, creases: ArrayLike | None) -> Bools:
    """Both halfedges of every crease edge; (3m,) bool. Boundary edges among them are ignored.

    Parameters
    ----------
    mesh : TriMesh
    creases : (k, 2) array_like of int, or None
        Vertex pairs in any order.

    Raises
    ------
    MeshError
        If a pair is no edge of the mesh.
    """
    flag = np.zeros(3 * mesh.n_faces, dtype=bool)
    pairs = np.zeros((0, 2), np.int64) if creases is None else np.asarray(creases)
    if pairs.size == 0:
        return flag
    if pairs.ndim != 2 or pairs.shape[1] != 2 or not np.issubdtype(pairs.dtype, np.integer):
        raise MeshError(f"crease edges must be integers of shape (k, 2), not {pairs.shape}")
    edges = mesh.edges
    known = edges[:, 0] * np.int64(mesh.n_vertices) + edges[:, 1]
    wanted = pairs.min(axis=1).astype(np.int64) * mesh.n_vertices + pairs.max(axis=1)
    place = np.minimum(np.searchsorted(known, wanted), len(known) - 1)
    bad = np.flatnonzero((known[place] != wanted) | (pairs < 0).any(axis=1))
    if bad.size:
        i, j = pairs[bad[0]]
        raise MeshError(
            f"{bad.size} crease edges are no edges of the mesh; "
            f"the first would join vertices {i} and {j}"
        )
    sharp = np.zeros(mesh.n_edges, dtype=bool)
    sharp[place] = True
    return np.asarray(sharp[mesh.halfedge_edge] & (mesh.twin >= 0))


def hopeless_creases(matched: MatchedField, shortest: float) -> Bools:
    """Creases to drop because a sector between them has room for no quad; (3m,) bool.

    Of the two edges beside such a sector the flatter crease goes, and whatever that leaves of its
    piece if it is short.

    Parameters
    ----------
    matched : MatchedField
    shortest : float
        Least length of a piece that lost an edge.
    """
    mesh = matched.mesh
    crease = matched.feature & (mesh.twin >= 0)
    low = matched.sector_is_feature & (matched.sector_quads < 1)
    dropped = np.zeros(mesh.n_edges, dtype=bool)
    if not (low.any() and crease.any()):
        return dropped[mesh.halfedge_edge]
    sharpness = dihedral_angles(mesh)[mesh.halfedge_edge]
    h = np.flatnonzero(crease)
    sector = np.concatenate([matched.corner_sector[h], matched.corner_sector[next_halfedge(h)]])
    beside = np.concatenate([h, h])
    order = np.argsort(sharpness[beside], kind="stable")
    found, first = np.unique(sector[order], return_index=True)
    flatter = beside[order][first[low[found]]]
    dropped[mesh.halfedge_edge[flatter]] = True

    left = np.zeros(mesh.n_edges, dtype=bool)
    left[mesh.halfedge_edge[h]] = True
    left &= ~dropped
    edges = np.flatnonzero(left)
    if edges.size:
        pairs = mesh.edges[edges]
        label = crease_pieces(mesh, pairs)
        hurt = np.isin(pairs, mesh.edges[dropped]).any(axis=1)
        loses = np.bincount(label, hurt) > 0
        loses &= piece_lengths(mesh, pairs, label) < shortest
        dropped[edges[loses[label]]] = True
    return dropped[mesh.halfedge_edge]

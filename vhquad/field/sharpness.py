"""Which sharp edges are creases, and which are noise or the steps of a round fold.

The dihedral angle of one edge says little on a scan or a coarse organic mesh. A true crease bends
the surface all at once: the angle between the mean normals of its two sides, over a few faces, is
the angle of the edge itself. On noise the sides agree although the edge is sharp (the edge bends
more than the surface around it); on a round fold the sides differ more than any one edge bends.
Whole chains are judged, from one branching to the next, so that no crease is torn by an odd edge.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from vhquad.mesh.triangle import TriMesh

__all__ = ["LEAST_AROUND", "chain_labels", "is_sudden", "side_angles"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

REACH = 1.5  # of the neighbourhood, in mean lengths of the edges around
LEAST_AROUND = 0.85
"""Of the angle that a sharp edge has at least: by so much its two sides must differ."""
SHARE = (0.85, 1.2)  # of the bend that the edge itself may take on a crease


def is_sudden(mesh: TriMesh, edges: Ints, angle: Floats, least: float) -> Bools:
    """Which of some edges lie on chains that bend the surface all at once; (k,).

    Parameters
    ----------
    mesh : TriMesh
    edges : (k,) int64
        Inner edges that are sharp.
    angle : (k,) float64
        Their angles between the normals, radians.
    least : float
        Least angle between the sides of a chain.
    """
    if edges.size == 0:
        return np.zeros(0, dtype=bool)
    pairs = mesh.edges[edges]
    around = side_angles(mesh, edges)
    share = angle / np.maximum(around, 1e-6)
    label = chain_labels(mesh, pairs)
    length = np.linalg.norm(mesh.vertices[pairs[:, 1]] - mesh.vertices[pairs[:, 0]], axis=1)
    typical = _weighted_medians(label, share, length)
    good = (typical > SHARE[0]) & (typical < SHARE[1])
    good &= _weighted_medians(label, around, length) > least
    return np.asarray(good[label])


def chain_labels(mesh: TriMesh, pairs: Ints) -> Ints:
    """Chain of each edge: edges that follow each other at vertices where no third one joins; (k,).

    Parameters
    ----------
    mesh : TriMesh
    pairs : (k, 2) int64
    """
    k = len(pairs)
    degree = np.bincount(pairs.reshape(-1), minlength=mesh.n_vertices)
    ends, edge = pairs.T.reshape(-1), np.tile(np.arange(k), 2)
    order = np.argsort(ends, kind="stable")
    ends, edge = ends[order], edge[order]
    meet = np.flatnonzero((ends[1:] == ends[:-1]) & (degree[ends[1:]] == 2))
    links = coo_matrix((np.ones(len(meet), dtype=np.int8), (edge[meet], edge[meet + 1])), (k, k))
    return connected_components(links, directed=False)[1].astype(np.int64)


def side_angles(mesh: TriMesh, edges: Ints) -> Floats:
    """Angle between the mean normals of the two sides of inner edges, near by; (k,), radians.

    A face counts for the side towards which its centre lies, if it faces the same way at all.
    """
    h = mesh.edge_halfedges[edges]
    face = h // 3
    own = mesh.face_normals[face]
    start, end = mesh.vertices[mesh.edges[edges]].transpose(1, 0, 2)
    middle = 0.5 * (start + end)
    length = np.linalg.norm(end - start, axis=1, keepdims=True)
    along = np.divide(end - start, length, out=np.zeros_like(start), where=length > 0)
    radius = REACH * mesh.edge_lengths[face].mean(axis=(1, 2))

    centre = mesh.vertices[mesh.faces].mean(axis=1)
    near = cKDTree(centre).query_ball_point(middle, radius)
    count = np.array([len(found) for found in near])
    edge = np.concatenate(
        [np.repeat(np.arange(len(edges)), count), np.tile(np.arange(len(edges)), 2)]
    )
    f = np.concatenate([*(np.asarray(found, dtype=np.int64) for found in near), face.T.reshape(-1)])
    offset = centre[f] - middle[edge]
    into = [np.cross(own[:, 0], along), -np.cross(own[:, 1], along)]
    depth = [np.einsum("ki,ki->k", offset, direction[edge]) for direction in into]
    means: list[Floats] = []
    for side, wins in ((0, depth[0] > depth[1]), (1, depth[1] >= depth[0])):
        normal = mesh.face_normals[f]
        agrees = np.einsum("ki,ki->k", normal, own[edge, side]) > 0
        weight = np.where(wins & agrees, mesh.face_areas[f], 0.0)
        mean = [np.bincount(edge, weight * normal[:, i], len(edges)) for i in range(3)]
        means.append(np.stack(mean, axis=1).astype(np.float64))
    one, two = means
    sine = np.linalg.norm(np.cross(one, two), axis=1)
    return np.asarray(np.arctan2(sine, np.einsum("ki,ki->k", one, two)))


def _weighted_medians(label: Ints, value: Floats, weight: Floats) -> Floats:
    """Weighted median of the values under each label 0, 1, ..."""
    order = np.lexsort((value, label))
    label, value = label[order], value[order]
    total = np.bincount(label, weight[order])
    before = np.concatenate([[0.0], np.cumsum(total)[:-1]])
    half = np.cumsum(weight[order]) - before[label] >= 0.5 * total[label] * (1.0 - 1e-9)
    first = np.flatnonzero(half)[np.unique(label[half], return_index=True)[1]]
    return np.asarray(value[first])

"""Which sharp edges are creases, and which are noise or the steps of a round fold.

The dihedral angle of one edge says little on a scan or a coarse organic mesh. A true crease bends
the surface all at once: the angle between the mean normals of its two sides, over a few faces, is
the angle of the edge itself. On noise the sides agree although the edge is sharp (the edge bends
more than the surface around it); on a round fold the sides differ more than any one edge bends.
Whole chains are judged, from one branching to the next, so that no crease is torn by an odd edge.

What CAD programs export are planes in few long triangles beside fine ones. There the neighbourhood
of an edge says nothing, and a plane for itself.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from vhquad.mesh.closest import ClosestPoints
from vhquad.mesh.planes import plane_labels
from vhquad.mesh.triangle import TriMesh

__all__ = ["LEAST_AROUND", "chain_labels", "is_sudden", "side_angles"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

REACH = 1.5  # of the neighbourhood, in mean lengths of the edges around
LEAST_AROUND = 0.85
"""Of the angle that a sharp edge has at least: by so much its two sides must differ."""
ROUNDEST = np.radians(65)  # more than an edge of a round fold of planar strips: six go round
PROBES = (0.25, 0.5, 0.75)  # of an edge, where it is asked whether its sides are planar
ON_PLANE = 1e-3  # of the reach: how far from a plane a point is still on it
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

    Where a side is planar, its own normal is taken for the mean: the triangles of a plane are as
    long as its borders are far apart, and what is as near as they are long may be anything.
    """
    face = mesh.edge_halfedges[edges] // 3
    own = mesh.face_normals[face]
    ends = mesh.vertices[mesh.edges[edges]]
    span = ends[:, 1] - ends[:, 0]
    length = np.linalg.norm(span, axis=1, keepdims=True)
    along = np.divide(span, length, out=np.zeros_like(span), where=length > 0)
    into = np.stack([np.cross(own[:, 0], along), -np.cross(own[:, 1], along)], axis=1)
    planar = _are_planar(mesh, edges, face, into)
    size = np.where(planar, 0.0, mesh.edge_lengths[face].mean(axis=2))
    radius = REACH * size.sum(axis=1) / np.maximum((~planar).sum(axis=1), 1)
    means = _mean_normals(mesh, face, ends.mean(axis=1), into, radius)
    one, two = np.where(planar[..., None], own, means).transpose(1, 0, 2)
    sine = np.linalg.norm(np.cross(one, two), axis=1)
    return np.asarray(np.arctan2(sine, np.einsum("ki,ki->k", one, two)))


def _mean_normals(
    mesh: TriMesh, face: Ints, middle: Floats, into: Floats, radius: Floats
) -> Floats:
    """Normals of both sides of edges times area, summed over the faces near by; (k, 2, 3).

    A face counts for the side towards which its centre lies, if it faces the same way at all.

    Parameters
    ----------
    mesh : TriMesh
    face : (k, 2) int64
        The faces beside each edge; they count always.
    middle : (k, 3) float64
    into : (k, 2, 3) float64
        From each edge into its faces.
    radius : (k,) float64
        Of the neighbourhood around each middle.
    """
    k = len(face)
    own = mesh.face_normals[face]
    centre = mesh.vertices[mesh.faces].mean(axis=1)
    near = cKDTree(centre).query_ball_point(middle, radius)
    count = np.array([len(found) for found in near])
    edge = np.concatenate([np.repeat(np.arange(k), count), np.tile(np.arange(k), 2)])
    f = np.concatenate([*(np.asarray(found, dtype=np.int64) for found in near), face.T.reshape(-1)])
    offset = centre[f] - middle[edge]
    depth = np.einsum("ki,ksi->sk", offset, into[edge])
    means = np.zeros((k, 2, 3))
    for side, wins in ((0, depth[0] > depth[1]), (1, depth[1] >= depth[0])):
        normal = mesh.face_normals[f]
        agrees = np.einsum("ki,ki->k", normal, own[edge, side]) > 0
        weight = np.where(wins & agrees, mesh.face_areas[f], 0.0)
        for i in range(3):
            means[:, side, i] = np.bincount(edge, weight * normal[:, i], k)
    return means


def _are_planar(mesh: TriMesh, edges: Ints, face: Ints, into: Floats) -> Bools:
    """Which sides of edges are planar for farther than the mesh has detail, or can only be so.

    (k, 2).
    """
    label = plane_labels(mesh)
    some = label[face] >= 0
    turn = np.abs(mesh.dihedral_angles[mesh.edge_halfedges[edges, 0]])
    planar = np.repeat((some.all(axis=1) & (turn > ROUNDEST))[:, None], 2, axis=1)
    edge, side = np.nonzero(some & ~planar)
    if len(edge) == 0:
        return planar
    ends = mesh.vertices[mesh.edges[edges[edge]]]
    reach = REACH * float(np.median(mesh.edge_lengths))
    own = label[face[edge, side]]
    planes = np.isin(label, own)
    surface, label = ClosestPoints(mesh.submesh(planes)[0]), label[planes]
    votes = np.zeros(len(edge), dtype=np.int64)
    for share in PROBES:
        at = (1.0 - share) * ends[:, 0] + share * ends[:, 1] + reach * into[edge, side]
        hits = surface.query(at)
        there = np.linalg.norm(hits.point - at, axis=1) < ON_PLANE * reach
        votes += there & (label[hits.face] == own)
    planar[edge, side] = votes > len(PROBES) // 2
    return planar


def _weighted_medians(label: Ints, value: Floats, weight: Floats) -> Floats:
    """Weighted median of the values under each label 0, 1, ..."""
    order = np.lexsort((value, label))
    label, value = label[order], value[order]
    total = np.bincount(label, weight[order])
    before = np.concatenate([[0.0], np.cumsum(total)[:-1]])
    half = np.cumsum(weight[order]) - before[label] >= 0.5 * total[label] * (1.0 - 1e-9)
    first = np.flatnonzero(half)[np.unique(label[half], return_index=True)[1]]
    return np.asarray(value[first])

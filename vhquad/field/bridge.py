"""Bridging of crease networks: short gaps where an edge is too blunt or a remesher cut a corner."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix, csr_matrix
from scipy.sparse.csgraph import dijkstra

from vhquad.field.features import dihedral_angles
from vhquad.mesh.triangle import TriMesh

__all__ = ["bridge_gaps"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

SHARP = np.radians(30.0)  # edges this sharp or sharper are the cheapest way across a gap
BLUNT = 2.0  # times as long seems a flat edge
DETOUR = 4.0  # a gap is worth closing if the way round on creases is so many times as long


def bridge_gaps(mesh: TriMesh, pairs: Ints, reach: float) -> Ints:
    """Crease edges with the gaps between loose ends and other creases closed, the shortest first.

    A bridge runs along edges of the mesh from a vertex with one crease edge to another crease
    vertex, touches no crease on its way and goes on in the crease's direction (by less than a right
    angle off).

    Parameters
    ----------
    mesh : TriMesh
    pairs : (k, 2) int64
        Crease edges as vertex pairs.
    reach : float
        Longest gap, in units of the mesh.

    Returns
    -------
    (j, 2) int64
        The same pairs, with others behind them.
    """
    pairs = np.asarray(pairs, dtype=np.int64).reshape(-1, 2)
    graph = _ways(mesh)
    refused: set[int] = set()
    while True:
        degree = np.bincount(pairs.ravel(), minlength=mesh.n_vertices)
        ends = np.array([v for v in np.flatnonzero(degree == 1) if v not in refused], np.int64)
        if len(ends) == 0:
            return pairs
        found = [_bridge(mesh, graph, pairs, degree, int(end), reach) for end in ends]  # few
        made = sorted((length, path) for length, path in found if path)
        refused |= {int(end) for end, (_, path) in zip(ends, found, strict=True) if not path}
        taken = np.zeros(mesh.n_vertices, dtype=bool)
        added = []
        for _, path in made:
            if not taken[path].any():
                taken[path] = True
                added.append(np.stack([path[:-1], path[1:]], axis=1))
        if not added:
            return pairs
        pairs = np.concatenate([pairs, *added])


def _ways(mesh: TriMesh) -> csr_matrix:
    """Edges as a graph; lengths, longer where the surface does not bend."""
    i, j = mesh.edges.T
    length = np.linalg.norm(mesh.vertices[i] - mesh.vertices[j], axis=1)
    flat = 1.0 - np.minimum(dihedral_angles(mesh) / SHARP, 1.0)
    return coo_matrix(
        (length * (1.0 + (BLUNT - 1.0) * flat), (i, j)), (mesh.n_vertices,) * 2
    ).tocsr()


def _bridge(
    mesh: TriMesh, graph: csr_matrix, pairs: Ints, degree: Ints, end: int, reach: float
) -> tuple[float, list[int]]:
    """Length and vertices of the best bridge from a loose end; no vertices if there is none."""
    start = np.array([end])
    ways, befores = dijkstra(
        graph, directed=False, indices=start, limit=BLUNT * reach, return_predecessors=True
    )
    away, before = ways[0], befores[0]
    span = np.linalg.norm(mesh.vertices[pairs[:, 0]] - mesh.vertices[pairs[:, 1]], axis=1)
    creases = coo_matrix((span, (pairs[:, 0], pairs[:, 1])), (mesh.n_vertices,) * 2).tocsr()
    limit = DETOUR * BLUNT * reach
    round_way = dijkstra(creases, directed=False, indices=start, limit=limit)[0]
    other = pairs[(pairs == end).any(axis=1)][0].sum() - end
    ahead = mesh.vertices[end] - mesh.vertices[other]
    goals = np.flatnonzero((degree > 0) & (away < np.inf) & (round_way > DETOUR * away))
    for goal in goals[np.argsort(away[goals], kind="stable")]:  # few
        path = [int(goal)]
        while path[-1] != end:
            path.append(int(before[path[-1]]))
        if (degree[path[1:-1]] > 0).any():
            continue
        step = mesh.vertices[path[-2]] - mesh.vertices[end]
        p = mesh.vertices[path]
        length = float(np.linalg.norm(np.diff(p, axis=0), axis=1).sum())
        if step @ ahead > 0 and length <= reach:
            return length, path
    return 0.0, []

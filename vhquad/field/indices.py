"""Moving quarter indices along paths of edges, and relaxing the crosses around them.

Adding a quarter turn to the matching of one edge raises ``quads`` at one of its ends and lowers it
at the other; along a path of edges only the two ends of the path change. So no field solver has to
be persuaded to move a singularity: the matchings say where it is. The crosses around are then
relaxed with the matchings held fixed, a linear least-squares problem in their angles (the system of
Bommes, Zimmer, Kobbelt 2009, "Mixed-integer quadrangulation", section 3, its integers given).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix, diags
from scipy.sparse.csgraph import dijkstra

from vhquad.field.dual import dirichlet, dual_weights
from vhquad.field.matching import QUARTER, MatchedField
from vhquad.geometry.sparse import SymmetricFactor
from vhquad.mesh.triangle import next_halfedge

__all__ = ["move_indices", "moved_and_relaxed", "near_pairs", "relax", "sector_graph", "trace"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

CHUNK = 64


def move_indices(matched: MatchedField, paths: list[Ints]) -> MatchedField:
    """Along each path of sectors, raise ``quads`` of the first by one and lower the last's.

    Parameters
    ----------
    matched : MatchedField
    paths : list of (p,) int64
        Sectors, each joined to the next by a non-feature edge.
    """
    halfedge = _sector_links(matched, np.arange(1, len(matched.jump) + 1))
    jump = matched.jump.copy()
    for path in paths:
        h = np.asarray(halfedge[path[:-1], path[1:]]).reshape(-1).astype(np.int64) - 1
        jump[h] += QUARTER
        jump[matched.mesh.twin[h]] -= QUARTER
    return replace(matched, jump=jump)


def relax(matched: MatchedField, free: Bools) -> MatchedField:
    """Turn the crosses of the free faces so that the jumps are least, matchings unchanged.

    Feature faces keep theirs in any case.

    Parameters
    ----------
    matched : MatchedField
    free : (m,) bool
    """
    mesh = matched.mesh
    face = np.flatnonzero(free & ~matched.feature.reshape(-1, 3).any(axis=1))
    if face.size == 0:
        return matched
    weight = np.where(matched.feature, 0.0, dual_weights(mesh))
    # d(energy)/d(turn of f) of sum over edges w (jump + turn_g - turn_f)^2, halved
    pull = (weight * matched.jump).reshape(-1, 3).sum(axis=1)[face]
    matrix = dirichlet(mesh, weight, np.ones(len(weight)))[face][:, face]
    scale = matrix.diagonal().mean()
    turn = np.zeros(mesh.n_faces)
    turn[face] = SymmetricFactor(matrix + diags(np.full(len(face), 1e-9 * scale))).solve(pull)
    per_halfedge = np.repeat(turn, 3)
    change = np.where(matched.feature, 0.0, per_halfedge[mesh.twin] - per_halfedge)
    return replace(matched, angle=matched.angle + turn, jump=matched.jump + change)


def moved_and_relaxed(
    matched: MatchedField, paths: list[Ints], graph: csr_matrix, distance: float
) -> MatchedField:
    """Indices moved along paths, and the crosses around them relaxed."""
    if not paths:
        return matched
    moved = move_indices(matched, paths)
    sectors = np.unique(np.concatenate(paths))
    far = dijkstra(graph, indices=sectors, limit=distance, min_only=True)
    near = np.isfinite(far)[matched.corner_sector].reshape(-1, 3).any(axis=1)
    return relax(moved, np.asarray(near))


def sector_graph(matched: MatchedField, size: Floats | None) -> csr_matrix:
    """The graph of sectors with the lengths of its edges, in sizes if there are any."""
    length = matched.mesh.edge_lengths.reshape(-1)
    if size is not None:
        here = np.repeat(1.0 / size, 3)
        length = length * np.where(matched.feature, here, 0.5 * (here + here[matched.mesh.twin]))
    return _sector_links(matched, length)


def near_pairs(graph: csr_matrix, start: Bools, end: Bools, distance: float) -> list[Ints]:
    """Shortest paths from sectors of one kind to those of another within a distance, by length."""
    sources, sinks = np.flatnonzero(start), np.flatnonzero(end)
    if sources.size > sinks.size:
        return [path[::-1] for path in near_pairs(graph, end, start, distance)]
    found: list[tuple[float, Ints]] = []
    for first in range(0, len(sources), CHUNK):
        some = sources[first : first + CHUNK]
        far, before = dijkstra(graph, indices=some, limit=distance, return_predecessors=True)
        for row, column in np.argwhere(np.isfinite(far[:, sinks])):
            path = trace(before[row], int(sinks[column]))
            found.append((float(far[row, sinks[column]]), path))
    found.sort(key=lambda pair: pair[0])
    return [path for _, path in found]


def trace(before: NDArray[np.int32], last: int) -> Ints:
    """Path from the root of a tree of predecessors to a node."""
    path = [last]
    while before[path[-1]] >= 0:
        path.append(int(before[path[-1]]))
    return np.array(path[::-1], dtype=np.int64)


def _sector_links(matched: MatchedField, value: NDArray[np.number]) -> csr_matrix:
    """Sectors as a graph: entry (tail, head) of each non-feature halfedge is its value."""
    h = np.flatnonzero(~matched.feature)
    tail, head = matched.corner_sector[h], matched.corner_sector[next_halfedge(h)]
    size = matched.n_sectors
    return csr_matrix((value[h].astype(np.float64), (tail, head)), shape=(size, size))

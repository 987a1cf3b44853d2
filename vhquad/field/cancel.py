"""Moving quarter indices between vertices: cancelling close pairs, and curing impossible vertices.

Adding a quarter turn to the matching of one edge raises ``quads`` at one of its ends and lowers it
at the other; along a path of edges only the two ends of the path change. So a pair of opposite
singularities is cancelled by the path between them, and no field solver has to be persuaded. The
crosses around are then relaxed with the matchings held fixed, a linear least-squares problem in
their angles (the matched form of Bommes, Zimmer, Kobbelt 2009, section 3, periods given).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix, diags
from scipy.sparse.csgraph import dijkstra

from vhquad.field.dual import dirichlet, dual_weights
from vhquad.field.matching import QUARTER, MatchedField
from vhquad.field.smooth import factorized
from vhquad.mesh.triangle import next_halfedge

__all__ = [
    "absorb_at_features",
    "cancel_pairs",
    "cure_low_sectors",
    "low_sectors",
    "move_indices",
    "relax",
]

Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

LEAST_INNER = 3  # fewer quads around an interior vertex would make doublets
WIDEST_CORNER = np.radians(150.0)
LEAST_CORNER = np.radians(50.0)  # of a quad at a feature that takes a singularity
MOST_CORNER = np.radians(130.0)
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
    turn[face] = factorized(matrix + diags(np.full(len(face), 1e-9 * scale)))(pull)
    per_halfedge = np.repeat(turn, 3)
    change = np.where(matched.feature, 0.0, per_halfedge[mesh.twin] - per_halfedge)
    return replace(matched, angle=matched.angle + turn, jump=matched.jump + change)


def cancel_pairs(matched: MatchedField, distance: float, kept: Bools) -> tuple[MatchedField, int]:
    """Cancel opposite singularities closer than a distance along the edges, closest first.

    Parameters
    ----------
    matched : MatchedField
    distance : float
    kept : (s,) bool
        Sectors that are to stay as they are (true corners).

    Returns
    -------
    matched : MatchedField
    count : int
        Pairs cancelled.
    """
    lacking = np.where(matched.sector_is_feature, 2, 4) - matched.sector_quads
    lacking[kept] = 0
    paths = []
    for path in _near_pairs(matched, lacking > 0, lacking < 0, distance):
        first, last = path[0], path[-1]
        while lacking[first] > 0 > lacking[last]:
            lacking[first] -= 1
            lacking[last] += 1
            paths.append(path)
    return _moved(matched, paths, distance), len(paths)


def absorb_at_features(matched: MatchedField, distance: float) -> tuple[MatchedField, int]:
    """Move singularities on to a boundary or crease nearer than a distance, where they fit.

    In the quads to come a singularity is at least one quad away from a feature that it does not
    lie on, so one much closer would spread the map there. A sector may take it if its quads then
    have corners between 50 and 130 degrees, and if no other singular vertex of a feature is near.

    Parameters
    ----------
    matched : MatchedField
    distance : float

    Returns
    -------
    matched : MatchedField
    count : int
        Quarter indices moved.
    """
    quads, feature = matched.sector_quads.copy(), matched.sector_is_feature
    angle = np.bincount(matched.corner_sector, matched.mesh.corner_angles.reshape(-1))
    roomy = feature & (quads == 2) & (angle >= 3 * LEAST_CORNER)
    tight = feature & (quads == 2) & (angle <= MOST_CORNER)
    found = [(path, 1) for path in _near_pairs(matched, roomy, ~feature & (quads > 4), distance)]
    found += [(path, -1) for path in _near_pairs(matched, tight, ~feature & (quads < 4), distance)]
    place = matched.mesh.vertices[matched.sector_vertex]
    taken = list(np.flatnonzero(feature & (quads != 2)))
    paths = []
    for path, change in found:
        sink, source = path[0], path[-1]
        gap = np.linalg.norm(place[taken] - place[sink], axis=1)
        if quads[source] * change <= 4 * change or (gap < distance).any():
            continue
        quads[sink] += change
        quads[source] -= change
        taken.append(sink)
        paths.append(path if change > 0 else path[::-1])
    return _moved(matched, paths, distance), len(paths)


def cure_low_sectors(matched: MatchedField, distance: float) -> tuple[MatchedField, int]:
    """Give every sector the fewest quads it needs, taken from vertices near by.

    An interior vertex needs three, on creases too, since two quads around it could not be convex:
    an index of 1/2 becomes two of 1/4. A boundary or crease sector needs as many as keep their
    corners below 150 degrees.

    Parameters
    ----------
    matched : MatchedField
    distance : float
        Wanted between the new singularities.

    Returns
    -------
    matched : MatchedField
    count : int
        Quarter indices moved.
        What could not be had from the vertices there are is left; split some edges and ask again.
    """
    quads = matched.sector_quads.copy()
    least = _least_quads(matched)
    low = np.flatnonzero(quads < least)
    graph = _sector_links(matched, matched.mesh.edge_lengths.reshape(-1))
    paths = []
    for sector in low:  # few
        far, before = dijkstra(graph, indices=np.array([sector]), return_predecessors=True)
        for _ in range(int(least[sector] - quads[sector])):
            giver = _giver(matched, quads, least, far[0], distance)
            if giver < 0:
                break
            paths.append(_trace(before[0], giver))
            quads[sector] += 1
            quads[giver] -= 1
    return _moved(matched, paths, distance), len(paths)


def low_sectors(matched: MatchedField) -> Bools:
    """Which sectors have fewer quads than they need; (s,)."""
    return np.asarray(matched.sector_quads < _least_quads(matched))


def _least_quads(matched: MatchedField) -> Ints:
    """Quads that each sector needs at least; (s,)."""
    feature, vertex = matched.sector_is_feature, matched.sector_vertex
    angle = np.bincount(matched.corner_sector, matched.mesh.corner_angles.reshape(-1))
    fitting = np.maximum(np.ceil(angle / WIDEST_CORNER - 1e-9), 1.0).astype(np.int64)
    least = np.where(feature, fitting, LEAST_INNER)

    # An inner vertex on creases has several sectors, which must make up for each other.
    quads = np.maximum(matched.sector_quads, least)
    total = np.bincount(vertex, quads, matched.mesh.n_vertices)
    short = feature & ~matched.mesh.is_boundary_vertex[vertex]
    short &= total[vertex] < LEAST_INNER
    for v in np.unique(vertex[short]):  # few
        sectors = np.flatnonzero(vertex == v)
        widest = sectors[np.argmax(angle[sectors] / quads[sectors])]
        least[widest] = quads[widest] + LEAST_INNER - int(total[v])
    return least


def _near_pairs(matched: MatchedField, start: Bools, end: Bools, distance: float) -> list[Ints]:
    """Shortest paths from sectors of one kind to those of another within a distance, by length."""
    graph = _sector_links(matched, matched.mesh.edge_lengths.reshape(-1))
    sources, sinks = np.flatnonzero(start), np.flatnonzero(end)
    if sources.size > sinks.size:
        return [path[::-1] for path in _near_pairs(matched, end, start, distance)]
    found: list[tuple[float, Ints]] = []
    for first in range(0, len(sources), CHUNK):
        some = sources[first : first + CHUNK]
        far, before = dijkstra(graph, indices=some, limit=distance, return_predecessors=True)
        for row, column in np.argwhere(np.isfinite(far[:, sinks])):
            path = _trace(before[row], int(sinks[column]))
            found.append((float(far[row, sinks[column]]), path))
    found.sort(key=lambda pair: pair[0])
    return [path for _, path in found]


def _moved(matched: MatchedField, paths: list[Ints], distance: float) -> MatchedField:
    """Indices moved along paths, and the crosses around them relaxed."""
    if not paths:
        return matched
    moved = move_indices(matched, paths)
    return relax(moved, _around(moved, np.unique(np.concatenate(paths)), distance))


def _giver(
    matched: MatchedField, quads: Ints, least: Ints, far: NDArray[np.float64], distance: float
) -> int:
    """The best sector to take a quad from: over-full and near by, else flat; -1 if none."""
    plain = ~matched.sector_is_feature
    # Sectors of a crease share what their vertex needs: they do not give.
    able_at_all = np.isfinite(far) & (
        plain | matched.mesh.is_boundary_vertex[matched.sector_vertex]
    )
    near = far <= 2.0 * distance
    for able, preferred in (
        (near & (quads > np.where(plain, 4, np.maximum(least, 2))), 0.0),
        (plain & (quads == 4), 0.5 * distance),
        (quads > least, 0.0),
    ):
        choice = np.flatnonzero(able & able_at_all & (far > 0))
        if choice.size:
            return int(choice[np.argmin(np.abs(far[choice] - preferred))])
    return -1


def _trace(before: NDArray[np.int32], last: int) -> Ints:
    """Path from the root of a tree of predecessors to a node."""
    path = [last]
    while before[path[-1]] >= 0:
        path.append(int(before[path[-1]]))
    return np.array(path[::-1], dtype=np.int64)


def _around(matched: MatchedField, sectors: Ints, distance: float) -> Bools:
    """Faces with a corner within a distance of some sectors."""
    graph = _sector_links(matched, matched.mesh.edge_lengths.reshape(-1))
    far = dijkstra(graph, indices=sectors, limit=distance, min_only=True)
    near = np.isfinite(far)
    return np.asarray(near[matched.corner_sector].reshape(-1, 3).any(axis=1))


def _sector_links(matched: MatchedField, value: NDArray[np.number]) -> csr_matrix:
    """Sectors as a graph: entry (tail, head) of each non-feature halfedge is its value."""
    h = np.flatnonzero(~matched.feature)
    tail, head = matched.corner_sector[h], matched.corner_sector[next_halfedge(h)]
    size = matched.n_sectors
    return csr_matrix((value[h].astype(np.float64), (tail, head)), shape=(size, size))

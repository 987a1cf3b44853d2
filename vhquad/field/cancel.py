"""Singularities made fit for quads: close pairs cancelled, impossible vertices cured.

All of it by moving quarter indices along edges, see ``vhquad.field.indices``.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.csgraph import dijkstra

from vhquad.field.indices import moved_and_relaxed, near_pairs, sector_graph, trace
from vhquad.field.matching import MatchedField

__all__ = ["absorb_at_features", "cancel_pairs", "cure_low_sectors", "low_sectors"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

LEAST_INNER = 3  # fewer quads around an interior vertex would make doublets
LEAST_SEAM = 2  # and as many in the mirror
WIDEST_CORNER = np.radians(150.0)
LEAST_CORNER = np.radians(50.0)  # of a quad at a feature that takes a singularity
MOST_CORNER = np.radians(130.0)


def cancel_pairs(
    matched: MatchedField, distance: float, kept: Bools, size: Floats | None = None
) -> tuple[MatchedField, int]:
    """Cancel opposite singularities closer than a distance along the edges, closest first.

    Parameters
    ----------
    matched : MatchedField
    distance : float
    kept : (s,) bool
        Sectors that are to stay as they are (true corners).
    size : (m,) float64, optional
        The length at each face that distances are measured by; 1 if not given.

    Returns
    -------
    matched : MatchedField
    count : int
        Pairs cancelled.
    """
    lacking = np.where(matched.sector_is_feature, 2, 4) - matched.sector_quads
    lacking[kept] = 0
    graph = sector_graph(matched, size)
    paths = []
    for path in near_pairs(graph, lacking > 0, lacking < 0, distance):
        first, last = path[0], path[-1]
        while lacking[first] > 0 > lacking[last]:
            lacking[first] -= 1
            lacking[last] += 1
            paths.append(path)
    return moved_and_relaxed(matched, paths, graph, distance), len(paths)


def absorb_at_features(
    matched: MatchedField, distance: float, size: Floats | None = None
) -> tuple[MatchedField, int]:
    """Move singularities on to a boundary or crease nearer than a distance, where they fit.

    In the quads to come a singularity is at least one quad away from a feature that it does not
    lie on, so one much closer would spread the map there. A sector may take it if its quads then
    have corners between 50 and 130 degrees, and if no other singular vertex of a feature is near.

    Parameters
    ----------
    matched : MatchedField
    distance : float
    size : (m,) float64, optional
        As in :func:`cancel_pairs`.

    Returns
    -------
    matched : MatchedField
    count : int
        Quarter indices moved.
    """
    quads, feature = matched.sector_quads.copy(), matched.sector_is_feature
    angle = np.bincount(matched.corner_sector, matched.mesh.corner_angles.reshape(-1))
    roomy = feature & (quads == 2) & (angle >= 3 * LEAST_CORNER)
    tight = feature & (quads == 2) & (angle <= MOST_CORNER) & ~matched.sector_in_seam
    graph = sector_graph(matched, size)
    found = [(path, 1) for path in near_pairs(graph, roomy, ~feature & (quads > 4), distance)]
    found += [(path, -1) for path in near_pairs(graph, tight, ~feature & (quads < 4), distance)]
    place = matched.mesh.vertices[matched.sector_vertex]
    gap_wanted = np.full(matched.n_sectors, distance)
    if size is not None:
        gap_wanted[matched.corner_sector] *= np.repeat(size, 3)
    taken = list(np.flatnonzero(feature & (quads != 2)))
    paths = []
    for path, change in found:
        sink, source = path[0], path[-1]
        gap = np.linalg.norm(place[taken] - place[sink], axis=1)
        if quads[source] * change <= 4 * change or (gap < gap_wanted[sink]).any():
            continue
        quads[sink] += change
        quads[source] -= change
        taken.append(sink)
        paths.append(path if change > 0 else path[::-1])
    return moved_and_relaxed(matched, paths, graph, distance), len(paths)


def cure_low_sectors(
    matched: MatchedField, distance: float, size: Floats | None = None
) -> tuple[MatchedField, int]:
    """Give every sector the fewest quads it needs, taken from vertices near by.

    An interior vertex needs three, on creases too, since two quads around it could not be convex:
    an index of 1/2 becomes two of 1/4. A boundary or crease sector needs as many as keep their
    corners below 150 degrees, one within a seam two, which its mirror image makes four.

    Parameters
    ----------
    matched : MatchedField
    distance : float
        Wanted between the new singularities.
    size : (m,) float64, optional
        As in :func:`cancel_pairs`.

    Returns
    -------
    matched : MatchedField
    count : int
        Quarter indices moved. What could not be had from the vertices there are is left: split
        some edges and ask again.
    """
    quads = matched.sector_quads.copy()
    least = _least_quads(matched)
    low = np.flatnonzero(quads < least)
    graph = sector_graph(matched, size)
    paths = []
    for sector in low:  # few
        far, before = dijkstra(graph, indices=np.array([sector]), return_predecessors=True)
        for _ in range(int(least[sector] - quads[sector])):
            giver = _giver(matched, quads, least, far[0], distance)
            if giver < 0:
                break
            paths.append(trace(before[0], giver))
            quads[sector] += 1
            quads[giver] -= 1
    return moved_and_relaxed(matched, paths, graph, distance), len(paths)


def low_sectors(matched: MatchedField) -> Bools:
    """Which sectors have fewer quads than they need; (s,)."""
    return np.asarray(matched.sector_quads < _least_quads(matched))


def _least_quads(matched: MatchedField) -> Ints:
    """Quads that each sector needs at least; (s,)."""
    feature, vertex = matched.sector_is_feature, matched.sector_vertex
    angle = np.bincount(matched.corner_sector, matched.mesh.corner_angles.reshape(-1))
    fitting = np.maximum(np.ceil(angle / WIDEST_CORNER - 1e-9), 1.0).astype(np.int64)
    fitting = np.where(matched.sector_in_seam, np.maximum(fitting, LEAST_SEAM), fitting)
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


def _giver(matched: MatchedField, quads: Ints, least: Ints, far: Floats, distance: float) -> int:
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

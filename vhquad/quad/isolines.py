"""The graph of the isolines of an integer-grid map on the surface, as darts around grid points.

Segments of the faces (:mod:`vhquad.quad.segments`) are joined across edges into arcs between grid
points: meetings of segments, pinned vertices, and points where an isoline reaches the boundary.
The boundary itself is a chain of arcs. The graph is embedded whatever the map does; its faces are
squares of the grid wherever the map keeps orientation.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from vhquad.errors import ParametrizationError
from vhquad.mesh.triangle import next_halfedge
from vhquad.quad.grid import GRID, STEP, IntegerGridMap, SettledMap
from vhquad.quad.segments import Meetings, Segments, face_segments, meetings, u_comes_first

__all__ = ["IsolineGraph", "trace_isolines"]

Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class IsolineGraph:
    """Grid points, and arcs between them as pairs of darts (an arc's ends).

    Attributes
    ----------
    point : (d,) int64
        Grid point from which each dart leaves.
    turn : (d,) int64
        The next dart counter-clockwise around the same point.
    across : (d,) int64
        The dart at the other end of the same arc.
    sign : (d,) int64
        1 or -1: orientation of the map where the dart leaves.
    outer : (d,) bool
        Darts that run backward along the boundary: outside lies to their left.
    face : (p,) int64
        A face in which each grid point lies.
    place : (p, 2) int64
        Coordinates of each grid point in that face's chart, in grid cells.
    halfedge : (p,) int64
        Boundary halfedge on which a point lies, else -1.
    vertex : (p,) int64
        Pinned vertex that a point is, else -1.
    """

    point: Ints
    turn: Ints
    across: Ints
    sign: Ints
    outer: Bools
    face: Ints
    place: Ints
    halfedge: Ints
    vertex: Ints


@dataclass(frozen=True, eq=False)
class _Crossings:
    """Numbers of the points where isolines cross edges, by edge, coordinate and level."""

    low: Ints  # (3m, 2) lowest level of each coordinate that crosses the halfedge
    count: Ints  # (3m, 2), 0 unless the halfedge is the lead one of its edge
    start: Ints  # (3m, 2) number of the lowest one
    lead: Bools  # (3m,)


@dataclass(frozen=True, eq=False)
class _Pins:
    """Darts that leave pinned vertices into faces: end ``side`` of segment ``segment`` of c."""

    segment: Ints
    coordinate: Ints
    side: Ints
    vertex: Ints
    sign: Ints
    around: Ints  # increases counter-clockwise around the vertex, > 0


@dataclass(frozen=True, eq=False)
class _Rim:
    """Points on boundary halfedges; darts of the boundary, numbered from 0.

    Point g has darts 3g ahead along the boundary, 3g + 1 inward, 3g + 2 back; then two for each
    pinned boundary vertex, ahead and back.
    """

    halfedge: Ints
    place: Ints
    crossing: Ints  # (g,) where the inward dart starts
    vertex: Ints  # pinned vertex of each dart, -1 for those of the points
    sign: Ints
    ahead: Ints  # the darts ahead of all stops in order,
    behind: Ints  # and the darts back of the stops after them


def trace_isolines(grid_map: IntegerGridMap, settled: SettledMap) -> IsolineGraph:
    """The graph of all isolines of a map in general position.

    Raises
    ------
    ParametrizationError
        If a boundary loop meets no isoline, or the map is degenerate beyond repair.
    """
    mesh = grid_map.mesh
    crossings = _number_crossings(grid_map, settled)
    u, v = (face_segments(settled, mesh.twin, c) for c in (0, 1))
    meet = meetings(settled, crossings.lead, u, v)
    pins = _find_pins(grid_map, settled, crossings.lead, (u, v))
    rim = _walk_rim(grid_map, settled, crossings)

    # Darts: four a meeting, those of pinned vertices, those of the rim. Then crossings of edges.
    n_meet = len(meet.i)
    rim_start = 4 * n_meet + len(pins.segment)
    n_darts = rim_start + len(rim.sign)
    inward = rim_start + 3 * np.arange(len(rim.place)) + 1
    links = [np.stack([n_darts + rim.crossing, inward], axis=1)]
    for c, segments in enumerate((u, v)):
        ends = np.zeros((len(segments.face), 2), dtype=np.int64)
        for side, slot in enumerate((segments.first, segments.last)):
            odd = np.flatnonzero(slot % 2 == 1)
            h = 3 * segments.face[odd] + slot[odd] // 2
            ends[odd, side] = n_darts + _crossing_of(grid_map, crossings, c, h, segments.level[odd])
        mine = np.flatnonzero(pins.coordinate == c)
        ends[pins.segment[mine], pins.side[mine]] = 4 * n_meet + mine
        links.append(_links_along((u, v), meet, c, ends))
    across = _join(np.concatenate(links), n_darts, int(crossings.count.sum()))
    across[rim_start + rim.ahead] = rim_start + rim.behind
    across[rim_start + rim.behind] = rim_start + rim.ahead
    if (across < 0).any():
        raise ParametrizationError("an isoline ends inside the surface: the map is degenerate")
    point, around = _points(settled, n_meet, pins, rim)
    pinned = np.flatnonzero(settled.pinned)
    h = np.maximum(mesh.outgoing[pinned], 0)
    levels = np.stack([u.level[meet.i], v.level[meet.j]], axis=1)
    return IsolineGraph(
        point=point,
        turn=_turns(n_meet, point, around),
        across=across,
        sign=np.concatenate([np.repeat(meet.sign, 4), pins.sign, rim.sign]),
        outer=np.isin(np.arange(n_darts), rim_start + rim.behind),
        face=np.concatenate([u.face[meet.i], h // 3, rim.halfedge // 3]),
        place=np.concatenate([levels, settled.x.reshape(-1, 2)[h] // STEP, rim.place]),
        halfedge=np.concatenate([np.full(n_meet + len(pinned), -1), rim.halfedge]),
        vertex=np.concatenate([np.full(n_meet, -1), pinned, np.full(len(rim.halfedge), -1)]),
    )


def _points(settled: SettledMap, n_meet: int, pins: _Pins, rim: _Rim) -> tuple[Ints, Ints]:
    """Grid point of each dart, and the order of darts around those that are no meetings."""
    pinned = np.flatnonzero(settled.pinned)
    point_of = np.full(len(settled.pinned) + 1, -1, dtype=np.int64)
    point_of[pinned] = n_meet + np.arange(len(pinned))
    number = np.arange(len(rim.sign))
    at_pin = rim.vertex >= 0
    rim_point = np.where(at_pin, point_of[rim.vertex], n_meet + len(pinned) + number // 3)
    # Ahead, inward, back; at pinned vertices the darts inside lie between the other two.
    even = (number - 3 * len(rim.place)) % 2 == 0
    at_end = np.where(even, 0, np.iinfo(np.int64).max)
    around = np.concatenate([pins.around, np.where(at_pin, at_end, number % 3)])
    point = [np.repeat(np.arange(n_meet), 4), point_of[pins.vertex], rim_point]
    return np.concatenate(point), around


# ---- crossings of edges ---------------------------------------------------------------------


def _number_crossings(grid_map: IntegerGridMap, settled: SettledMap) -> _Crossings:
    twin = grid_map.mesh.twin
    h = np.arange(len(twin))
    lead = (twin < 0) | (h < twin)
    z = settled.x.reshape(-1, 2)
    head = z[next_halfedge(h)]
    low = np.minimum(z, head) // STEP + 1  # strictly between: pinned ends do not cross
    high = -((-np.maximum(z, head)) // STEP) - 1
    count = np.where(lead[:, None], np.maximum(high - low + 1, 0), 0)
    start = (np.cumsum(count) - count.reshape(-1)).reshape(-1, 2)
    return _Crossings(low, count, start, lead)


def _crossing_of(
    grid_map: IntegerGridMap, crossings: _Crossings, c: int, halfedge: Ints, level: Ints
) -> Ints:
    """Number of the crossing of a halfedge with the isoline of a level of coordinate c."""
    far = np.flatnonzero(~crossings.lead[halfedge])
    h = halfedge[far]
    r = grid_map.rotation[h] % 4
    coordinate = np.full(len(halfedge), c, dtype=np.int64)
    coordinate[far] = (c + r) % 2
    # In the chart across u becomes u, v, -u, -v for r = 0..3, and v becomes v, -u, -v, u.
    minus = (r >= 2) if c == 0 else ((r == 1) | (r == 2))
    value = level.copy()
    shift = grid_map.translation[h, coordinate[far]] // GRID
    value[far] = np.where(minus, -level[far], level[far]) + shift
    at = halfedge.copy()
    at[far] = grid_map.mesh.twin[h]
    return crossings.start[at, coordinate] + value - crossings.low[at, coordinate]


# ---- pinned vertices and boundary -----------------------------------------------------------


def _find_pins(
    grid_map: IntegerGridMap, settled: SettledMap, lead: Bools, uv: tuple[Segments, Segments]
) -> _Pins:
    rows = []
    for c, s in enumerate(uv):
        for side, slot, far in ((0, s.first, s.last), (1, s.last, s.first)):
            which = np.flatnonzero(slot % 2 == 0)
            face, k = s.face[which], slot[which] // 2
            # Place of the far end around the rim; a u and a v segment may leave by one halfedge.
            place = (4 * far[which] - 4 * slot[which]) % 24
            first = u_comes_first(settled, lead, face, far[which] // 2, settled.x[face, k])
            place += np.where((far[which] % 2 == 1) & (first == (c == 1)), 2, 0)
            side_column, c_column = np.full(len(which), side), np.full(len(which), c)
            rows.append(np.stack([which, c_column, side_column, 3 * face + k, place], axis=1))
    segment, coordinate, side_of, corner, place = np.concatenate(rows).T
    x = settled.x[corner // 3]
    e, f = x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]
    sign = np.where(e[:, 0] * f[:, 1] < e[:, 1] * f[:, 0], -1, 1)
    around = 32 * (1 + settled.fan_rank[corner]) + place
    return _Pins(segment, coordinate, side_of, grid_map.mesh.tail[corner], sign, around)


def _walk_rim(grid_map: IntegerGridMap, settled: SettledMap, crossings: _Crossings) -> _Rim:
    mesh = grid_map.mesh
    loops = mesh.boundary_loops
    h = np.concatenate([*loops, np.zeros(0, dtype=np.int64)])
    loop = np.repeat(np.arange(len(loops)), [len(a) for a in loops])
    x = settled.x.reshape(-1, 2)
    c = np.argmax(crossings.count[h], axis=1)  # the isolines that cross it are of one coordinate
    many = crossings.count[h, c]
    at = np.repeat(np.arange(len(h)), many)
    rank = np.arange(len(at)) - (np.cumsum(many) - many)[at]
    g, gc = h[at], c[at]
    level = crossings.low[g, gc] + rank
    place = np.array(grid_map.uv.reshape(-1, 2)[g] // GRID)
    place[np.arange(len(g)), gc] = level
    backward = x[next_halfedge(g), gc] < x[g, gc]
    n = 3 * len(g)
    pin = np.flatnonzero(settled.pinned[mesh.tail[h]])
    incoming = np.concatenate([*(np.roll(a, 1) for a in loops), np.zeros(0, dtype=np.int64)])[pin]
    # Stops: the points, then pinned vertices, each at the tail of its halfedge.
    stop_at = np.concatenate([at, pin])
    stop_rank = np.concatenate([np.where(backward, -rank, rank), np.full(len(pin), -(1 << 40))])
    ahead = np.concatenate([3 * np.arange(len(g)), n + 2 * np.arange(len(pin))])
    behind = np.concatenate([3 * np.arange(len(g)) + 2, n + 2 * np.arange(len(pin)) + 1])
    order = np.lexsort((stop_rank, stop_at))
    bare = np.setdiff1d(np.arange(len(loops)), loop[stop_at])
    if bare.size:
        raise ParametrizationError(
            f"boundary loop {bare[0]} (through vertex {mesh.tail[loops[bare[0]][0]]}) meets no "
            "isoline; ask for more quads"
        )
    following = np.zeros(len(order), dtype=np.int64)
    _cycle(np.arange(len(order)), loop[stop_at[order]], following)
    return _Rim(
        halfedge=g,
        place=place,
        crossing=crossings.start[g, gc] + rank,
        vertex=np.concatenate([np.full(n, -1), np.repeat(mesh.tail[h[pin]], 2)]),
        sign=np.concatenate(
            [
                np.repeat(settled.sense[g], 3),
                np.stack([settled.sense[h[pin]], settled.sense[incoming]], axis=1).reshape(-1),
            ]
        ),
        ahead=ahead[order],
        behind=behind[order][following],
    )


# ---- joining --------------------------------------------------------------------------------


def _links_along(uv: tuple[Segments, Segments], meet: Meetings, c: int, ends: Ints) -> Ints:
    """Pairs of neighbours, darts or crossings, along all segments of coordinate c."""
    n, number = len(meet.i), np.arange(len(meet.i))
    other = uv[1 - c]
    if c == 0:
        mine, theirs, use_last = meet.i, meet.j, meet.flipped
        to_first, to_last = 4 * number, 4 * number + 2
    else:
        mine, theirs, use_last = meet.j, meet.i, ~meet.flipped
        to_first = 4 * number + np.where(meet.flipped, 3, 1)
        to_last = 4 * number + np.where(meet.flipped, 1, 3)
    # Sort by the end of the other segment that lies between this one's first end and its last.
    slot = np.where(use_last, other.last[theirs], other.first[theirs])
    sign = np.where(use_last, -other.first_sign[theirs], other.first_sign[theirs])
    order = np.lexsort((sign * other.level[theirs], slot, mine))
    mine, to_first, to_last = mine[order], to_first[order], to_last[order]
    opens = np.ones(n, dtype=bool)
    opens[1:] = mine[1:] != mine[:-1]
    closes = np.append(opens[1:], True)[:n]
    bare = np.ones(len(ends), dtype=bool)
    bare[mine] = False
    return np.concatenate(
        [
            ends[bare],
            np.stack([ends[mine[opens], 0], to_first[opens]], axis=1),
            np.stack([to_last[~closes], to_first[~opens]], axis=1),
            np.stack([to_last[closes], ends[mine[closes], 1]], axis=1),
        ]
    )


def _join(links: Ints, n_darts: int, n_crossings: int) -> Ints:
    """The dart at the other end of the chain of links of each dart, -1 where there is none."""
    n = n_darts + n_crossings
    graph = coo_matrix((np.ones(len(links), dtype=np.int8), (links[:, 0], links[:, 1])), (n, n))
    label = connected_components(graph, directed=False)[1][:n_darts]
    order = np.argsort(label, kind="stable")
    ranked = label[order]
    same = ranked[1:] == ranked[:-1]
    # A pair: equal to the next, but the one before and the one after that differ.
    pair = same & ~np.append(same[1:], False) & ~np.insert(same[:-1], 0, False)
    pair = np.flatnonzero(pair)
    across = np.full(n_darts, -1, dtype=np.int64)
    across[order[pair]], across[order[pair + 1]] = order[pair + 1], order[pair]
    return across


def _turns(n_meet: int, point: Ints, around: Ints) -> Ints:
    """Next dart counter-clockwise: the four of a meeting in order, the others by ``around``."""
    turn = np.zeros(len(point), dtype=np.int64)
    turn[: 4 * n_meet] = np.arange(4 * n_meet).reshape(-1, 4)[:, [1, 2, 3, 0]].reshape(-1)
    special = np.arange(4 * n_meet, len(point))
    order = special[np.lexsort((around, point[special]))]
    _cycle(order, point[order], turn)
    return turn


def _cycle(items: Ints, group: Ints, following: Ints) -> None:
    """Set following[item] to the next item of its group, the last one's to the first (in place)."""
    if len(items) == 0:
        return
    opens = np.flatnonzero(np.append(True, group[1:] != group[:-1]))
    following[items] = np.append(items[1:], items[0])
    last = np.append(opens[1:], len(items)) - 1
    following[items[last]] = items[opens]

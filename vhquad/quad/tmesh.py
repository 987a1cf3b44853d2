"""The T-mesh of a seamless map: rectangular patches between the traced isolines and the features.

Nodes are special vertices and the places where tracks end; arcs are the pieces of tracks and of
feature curves between nodes; every patch is a rectangle in the map, each side a chain of arcs
(Campen, Bommes & Kobbelt 2015, section 4).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vhquad.errors import ParametrizationError
from vhquad.field.align import AlignedField
from vhquad.quad.motorcycle import Tracing, Track
from vhquad.quad.seamless import irregular_vertices
from vhquad.quad.seamless_map import SeamlessMap

__all__ = ["Arc", "Patch", "TMesh", "build_tmesh"]

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Arc:
    """A piece of an isoline between two nodes.

    Attributes
    ----------
    start, end : int
        Nodes.
    feature : int
        Number of the feature curve it lies on, -1 for a track.
    track : int
        Number of the track it lies on, -1 for a feature. The arcs of a track or curve stand in the
        order of travel.
    at : (p,) float64
        Parametric length at each point, from 0 to the length of the arc.
    points : (p, 3) float64
        The arc as a polyline on the surface.
    chart : tuple
        ``(face, direction, u, v)``: a face to the left of the start, the direction of travel in
        its chart, and the start's coordinates there.
    back_chart : tuple
        The same for the reversed arc, which starts at the end: a face to the left of it.
    """

    start: int
    end: int
    feature: int
    track: int
    at: Floats
    points: Floats
    chart: tuple[int, int, float, float]
    back_chart: tuple[int, int, float, float]

    @property
    def length(self) -> float:
        """Parametric length."""
        return float(self.at[-1])


@dataclass(frozen=True, eq=False)
class Patch:
    """A rectangle: four sides of half-arcs, counter-clockwise; half-arc 2a is arc a, 2a + 1 its
    reverse."""

    sides: tuple[tuple[int, ...], tuple[int, ...], tuple[int, ...], tuple[int, ...]]


@dataclass(frozen=True, eq=False)
class TMesh:
    """Nodes, arcs and patches.

    Attributes
    ----------
    node_points : (k, 3) float64
        Positions.
    node_vertex : (k,) int64
        The special vertex at a node, -1 elsewhere.
    node_feature : (k,) int64
        Feature curve on which a node lies (any, if several meet), -1 elsewhere.
    node_fixed : (k,) bool
        Irregular vertices on features: corners, ends and junctions, which no polish may move.
    curves : list of (p, 3) float64
        Feature curves as polylines; a curve that closes up ends at its first point.
    curve_halfedges : list of (p - 1,) int64
        The same curves as halfedges of the mesh, each with its face to the left.
    arcs, patches : list
    """

    node_points: Floats
    node_vertex: NDArray[np.int64]
    node_feature: NDArray[np.int64]
    node_fixed: NDArray[np.bool_]
    curves: list[Floats]
    curve_halfedges: list[NDArray[np.int64]]
    arcs: list[Arc]
    patches: list[Patch]

    @property
    def lengths(self) -> Floats:
        """Parametric length of each arc."""
        return np.array([arc.length for arc in self.arcs])


@dataclass
class _Stop:
    """A node on a curve: its place along the curve and on which side others join there."""

    step: int
    offset: float
    node: int
    stem: int  # track that ends here, -1 at the ends of the curve
    side: int  # +1 the stem comes from the left, -1 from the right


class _Builder:
    def __init__(self, aligned: AlignedField, seamless: SeamlessMap, tracing: Tracing) -> None:
        self.aligned = aligned
        self.mesh = aligned.mesh
        self.unit = seamless.unit
        self.uv = seamless.uv
        self.tracing = tracing
        self.points: list[Floats] = []
        self.vertex: list[int] = []
        self.feature: list[int] = []
        self.arcs: list[Arc] = []
        self.node_of_vertex: dict[int, int] = {}
        # Per node: outgoing half-arcs counter-clockwise as keys, later replaced by half-arcs.
        self.ring: dict[int, list[tuple[object, int]]] = {}

    def node(self, point: Floats, vertex: int = -1, feature: int = -1) -> int:
        self.points.append(np.asarray(point, dtype=np.float64))
        self.vertex.append(vertex)
        self.feature.append(feature)
        return len(self.points) - 1


def build_tmesh(aligned: AlignedField, seamless: SeamlessMap, tracing: Tracing) -> TMesh:
    """Assemble nodes, arcs and patches from traced isolines.

    Raises
    ------
    ParametrizationError
        If a patch is not a rectangle: the map is folded somewhere.
    """
    b = _Builder(aligned, seamless, tracing)
    for v in np.flatnonzero(tracing.special).tolist():
        b.node_of_vertex[v] = b.node(b.mesh.vertices[v], vertex=v)
    curves, curve_of, place_of = _feature_curves(b)
    track_stops: list[list[_Stop]] = [[] for _ in tracing.tracks]
    curve_stops: list[list[_Stop]] = [[] for _ in curves]
    ends: list[int] = [-1] * len(tracing.tracks)
    for number, track in enumerate(tracing.tracks):
        if ends[number] >= 0:
            continue
        hit = track.hit
        assert hit is not None
        if hit.kind == "meet":
            node = b.node(_exit_point(b, track))
            ends[number] = ends[hit.other] = node
            b.ring[node] = [(("track", number, -1), 2), (("track", hit.other, -1), 2)]
        elif hit.kind == "track":
            other = tracing.tracks[hit.other].steps[hit.step]
            sign = 1 if other.direction < 2 else -1
            u, v = (hit.coordinate, other.level)
            if other.direction % 2:
                u, v = v, u
            node = b.node(_surface_point(b, other.face, u, v))
            side = -1 if (hit.direction - other.direction) % 4 == 1 else 1
            track_stops[hit.other].append(
                _Stop(hit.step, sign * hit.coordinate, node, number, side)
            )
            ends[number] = node
        else:
            h = hit.other
            a = b.mesh.vertices[b.mesh.tail[h]]
            c = b.mesh.vertices[b.mesh.head[h]]
            curve = curve_of[h]
            node = b.node(a + hit.coordinate * (c - a), feature=curve)
            index, forward = place_of[h]
            fraction = hit.coordinate if forward else 1 - hit.coordinate
            curve_stops[curve].append(_Stop(index, fraction, node, number, 1 if forward else -1))
            ends[number] = node

    first_half: dict[object, int] = {}  # key of an outgoing spoke -> half-arc
    for number, track in enumerate(tracing.tracks):
        stops = sorted(track_stops[number], key=lambda s: (s.step, s.offset))
        _cut_track(b, number, track, stops, ends[number], first_half)
    for number, curve in enumerate(curves):
        stops = sorted(curve_stops[number], key=lambda s: (s.step, s.offset))
        _cut_curve(b, number, curve, stops, first_half)
    for v, ports in tracing.ports.items():
        b.ring[b.node_of_vertex[v]] = [
            (("track", p.track, 0) if p.track >= 0 else ("feature", p.halfedge), p.gap)
            for p in ports
        ]
    patches = _patches(b, first_half)
    node_feature = np.array(b.feature, dtype=np.int64)
    for number, curve in enumerate(curves):
        for h in (curve[0], curve[-1]):
            for v in (int(b.mesh.tail[h]), int(b.mesh.head[h])):
                if v in b.node_of_vertex:
                    node_feature[b.node_of_vertex[v]] = number
    node_vertex = np.array(b.vertex, dtype=np.int64)
    irregular = irregular_vertices(aligned)
    return TMesh(
        node_points=np.array(b.points).reshape(-1, 3),
        node_vertex=node_vertex,
        node_feature=node_feature,
        node_fixed=(node_feature >= 0) & (node_vertex >= 0) & irregular[node_vertex],
        curves=[b.mesh.vertices[np.append(b.mesh.tail[c], b.mesh.head[c[-1]])] for c in curves],
        curve_halfedges=[np.array(c, dtype=np.int64) for c in curves],
        arcs=b.arcs,
        patches=patches,
    )


def _surface_point(b: _Builder, face: int, u: float, v: float) -> Floats:
    """Position on a face at chart coordinates."""
    p = b.uv[face].astype(np.float64)
    e, g = p[1] - p[0], p[2] - p[0]
    det = e[0] * g[1] - e[1] * g[0]
    d = np.array([u, v]) - p[0]
    s = (d[0] * g[1] - d[1] * g[0]) / det
    t = (e[0] * d[1] - e[1] * d[0]) / det
    corners = b.mesh.vertices[b.mesh.faces[face]]
    return np.asarray(corners[0] + s * (corners[1] - corners[0]) + t * (corners[2] - corners[0]))


def _exit_point(b: _Builder, track: Track) -> Floats:
    """Where a track leaves the face of its last step."""
    step = track.steps[-1]
    axis = step.direction % 2
    end = _exit_coordinate(b, step.face, step.direction, step.level, step.at)
    u, v = (end, step.level) if axis == 0 else (step.level, end)
    return _surface_point(b, step.face, u, v)


def _exit_coordinate(b: _Builder, face: int, direction: int, level: float, at: float) -> float:
    """Moving coordinate at which an isoline leaves a face."""
    axis = direction % 2
    sign = 1 if direction < 2 else -1
    p = b.uv[face].astype(np.float64)
    best = at
    for k in range(3):
        a, c = p[k], p[(k + 1) % 3]
        low, high = sorted((a[1 - axis], c[1 - axis]))
        if low <= level <= high and high > low:
            f = (level - a[1 - axis]) / (c[1 - axis] - a[1 - axis])
            place = a[axis] + f * (c[axis] - a[axis])
            if sign * (place - best) > 0:
                best = place
    return float(best)


def _track_polyline(b: _Builder, track: Track) -> tuple[Floats, Floats, list[float]]:
    """Parametric length and position at each step's start and at the end; length by step."""
    at = [0.0]
    points = []
    starts: list[float] = []
    for index, step in enumerate(track.steps):
        axis = step.direction % 2
        u, v = (step.at, step.level) if axis == 0 else (step.level, step.at)
        points.append(_surface_point(b, step.face, u, v))
        starts.append(at[-1])
        if step.stop is not None:
            end = float(step.stop)
        else:
            end = _exit_coordinate(b, step.face, step.direction, step.level, step.at)
        at.append(at[-1] + abs(end - step.at))
        if index == len(track.steps) - 1:
            u, v = (end, step.level) if axis == 0 else (step.level, end)
            points.append(_surface_point(b, step.face, u, v))
    return np.array(at), np.array(points), starts


def _cut_track(
    b: _Builder,
    number: int,
    track: Track,
    stops: list[_Stop],
    end: int,
    first_half: dict[object, int],
) -> None:
    at, points, starts = _track_polyline(b, track)
    nodes = [b.node_of_vertex[track.vertex]]
    places = [0.0]
    charts: list[tuple[int, int, float, float]] = []
    step = track.steps[0]
    charts.append(_chart(step.face, step.direction, step.level, step.at))
    for stop in stops:
        step = track.steps[stop.step]
        sign = 1 if step.direction < 2 else -1
        coordinate = sign * stop.offset
        nodes.append(stop.node)
        places.append(max(starts[stop.step] + abs(coordinate - step.at), places[-1]))
        charts.append(_chart(step.face, step.direction, step.level, coordinate))
    nodes.append(end)
    places.append(max(float(at[-1]), places[-1]))
    step = track.steps[-1]
    last = (
        float(step.stop)
        if step.stop is not None
        else _exit_coordinate(b, step.face, step.direction, step.level, step.at)
    )
    charts.append(_chart(step.face, step.direction, step.level, last))
    made = _make_arcs(b, nodes, places, charts, charts, at, points, track=number)
    first_half[("track", number, 0)] = 2 * made[0]
    first_half[("track", number, -1)] = 2 * made[-1] + 1
    hit = track.hit
    assert hit is not None
    for i, stop in enumerate(stops):
        forward, back = 2 * made[i + 1], 2 * made[i] + 1
        key_forward, key_back = ("along", number, i, 0), ("along", number, i, 1)
        first_half[key_forward], first_half[key_back] = forward, back
        stem: object = ("track", stop.stem, -1)
        if stop.side < 0:  # from the right: forward, back, stem
            b.ring[stop.node] = [(key_forward, 2), (key_back, 1), (stem, 1)]
        else:
            b.ring[stop.node] = [(key_forward, 1), (stem, 1), (key_back, 2)]


def _chart(face: int, direction: int, level: float, moving: float) -> tuple[int, int, float, float]:
    if direction % 2 == 0:
        return face, direction, float(moving), float(level)
    return face, direction, float(level), float(moving)


def _make_arcs(
    b: _Builder,
    nodes: list[int],
    places: list[float],
    charts: list[tuple[int, int, float, float]],
    back_charts: list[tuple[int, int, float, float]],
    at: Floats,
    points: Floats,
    feature: int = -1,
    track: int = -1,
) -> list[int]:
    """Cut a polyline at its nodes; numbers of the arcs made."""
    made = []
    for i in range(len(nodes) - 1):
        low, high = places[i], places[i + 1]
        inside = (at > low) & (at < high)
        where = np.concatenate([[low], at[inside], [high]])
        polyline = np.concatenate([[b.points[nodes[i]]], points[inside], [b.points[nodes[i + 1]]]])
        face, direction, u, v = back_charts[i + 1]
        made.append(len(b.arcs))
        b.arcs.append(
            Arc(
                start=nodes[i],
                end=nodes[i + 1],
                feature=feature,
                track=track,
                at=(where - low) * b.unit,
                points=polyline,
                chart=charts[i],
                back_chart=(face, (direction + 2) % 4, u, v),
            )
        )
    return made


def _feature_curves(
    b: _Builder,
) -> tuple[list[list[int]], dict[int, int], dict[int, tuple[int, bool]]]:
    """Feature halfedges chained between special vertices; curve and place of each halfedge."""
    mesh = b.mesh
    feature = np.flatnonzero(b.aligned.feature)
    leaving: dict[int, list[int]] = {}
    edge_used: set[int] = set()
    for h in feature.tolist():
        leaving.setdefault(int(mesh.tail[h]), []).append(h)
    # Boundaries have one halfedge only: the way back is written -1 - h.
    curves: list[list[int]] = []
    curve_of: dict[int, int] = {}
    place_of: dict[int, tuple[int, bool]] = {}
    special = b.tracing.special
    for v in np.flatnonzero(special).tolist():
        for first in leaving.get(v, []):
            if int(mesh.halfedge_edge[first]) in edge_used:
                continue
            chain = [first]
            edge_used.add(int(mesh.halfedge_edge[first]))
            while not special[mesh.head[chain[-1]]]:
                following = [
                    h
                    for h in leaving[int(mesh.head[chain[-1]])]
                    if int(mesh.halfedge_edge[h]) not in edge_used
                ]
                if len(following) != 1:
                    raise ParametrizationError(
                        f"feature edges do not form a curve at vertex {mesh.head[chain[-1]]}"
                    )
                chain.append(following[0])
                edge_used.add(int(mesh.halfedge_edge[following[0]]))
            for index, h in enumerate(chain):
                curve_of[h] = len(curves)
                place_of[h] = (index, True)
                if mesh.twin[h] >= 0:
                    curve_of[int(mesh.twin[h])] = len(curves)
                    place_of[int(mesh.twin[h])] = (index, False)
            curves.append(chain)
    return curves, curve_of, place_of


def _cut_curve(
    b: _Builder, number: int, curve: list[int], stops: list[_Stop], first_half: dict[object, int]
) -> None:
    mesh = b.mesh
    h = np.array(curve)
    faces, k = h // 3, h % 3
    tail_uv = b.uv[faces, k].astype(np.float64)
    head_uv = b.uv[faces, (k + 1) % 3].astype(np.float64)
    lengths = np.abs(head_uv - tail_uv).sum(axis=1)
    at = np.concatenate([[0.0], np.cumsum(lengths)])
    points = mesh.vertices[np.append(mesh.tail[h], mesh.head[h[-1]])]

    def chart(index: int, fraction: float) -> tuple[int, int, float, float]:
        step = head_uv[index] - tail_uv[index]
        place = tail_uv[index] + fraction * step
        direction = (
            (0 if step[0] > 0 else 2) if abs(step[0]) > abs(step[1]) else (1 if step[1] > 0 else 3)
        )
        return int(faces[index]), direction, float(place[0]), float(place[1])

    def back_chart(index: int, fraction: float) -> tuple[int, int, float, float]:
        """Chart to the right of the curve, with the direction of the curve in it."""
        twin = int(mesh.twin[curve[index]])
        if twin < 0:
            return -1, 0, 0.0, 0.0
        f, side = divmod(twin, 3)
        a, c = b.uv[f, side].astype(np.float64), b.uv[f, (side + 1) % 3].astype(np.float64)
        step = a - c
        place = c + fraction * step
        direction = (
            (0 if step[0] > 0 else 2) if abs(step[0]) > abs(step[1]) else (1 if step[1] > 0 else 3)
        )
        return f, direction, float(place[0]), float(place[1])

    nodes = [b.node_of_vertex[int(mesh.tail[curve[0]])]]
    places = [0.0]
    charts, back = [chart(0, 0.0)], [back_chart(0, 0.0)]
    for stop in stops:
        nodes.append(stop.node)
        places.append(max(float(at[stop.step] + stop.offset * lengths[stop.step]), places[-1]))
        charts.append(chart(stop.step, stop.offset))
        back.append(back_chart(stop.step, stop.offset))
    nodes.append(b.node_of_vertex[int(mesh.head[curve[-1]])])
    places.append(float(at[-1]))
    charts.append(chart(len(curve) - 1, 1.0))
    back.append(back_chart(len(curve) - 1, 1.0))
    made = _make_arcs(b, nodes, places, charts, back, at, points, feature=number)
    closed = int(mesh.twin[curve[0]]) < 0
    first_half[("feature", curve[0])] = 2 * made[0]
    if closed:
        first_half[("feature", -1 - curve[-1])] = 2 * made[-1] + 1
    else:
        first_half[("feature", int(mesh.twin[curve[-1]]))] = 2 * made[-1] + 1
    for i, stop in enumerate(stops):
        key_forward, key_back = ("curve", number, i, 0), ("curve", number, i, 1)
        first_half[key_forward], first_half[key_back] = 2 * made[i + 1], 2 * made[i] + 1
        stem: object = ("track", stop.stem, -1)
        outside = 0 if closed else 2
        if stop.side > 0:
            b.ring[stop.node] = [(key_forward, 1), (stem, 1), (key_back, outside)]
        else:
            b.ring[stop.node] = [(key_forward, 2), (key_back, 1), (stem, 1)]


def _patches(b: _Builder, first_half: dict[object, int]) -> list[Patch]:
    """Walk round every face of the T-mesh; each must have four corners."""
    arrival: dict[int, tuple[int, int]] = {}  # half-arc -> (next half-arc to the left, turn)
    for ring in b.ring.values():
        halves = [first_half[key] for key, _ in ring]
        for i, out in enumerate(halves):
            gap = ring[i - 1][1]
            arrival[out ^ 1] = (halves[i - 1], gap)
    patches: list[Patch] = []
    seen: set[int] = set()
    for start in range(2 * len(b.arcs)):
        if start in seen:
            continue
        loop: list[tuple[int, int]] = []
        h = start
        while h not in seen:
            seen.add(h)
            following, gap = arrival[h]
            loop.append((h, gap))
            h = following
        if any(gap == 0 for _, gap in loop):
            continue  # the outside of a boundary
        corners = [i for i, (_, gap) in enumerate(loop) if gap == 1]
        if h != start or len(corners) != 4:
            raise ParametrizationError(
                f"a patch between isolines has {len(corners)} corners instead of 4"
            )
        sides = []
        for i in range(4):
            low, high = corners[i - 1], corners[i]
            span = range(low + 1, high + 1 if high > low else high + 1 + len(loop))
            sides.append(tuple(loop[j % len(loop)][0] for j in span))
        patches.append(Patch(sides=(sides[0], sides[1], sides[2], sides[3])))
    return patches

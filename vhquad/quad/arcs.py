"""Arcs of a T-mesh: tracks and feature curves cut at the nodes on them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vhquad.errors import ParametrizationError
from vhquad.field.align import AlignedField
from vhquad.quad.motorcycle import Step, Tracing, Track
from vhquad.quad.seamless_map import SeamlessMap

__all__ = [
    "Arc",
    "Builder",
    "Stop",
    "cut_curve",
    "cut_track",
    "exit_point",
    "feature_curves",
    "surface_points",
]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


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


@dataclass
class Stop:
    """A node on a curve: its place along the curve and on which side others join there."""

    step: int
    offset: float
    node: int
    stem: int  # track that ends here, -1 at the ends of the curve
    side: int  # +1 the stem comes from the left, -1 from the right


class Builder:
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


def surface_points(b: Builder, face: Ints, uv: Floats) -> Floats:
    """Positions on faces (q,) at chart coordinates (q, 2); (q, 3)."""
    p = b.uv[face].astype(np.float64)
    e, g, d = p[:, 1] - p[:, 0], p[:, 2] - p[:, 0], uv - p[:, 0]
    det = e[:, 0] * g[:, 1] - e[:, 1] * g[:, 0]
    s = (d[:, 0] * g[:, 1] - d[:, 1] * g[:, 0]) / det
    t = (e[:, 0] * d[:, 1] - e[:, 1] * d[:, 0]) / det
    a, second, third = np.moveaxis(b.mesh.vertices[b.mesh.faces[face]], 1, 0)
    return np.asarray(a + s[:, None] * (second - a) + t[:, None] * (third - a))


def exit_point(b: Builder, track: Track) -> Floats:
    """Where a track leaves the face of its last step."""
    s = _step_arrays(track.steps[-1:])
    return surface_points(b, s.face, s.charted(_exit_coordinates(b, s)))[0]


@dataclass(frozen=True, eq=False)
class _StepArrays:
    """Steps of a track as arrays, one entry a step."""

    face: Ints
    direction: Ints
    level: Floats
    at: Floats

    def charted(self, moving: Floats) -> Floats:
        """Chart coordinates where the moving ones are known; (q, 2)."""
        along_u = (self.direction % 2 == 0)[:, None]
        ahead = np.stack([moving, self.level], axis=1)
        return np.where(along_u, ahead, ahead[:, ::-1])


def _step_arrays(steps: Sequence[Step]) -> _StepArrays:
    return _StepArrays(
        np.array([s.face for s in steps], dtype=np.int64),
        np.array([s.direction for s in steps], dtype=np.int64),
        np.array([s.level for s in steps], dtype=np.float64),
        np.array([s.at for s in steps], dtype=np.float64),
    )


def _exit_coordinates(b: Builder, s: _StepArrays) -> Floats:
    """Moving coordinate at which the isoline of each step leaves its face; (q,)."""
    row, axis = np.arange(len(s.face)), s.direction % 2
    sign = np.where(s.direction < 2, 1, -1)
    p = b.uv[s.face].astype(np.float64)
    moving, still = p[row, :, axis], p[row, :, 1 - axis]
    best = s.at
    for k in range(3):
        a, c = still[:, k], still[:, (k + 1) % 3]
        low, high = np.minimum(a, c), np.maximum(a, c)
        crossed = (low <= s.level) & (s.level <= high) & (high > low)
        share = (s.level - a) / np.where(crossed, c - a, 1.0)
        place = moving[:, k] + share * (moving[:, (k + 1) % 3] - moving[:, k])
        best = np.where(crossed & (sign * (place - best) > 0), place, best)
    return best


def _track_polyline(b: Builder, track: Track) -> tuple[Floats, Floats, float]:
    """Parametric length and position at each step's start and at the end; coordinate of the end."""
    s = _step_arrays(track.steps)
    end = _exit_coordinates(b, s)
    for i, step in enumerate(track.steps):
        if step.stop is not None:
            end[i] = step.stop
    at = np.concatenate([[0.0], np.cumsum(np.abs(end - s.at))])
    face = np.append(s.face, s.face[-1])
    uv = np.concatenate([s.charted(s.at), s.charted(end)[-1:]])
    return at, surface_points(b, face, uv), float(end[-1])


def cut_track(
    b: Builder,
    number: int,
    track: Track,
    stops: list[Stop],
    end: int,
    first_half: dict[object, int],
) -> None:
    at, points, last = _track_polyline(b, track)
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
        places.append(max(float(at[stop.step]) + abs(coordinate - step.at), places[-1]))
        charts.append(_chart(step.face, step.direction, step.level, coordinate))
    nodes.append(end)
    places.append(max(float(at[-1]), places[-1]))
    step = track.steps[-1]
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
    b: Builder,
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


def feature_curves(
    b: Builder,
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


def cut_curve(
    b: Builder, number: int, curve: list[int], stops: list[Stop], first_half: dict[object, int]
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

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
from vhquad.quad.arcs import (
    Arc,
    Builder,
    Stop,
    cut_curve,
    cut_track,
    exit_point,
    feature_curves,
    surface_points,
)
from vhquad.quad.motorcycle import Tracing
from vhquad.quad.seamless import irregular_vertices
from vhquad.quad.seamless_map import SeamlessMap

__all__ = ["Arc", "Patch", "TMesh", "build_tmesh"]

Floats = NDArray[np.float64]


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


def build_tmesh(aligned: AlignedField, seamless: SeamlessMap, tracing: Tracing) -> TMesh:
    """Assemble nodes, arcs and patches from traced isolines.

    Raises
    ------
    ParametrizationError
        If a patch is not a rectangle: the map is folded somewhere.
    """
    b = Builder(aligned, seamless, tracing)
    for v in np.flatnonzero(tracing.special).tolist():
        b.node_of_vertex[v] = b.node(b.mesh.vertices[v], vertex=v)
    curves, curve_of, place_of = feature_curves(b)
    track_stops: list[list[Stop]] = [[] for _ in tracing.tracks]
    curve_stops: list[list[Stop]] = [[] for _ in curves]
    ends: list[int] = [-1] * len(tracing.tracks)
    for number, track in enumerate(tracing.tracks):
        if ends[number] >= 0:
            continue
        hit = track.hit
        assert hit is not None
        if hit.kind == "meet":
            node = b.node(exit_point(b, track))
            ends[number] = ends[hit.other] = node
            b.ring[node] = [(("track", number, -1), 2), (("track", hit.other, -1), 2)]
        elif hit.kind == "track":
            other = tracing.tracks[hit.other].steps[hit.step]
            sign = 1 if other.direction < 2 else -1
            u, v = (hit.coordinate, other.level)
            if other.direction % 2:
                u, v = v, u
            node = b.node(surface_points(b, np.array([other.face]), np.array([[u, v]]))[0])
            side = -1 if (hit.direction - other.direction) % 4 == 1 else 1
            track_stops[hit.other].append(Stop(hit.step, sign * hit.coordinate, node, number, side))
            ends[number] = node
        else:
            h = hit.other
            a = b.mesh.vertices[b.mesh.tail[h]]
            c = b.mesh.vertices[b.mesh.head[h]]
            on = curve_of[h]
            node = b.node(a + hit.coordinate * (c - a), feature=on)
            index, forward = place_of[h]
            fraction = hit.coordinate if forward else 1 - hit.coordinate
            curve_stops[on].append(Stop(index, fraction, node, number, 1 if forward else -1))
            ends[number] = node

    first_half: dict[object, int] = {}  # key of an outgoing spoke -> half-arc
    for number, track in enumerate(tracing.tracks):
        stops = sorted(track_stops[number], key=lambda s: (s.step, s.offset))
        cut_track(b, number, track, stops, ends[number], first_half)
    for number, curve in enumerate(curves):
        stops = sorted(curve_stops[number], key=lambda s: (s.step, s.offset))
        cut_curve(b, number, curve, stops, first_half)
    for v, ports in tracing.ports.items():
        b.ring[b.node_of_vertex[v]] = [
            (("track", p.track, 0) if p.track >= 0 else ("feature", p.halfedge), p.gap)
            for p in ports
        ]
    patches = _patches(b, first_half)
    node_feature = np.array(b.feature, dtype=np.int64)
    for number, curve in enumerate(curves):
        for v in (int(b.mesh.tail[curve[0]]), int(b.mesh.head[curve[-1]])):
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


def _patches(b: Builder, first_half: dict[object, int]) -> list[Patch]:
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

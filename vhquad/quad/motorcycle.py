"""Motorcycle tracing: isolines from the special vertices of a seamless map, until they meet.

From every special vertex (see ``vhquad.quad.seamless.special_vertices``) one track starts along
each axis direction of the map; all advance at the same speed, and each ends where it meets the
path of another, a feature or a boundary (Eppstein et al. 2008; Campen, Bommes & Kobbelt 2015). The
map's coordinates are integers and every decision is a comparison of integers.
"""

from __future__ import annotations

import heapq
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from vhquad.errors import ParametrizationError
from vhquad.field.align import AlignedField
from vhquad.quad.seamless import special_vertices
from vhquad.quad.seamless_map import SeamlessMap

__all__ = ["Hit", "Port", "Step", "Tracing", "Track", "trace"]


@dataclass
class Step:
    """Passage of a track through one face.

    ``direction`` is the quarter turn of travel in the chart of the face and ``level`` the fixed
    coordinate. ``start`` and ``stop`` are the moving coordinate where the track begins or ends
    inside the face, None where it comes or leaves through an edge. ``enter`` is the halfedge of
    this face it came through (-1 at the start) and ``at`` the moving coordinate there.
    """

    face: int
    direction: int
    level: int
    start: int | None
    stop: int | None
    enter: int
    at: float


@dataclass
class Hit:
    """Where a track ends: on another track, on a feature halfedge, or head-on.

    kind "track": ``other`` is the track, ``step`` its step and ``coordinate`` the place on it.
    kind "feature": ``other`` is the halfedge and ``coordinate`` the fraction along it.
    kind "meet": ``other`` is the track that came the opposite way.
    ``direction`` is that of arrival, in the chart of the face (of the other track, head-on).
    """

    kind: str
    other: int
    step: int
    coordinate: float
    direction: int


@dataclass
class Track:
    """A track from its port to where it ends."""

    vertex: int
    steps: list[Step] = field(default_factory=list)
    length: float = 0.0
    hit: Hit | None = None


@dataclass(frozen=True)
class Port:
    """One spoke of a special vertex, counter-clockwise: a track (>= 0) or a feature halfedge.

    ``halfedge`` is the outgoing feature halfedge, or -1 - h for a boundary halfedge h that arrives
    at the vertex. ``gap`` is the number of quarter turns to the next port, 0 across the outside.
    """

    track: int
    halfedge: int
    gap: int


@dataclass(frozen=True, eq=False)
class Tracing:
    """All tracks, and the ports around each special vertex."""

    tracks: list[Track]
    ports: dict[int, list[Port]]
    special: NDArray[np.bool_]


class _Charts:
    """Plain lists of the map: element access is what tracing does most."""

    def __init__(self, aligned: AlignedField, seamless: SeamlessMap) -> None:
        mesh = aligned.mesh
        self.uv: list[list[list[int]]] = seamless.uv.tolist()
        self.twin: list[int] = mesh.twin.tolist()
        self.feature: list[bool] = aligned.feature.tolist()
        self.rotation: list[int] = seamless.rotation.tolist()
        self.translation: list[list[int]] = seamless.translation.tolist()

    def cross(self, h: int, direction: int, level: int) -> tuple[int, int]:
        """Direction and level on the other side of halfedge h."""
        r = self.rotation[h]
        point = (0, level) if direction % 2 == 0 else (level, 0)
        u, v = _turned(point, r)
        shift = self.translation[h]
        turned = (direction + r) % 4
        return turned, (v + shift[1]) if turned % 2 == 0 else (u + shift[0])


def _turned(z: tuple[int, int], quarter: int) -> tuple[int, int]:
    u, v = z
    return ((u, v), (-v, u), (-u, -v), (v, -u))[quarter]


def trace(aligned: AlignedField, seamless: SeamlessMap) -> Tracing:
    """Trace all isolines of a valid seamless map.

    Raises
    ------
    ParametrizationError
        If the map is folded somewhere: then isolines may not end, or start in wrong numbers.
    """
    charts = _Charts(aligned, seamless)
    special = special_vertices(aligned)
    tracks: list[Track] = []
    ports: dict[int, list[Port]] = {}
    for v in np.flatnonzero(special).tolist():
        ports[v] = _launch(aligned, charts, v, tracks)

    passed: dict[int, list[tuple[int, int]]] = {}
    queue = [
        (tracks[number].length, number)
        for number in range(len(tracks))
        if _enter(charts, tracks, passed, number, tracks[number].steps.pop())
    ]
    heapq.heapify(queue)
    budget = 200 * len(tracks) + 40 * aligned.mesh.n_faces
    while queue:
        _, number = heapq.heappop(queue)
        budget -= 1
        if budget < 0:
            raise ParametrizationError("an isoline of the map does not end")
        if tracks[number].hit is None and _advance(charts, tracks, passed, number):
            heapq.heappush(queue, (tracks[number].length, number))
    return Tracing(tracks=tracks, ports=ports, special=special)


def _launch(aligned: AlignedField, charts: _Charts, v: int, tracks: list[Track]) -> list[Port]:
    """Start the tracks of one special vertex; its ports counter-clockwise."""
    first = int(aligned.mesh.outgoing[v])
    ports: list[Port] = []
    counts: dict[int, int] = {}
    h = first
    while True:
        f, k = divmod(h, 3)
        sector = int(aligned.sector[f, k])
        counts.setdefault(sector, 0)
        if charts.feature[h]:
            ports.append(Port(-1, h, 1))
        for direction in _directions(charts, f, k):
            place = charts.uv[f][k]
            axis = direction % 2
            ports.append(Port(len(tracks), 0, 1))
            step = Step(f, direction, place[1 - axis], place[axis], None, -1, place[axis])
            tracks.append(Track(vertex=v, steps=[step]))
            counts[sector] += 1
        back = h + 2 if k == 0 else h - 1
        if charts.twin[back] < 0:
            ports.append(Port(-1, -1 - back, 0))
            break
        h = charts.twin[back]
        if h == first:
            break
    for sector, count in counts.items():
        quads = int(aligned.sector_quads[sector])
        wanted = quads - 1 if aligned.sector_is_feature[sector] else quads
        if count != wanted:
            raise ParametrizationError(
                f"{count} isolines start at vertex {v} where the field asks for {wanted}"
            )
    return ports


def _directions(charts: _Charts, f: int, k: int) -> list[int]:
    """Axis directions inside corner k of face f, counter-clockwise; on its first side included."""
    p = charts.uv[f]
    a, b, c = p[k], p[(k + 1) % 3], p[(k + 2) % 3]
    e = (b[0] - a[0], b[1] - a[1])
    g = (c[0] - a[0], c[1] - a[1])
    found: list[tuple[int, int]] = []
    on_feature = charts.feature[3 * f + k]
    for direction, (x, y) in enumerate(((1, 0), (0, 1), (-1, 0), (0, -1))):
        left = e[0] * y - e[1] * x
        ahead = e[0] * x + e[1] * y
        right = x * g[1] - y * g[0]
        inside = left > 0 or (left == 0 and ahead > 0 and not on_feature)
        if inside and right > 0:
            found.append((-ahead, direction))
    # Nearer to the first side comes first; two directions in one corner are 90 degrees apart.
    return [direction for _, direction in sorted(found)]


def _enter(
    charts: _Charts,
    tracks: list[Track],
    passed: dict[int, list[tuple[int, int]]],
    number: int,
    step: Step,
) -> bool:
    """Append a step to its track, up to the first track in its way; False where it ends there.

    The step is cut short before others can see it, so what is registered is what is covered.
    """
    track = tracks[number]
    present = passed.setdefault(step.face, [])
    crossing = _first_crossing(charts, tracks, present, step)
    present.append((number, len(track.steps)))
    track.steps.append(step)
    if crossing is None:
        return True
    other, index, step.stop = crossing
    track.length += abs(step.stop - step.at)
    track.hit = Hit("track", other, index, step.level, step.direction)
    return False


def _advance(
    charts: _Charts, tracks: list[Track], passed: dict[int, list[tuple[int, int]]], number: int
) -> bool:
    """Let a track leave the face of its last step and enter the next; False where it ends."""
    track = tracks[number]
    step = track.steps[-1]
    h, fraction, place = _exit(charts, step)
    track.length += abs(place - step.at)
    if charts.feature[h]:
        track.hit = Hit("feature", h, 0, fraction, step.direction)
        return False
    if fraction in (0.0, 1.0):
        raise ParametrizationError("an isoline of the map runs into an ordinary vertex")
    direction, level = charts.cross(h, step.direction, step.level)
    g, k = divmod(charts.twin[h], 3)
    for other, index in passed.get(g, ()):
        met = tracks[other].steps[index]
        if met.level == level and met.direction == (direction + 2) % 4 and met.stop is None:
            track.hit = Hit("meet", other, index, 0.0, direction)
            back = (step.direction + 2) % 4
            tracks[other].hit = Hit("meet", number, len(track.steps) - 1, 0.0, back)
            tracks[other].length += abs(_exit(charts, met)[2] - met.at)
            return False
    axis = direction % 2
    tail, head = charts.uv[g][k][axis], charts.uv[g][(k + 1) % 3][axis]
    at = head + fraction * (tail - head)  # the twin runs the other way
    return _enter(
        charts, tracks, passed, number, Step(g, direction, level, None, None, charts.twin[h], at)
    )


def _first_crossing(
    charts: _Charts, tracks: list[Track], present: list[tuple[int, int]], step: Step
) -> tuple[int, int, int] | None:
    """Nearest perpendicular track ahead in the face: (track, step, moving coordinate)."""
    axis = step.direction % 2
    sign = 1 if step.direction < 2 else -1
    best: tuple[int, int, int] | None = None
    for other, index in present:
        wall = tracks[other].steps[index]
        if wall.direction % 2 == axis:
            continue
        place = wall.level
        if step.start is not None and sign * (place - step.start) <= 0:
            continue
        if not _covers(wall, step.level):
            continue
        point = (place, step.level) if axis == 0 else (step.level, place)
        if not _inside(charts.uv[step.face], point):
            continue
        if best is None or sign * (place - best[2]) < 0:
            best = (other, index, place)
    return best


def _covers(wall: Step, coordinate: int) -> bool:
    """Whether a step reaches a moving coordinate of its face, given that the point is inside."""
    sign = 1 if wall.direction < 2 else -1
    if wall.start is not None and sign * (coordinate - wall.start) < 0:
        return False
    return wall.stop is None or sign * (coordinate - wall.stop) <= 0


def _inside(p: list[list[int]], q: tuple[int, int]) -> bool:
    """Whether a point lies in a positively oriented triangle or on its border, exactly."""
    for k in range(3):
        a, b = p[k], p[(k + 1) % 3]
        if (b[0] - a[0]) * (q[1] - a[1]) - (b[1] - a[1]) * (q[0] - a[0]) < 0:
            return False
    return True


def _exit(charts: _Charts, step: Step) -> tuple[int, float, float]:
    """Halfedge through which a step leaves, the fraction along it, the moving coordinate there."""
    axis = step.direction % 2
    p = charts.uv[step.face]
    if step.enter < 0:
        start = next(
            k for k in range(3) if p[k][axis] == step.start and p[k][1 - axis] == step.level
        )
        k = (start + 1) % 3
    else:
        k = step.enter % 3
        a, o = p[k][1 - axis] - step.level, p[(k + 2) % 3][1 - axis] - step.level
        k = (k + 1) % 3 if (a > 0) == (o > 0) else (k + 2) % 3
    tail, head = p[k], p[(k + 1) % 3]
    fraction = (step.level - tail[1 - axis]) / (head[1 - axis] - tail[1 - axis])
    return 3 * step.face + k, fraction, tail[axis] + fraction * (head[axis] - tail[axis])

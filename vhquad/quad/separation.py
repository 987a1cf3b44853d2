"""What must stay apart when arcs are rounded to zero, as linear conditions on the arc lengths.

Two special vertices, two places of the features, or one of each may not fall together. Where they
do, a path between them over patches whose points fall together gives their difference in the map as
a linear form of the arc lengths; the larger component of the true difference must keep its sign
and at least one quad (Campen, Bommes & Kobbelt 2015, section 5; here found lazily). Closed curves
around handles, tubes and limbs must keep at least three quads.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from vhquad.quad.layout import Layout, side_length
from vhquad.quad.tmesh import TMesh

__all__ = ["Condition", "loop_conditions", "separation_conditions"]

Form = dict[int, int]
Ints = NDArray[np.int64]


@dataclass(frozen=True)
class Condition:
    """``sum(coefficient * lengths[arc]) >= bound``."""

    form: tuple[tuple[int, int], ...]
    bound: int


@dataclass(frozen=True)
class _Place:
    """A lattice point on the border of a patch: corner-relative position as linear forms."""

    patch: int
    point: int
    half: int
    at_end: bool
    x: tuple[tuple[int, int], ...]
    y: tuple[tuple[int, int], ...]


def _combine(a: Form, b: Form, factor: int) -> Form:
    out = dict(a)
    for k, c in b.items():
        value = out.get(k, 0) + factor * c
        if value:
            out[k] = value
        else:
            out.pop(k, None)
    return out


_TURN = ((1, 0), (0, 1), (-1, 0), (0, -1))


class _Borders:
    """Border points of patches that belong to given classes, and how patches join."""

    def __init__(self, layout: Layout, wanted: set[int]) -> None:
        self.layout = layout
        tmesh = layout.tmesh
        self.patch_side: dict[int, tuple[int, int]] = {}
        for number, patch in enumerate(tmesh.patches):
            for i, side in enumerate(patch.sides):
                for h in side:
                    self.patch_side[h] = (number, i)
        self.places: dict[tuple[int, int], list[_Place]] = {}  # (class, patch) -> places
        self.by_half: dict[tuple[int, int], list[_Place]] = {}  # (half-arc, point) -> places
        touched = set()
        for h in range(2 * len(tmesh.arcs)):
            if h in self.patch_side and wanted & set(
                layout.vertex_of[layout.half_arc_points(h)].tolist()
            ):
                touched.add(self.patch_side[h][0])
        for number in touched:
            self._add(tmesh, number, wanted)

    def value(self, form: Form) -> int:
        """A form at the present lengths."""
        lengths = self.layout.lengths
        return sum(c * (1 if k < 0 else int(lengths[k])) for k, c in form.items())

    def _add(self, tmesh: TMesh, number: int, wanted: set[int]) -> None:
        layout = self.layout
        x: Form = {}
        y: Form = {}
        for i, side in enumerate(tmesh.patches[number].sides):
            dx, dy = _TURN[i]
            for h in side:
                a = h >> 1
                points = layout.half_arc_points(h)
                classes = layout.vertex_of[points].tolist()
                for j, point in enumerate(points.tolist()):
                    if classes[j] not in wanted:
                        continue
                    # Distance from the start of the half-arc; inner points are counted from the
                    # start of the arc, by the pseudo-arc -1 that stands for the constant one.
                    if j == 0:
                        step: Form = {}
                    elif j == len(points) - 1:
                        step = {a: 1}
                    elif h & 1:
                        step = {a: 1, -1: -(len(points) - 1 - j)}
                    else:
                        step = {-1: j}
                    place = _Place(
                        number,
                        point,
                        h,
                        j == len(points) - 1,
                        tuple(_combine(x, step, dx).items()),
                        tuple(_combine(y, step, dy).items()),
                    )
                    self.places.setdefault((classes[j], number), []).append(place)
                    self.by_half.setdefault((h, point), []).append(place)
                x, y = _combine(x, {a: 1}, dx), _combine(y, {a: 1}, dy)


def separation_conditions(layout: Layout, scaled: NDArray[np.float64]) -> list[Condition]:
    """Conditions that part whatever wrongly falls together; empty if nothing does.

    Parameters
    ----------
    layout : Layout
    scaled : (a,) float64
        Wanted arc lengths in quads.
    """
    crowded = _crowded_classes(layout)
    if not crowded:
        return []
    borders = _Borders(layout, set(crowded))
    found: list[Condition] = []
    for label, groups in crowded.items():
        group_of = {point: g for g, members in enumerate(groups) for point in members}
        for g, members in enumerate(groups):
            condition = _part(borders, label, members, g, group_of, scaled)
            if condition is not None:
                found.append(condition)
    unique = dict.fromkeys(found)
    return list(unique)


def _crowded_classes(layout: Layout) -> dict[int, list[list[int]]]:
    """Classes with more than one special vertex or stretch of a feature, as groups of points."""
    tmesh = layout.tmesh
    parent: dict[int, int] = {}

    def find(x: int) -> int:
        while parent[x] != x:
            parent[x] = parent[parent[x]]
            x = parent[x]
        return x

    for node in np.flatnonzero((tmesh.node_vertex >= 0) | (tmesh.node_feature >= 0)).tolist():
        parent[node] = node
    for a, arc in enumerate(tmesh.arcs):
        if arc.feature < 0:
            continue
        points = layout.half_arc_points(2 * a).tolist()
        for point in points:
            parent.setdefault(point, point)
        if layout.lengths[a] == 0 and (
            tmesh.node_vertex[arc.start] < 0 or tmesh.node_vertex[arc.end] < 0
        ):
            parent.setdefault(arc.end, arc.end)
            parent[find(arc.end)] = find(arc.start)
    groups: dict[int, dict[int, list[int]]] = {}
    for point in parent:
        label = int(layout.vertex_of[point])
        groups.setdefault(label, {}).setdefault(find(point), []).append(point)
    # Two special vertices joined through an ordinary node on the feature stay two.
    out: dict[int, list[list[int]]] = {}
    for label, members in groups.items():
        parts: list[list[int]] = []
        for group in members.values():
            special = [q for q in group if q < len(tmesh.node_vertex) and tmesh.node_vertex[q] >= 0]
            if len(special) > 1:
                parts.extend([q] for q in special)
            else:
                parts.append(group)
        if len(parts) > 1:
            out[label] = parts
    return out


def _part(
    borders: _Borders,
    label: int,
    members: list[int],
    group: int,
    group_of: dict[int, int],
    scaled: NDArray[np.float64],
) -> Condition | None:
    """Shortest path (in patches) from a group to another group of its class, as a condition."""
    tmesh = borders.layout.tmesh
    queue: deque[tuple[_Place, Form, Form, int]] = deque()
    seen: set[tuple[int, int, int]] = set()
    own = set(members)
    for (place_label, _), places in borders.places.items():
        if place_label != label:
            continue
        for place in places:
            if place.point in own:
                seen.add((place.half, place.point, place.at_end))
                queue.append((place, {}, {}, 0))
    while queue:
        place, x, y, turn = queue.popleft()
        for other in borders.places[(label, place.patch)]:
            key = (other.half, other.point, other.at_end)
            if key in seen:
                continue
            dx = _combine(dict(other.x), dict(place.x), -1)
            dy = _combine(dict(other.y), dict(place.y), -1)
            if borders.value(dx) or borders.value(dy):
                continue  # they fell together on another way
            tx, ty = _rotated(dx, dy, turn)
            nx, ny = _combine(x, tx, 1), _combine(y, ty, 1)
            target = group_of.get(other.point)
            if target is not None and target != group:
                condition = _condition(nx, ny, scaled)
                if condition is not None:
                    return condition
                continue
            seen.add(key)
            queue.append((other, nx, ny, turn))
        # Over the arc into the next patch.
        back = place.half ^ 1
        if back not in borders.patch_side:
            continue
        side = borders.patch_side[place.half][1]
        other_side = borders.patch_side[back][1]
        for other in borders.by_half.get((back, place.point), ()):
            key = (other.half, other.point, other.at_end)
            if key in seen or (other.at_end == place.at_end and _is_end(tmesh, place)):
                continue
            seen.add(key)
            queue.append((other, x, y, (turn + side + 2 - other_side) % 4))
    return None


def _is_end(tmesh: TMesh, place: _Place) -> bool:
    arc = tmesh.arcs[place.half >> 1]
    return place.point in (arc.start, arc.end) and arc.start != arc.end


def _rotated(x: Form, y: Form, turn: int) -> tuple[Form, Form]:
    negative_x = {k: -c for k, c in x.items()}
    negative_y = {k: -c for k, c in y.items()}
    return ((x, y), (negative_y, x), (negative_x, negative_y), (y, negative_x))[turn]


def _condition(x: Form, y: Form, scaled: NDArray[np.float64]) -> Condition | None:
    """The larger true component, of those that do not depend on a free place on an arc."""
    best: tuple[float, Form] | None = None
    for form in (x, y):
        if -1 in form or not form:
            continue
        value = sum(c * scaled[k] for k, c in form.items())
        if best is None or abs(value) > abs(best[0]):
            best = (value, form)
    if best is None:
        return None
    sign = 1 if best[0] >= 0 else -1
    return Condition(tuple(sorted((k, sign * c) for k, c in best[1].items())), 1)


def loop_conditions(layout: Layout, scaled: NDArray[np.float64]) -> list[Condition]:
    """Conditions that widen tubes of one or two quads around, and quads that touch themselves.

    In each direction in which two lattice edges join the same two vertices, or one joins a vertex
    to itself, the patch with the most room left gets one more quad. Every boundary loop gets three
    edges.
    """
    q = layout.quads
    if len(q) == 0:
        return []
    tail, head = q, np.roll(q, -1, axis=1)
    low, high = np.minimum(tail, head).ravel(), np.maximum(tail, head).ravel()
    key = low * np.int64(layout.n_vertices) + high
    _, inverse, count = np.unique(key, return_inverse=True, return_counts=True)
    bad = (count[inverse] > 2) | (low == high)
    # Two quads that share two edges in a row enclose a vertex of valence two.
    opposite = (q[:, 0] == q[:, 2]) | (q[:, 1] == q[:, 3])
    bad |= np.repeat(opposite, 4)
    conditions = dict.fromkeys(_rim_conditions(layout))
    patches = layout.tmesh.patches
    by_key: dict[int, list[tuple[float, Condition]]] = {}
    for index in np.flatnonzero(bad).tolist():
        quad, k = divmod(index, 4)
        side = patches[int(layout.quad_patch[quad])].sides[k % 2]
        current = side_length(layout.lengths, side)
        room = float(sum(scaled[h >> 1] for h in side)) - current
        form: Form = {}
        for h in side:
            form[h >> 1] = form.get(h >> 1, 0) + 1
        condition = Condition(tuple(sorted(form.items())), current + 1)
        by_key.setdefault(int(key[index]), []).append((room, condition))
    for choices in by_key.values():
        conditions[max(choices, key=lambda c: c[0])[1]] = None
    return list(conditions)


def _rim_conditions(layout: Layout) -> list[Condition]:
    """Conditions for boundary loops of one or two edges, which would be one edge of the mesh."""
    tmesh = layout.tmesh
    inside = {h for patch in tmesh.patches for side in patch.sides for h in side}
    rim = [a for a in range(len(tmesh.arcs)) if not {2 * a, 2 * a + 1} <= inside]
    if not rim:
        return []
    ends = np.array([(tmesh.arcs[a].start, tmesh.arcs[a].end) for a in rim])
    n = len(tmesh.node_points)
    graph = coo_matrix((np.ones(len(rim), dtype=np.int8), (ends[:, 0], ends[:, 1])), shape=(n, n))
    loop = connected_components(graph, directed=False)[1][ends[:, 0]]
    edges = np.bincount(loop, weights=layout.lengths[rim])
    return [
        Condition(tuple((a, 1) for a, own in zip(rim, loop, strict=True) if own == thin), 3)
        for thin in np.flatnonzero((edges > 0) & (edges < 3))
    ]

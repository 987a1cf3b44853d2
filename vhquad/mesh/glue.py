"""Gluing: decide which faces meet at which edge, so that a manifold comes out of any soup.

Edges are glued in this order, each step only where it does not contradict the ones before:

1. edges that two faces share by their own vertex indices;
2. edges that two faces share after welding;
3. edges with more faces: two and two of them, those of one part of the surface first, then those
   that fit without being turned over, then any; among equals the pair nearest to a straight
   continuation, and of two as straight, the pair with the solid between them.

Faces left over have a boundary there. Vertices follow from it: corners that are reached from one
another across glued edges are one vertex, so vertices are manifold by construction.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vhquad.mesh.orient import Sides, colour
from vhquad.mesh.weld import components

__all__ = ["Gluing", "glue"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

_CROWD = 16
"""At an edge with more faces than this only neighbours in angle are candidates."""


@dataclass(frozen=True, eq=False)
class Gluing:
    """Halfedge pairs and what follows from them; halfedge h = 3 f + k."""

    first: Ints
    """(p,) a halfedge of each glued pair."""
    second: Ints
    """(p,) the other one."""
    turned: Bools
    """(m,) faces to turn over."""
    vertex: Ints
    """(m, 3) vertex of each corner, numbered by lowest corner."""
    part: Ints
    """(m,) connected part of each face."""
    crowded: int
    """Edges that more than two faces shared by their own indices."""
    cut: int
    """Edges that two faces shared by their own indices and that had to be cut."""


def glue(points: Floats, faces: Ints, weld: Ints) -> Gluing:
    """Pair the halfedges of faces without degenerate or duplicate ones.

    Parameters
    ----------
    points : (n, 3) float64
    faces : (m, 3) int64
    weld : (n,) int64
        Class of each vertex: the lowest index in it.
    """
    m = len(faces)
    label, own = weld[faces], _keys(faces, len(points))
    tail = label.reshape(-1)
    key = _keys(label, len(points))
    order = np.lexsort((own, key))
    two, many = _runs(key[order])
    twice, _ = _runs(own[order])
    plain = np.zeros(3 * m, dtype=bool)
    plain[order[two]] = True
    apart = ~plain[order[twice]]
    pairs = [order[np.stack([two, two + 1], axis=1)]]
    own_pairs = order[np.stack([twice[apart], twice[apart] + 1], axis=1)]
    same_own = own[pairs[0][:, 0]] == own[pairs[0][:, 1]]
    given = np.concatenate([pairs[0][same_own], own_pairs])
    welded = pairs[0][~same_own]

    first = colour(m, given[:, 0] // 3, given[:, 1] // 3, tail[given[:, 0]] == tail[given[:, 1]])
    a, b = welded[:, 0] // 3, welded[:, 1] // 3
    odd = (tail[welded[:, 0]] == tail[welded[:, 1]]) ^ first.turned[a] ^ first.turned[b]
    second = colour(int(first.part.max()) + 1, first.part[a], first.part[b], odd)
    part = second.part[first.part]
    turned = first.turned ^ second.turned[first.part]

    open_ = np.ones(3 * m, dtype=bool)
    open_[own_pairs] = False
    crowds = [order[s:e][open_[order[s:e]]] for s, e in many]
    extra, sides = _pair_crowds(points, label, crowds, part, turned)
    glued = np.concatenate([given[first.agrees], welded[second.agrees], extra])
    root = [sides.find(i) for i in range(int(part.max()) + 1)]
    part = np.array([r for r, _ in root], dtype=np.int64)[part]
    turned = turned ^ np.array([o for _, o in root], dtype=bool)[second.part[first.part]]
    _, count = np.unique(own, return_counts=True)
    return Gluing(
        first=glued[:, 0],
        second=glued[:, 1],
        turned=turned,
        vertex=_corner_vertices(tail, glued, m),
        part=part,
        crowded=int((count > 2).sum()),
        cut=int((~first.agrees).sum()),
    )


def _keys(faces: Ints, n: int) -> Ints:
    """low * n + high of each halfedge; (3m,)."""
    tail, head = faces.reshape(-1), np.roll(faces, -1, axis=1).reshape(-1)
    return np.asarray(np.minimum(tail, head) * np.int64(n) + np.maximum(tail, head))


def _runs(values: Ints) -> tuple[Ints, list[tuple[int, int]]]:
    """Starts of runs of exactly two equal values; start and end of longer runs."""
    start = np.flatnonzero(np.concatenate([[True], values[1:] != values[:-1]]))
    length = np.diff(np.append(start, len(values)))
    longer = length > 2
    ends = (start + length)[longer]
    return start[length == 2], list(zip(start[longer].tolist(), ends.tolist(), strict=True))


def _corner_vertices(tail: Ints, glued: Ints, m: int) -> Ints:
    """Corners joined across glued edges; (m, 3)."""
    h, g = glued[:, 0], glued[:, 1]
    next_h, next_g = h - h % 3 + (h + 1) % 3, g - g % 3 + (g + 1) % 3
    same = tail[h] == tail[g]
    a = np.concatenate([h, next_h])
    b = np.concatenate([np.where(same, g, next_g), np.where(same, next_g, g)])
    return components(3 * m, a, b).reshape(-1, 3)


# ---- edges with more than two faces; a loop over these, which are few --------------------------


def _pair_crowds(
    points: Floats, label: Ints, crowds: list[Ints], part: Ints, turned: Bools
) -> tuple[Ints, Sides]:
    """Pairs of halfedges at crowded edges, and the parts they join."""
    sides = Sides(int(part.max()) + 1)
    found: list[tuple[int, int]] = []
    waiting = []
    for crowd in crowds:
        if len(crowd) > 1:
            waiting.append(_Crowd(points, label, crowd, part, turned))
    for only_own_part in (True, False, True):
        for crowd_ in waiting:
            found += crowd_.take(sides, only_own_part)
    return np.array(found, dtype=np.int64).reshape(-1, 2), sides


class _Crowd:
    """The faces about one edge that still look for a partner."""

    def __init__(
        self, points: Floats, label: Ints, halfedges: Ints, part: Ints, turned: Bools
    ) -> None:
        f, k = halfedges // 3, halfedges % 3
        tail, head, apex = label[f, k], label[f, (k + 1) % 3], label[f, (k + 2) % 3]
        low, high = min(tail[0], head[0]), max(tail[0], head[0])
        axis = points[high] - points[low]
        axis = axis / np.linalg.norm(axis)
        arm = points[apex] - points[low]
        arm = arm - np.outer(arm @ axis, axis)
        e1 = arm[0] / max(np.linalg.norm(arm[0]), 1e-300)
        self._angle = np.arctan2(arm @ np.cross(axis, e1), arm @ e1).tolist()
        self._up = ((tail == low) ^ turned[f]).tolist()  # runs low to high once turned
        self._part = part[f].tolist()
        self._halfedge = halfedges.tolist()
        self._left = sorted(range(len(f)), key=lambda i: (self._angle[i], self._halfedge[i]))

    def take(self, sides: Sides, only_own_part: bool) -> list[tuple[int, int]]:
        """Pair what can be paired, best first; a side is turned over if need be."""
        pairs = []
        while len(self._left) > 1:
            found = [self._rate(i, j, sides) for i, j in self._candidates()]
            best = min((r for r in found if r[0] <= (0 if only_own_part else 2)), default=None)
            if best is None:
                break
            _, _, i, j = best
            sides.join(self._part[i], self._part[j], self._up[i] == self._up[j])
            pairs.append((self._halfedge[i], self._halfedge[j]))
            self._left = [k for k in self._left if k not in (i, j)]
        return pairs

    def _candidates(self) -> list[tuple[int, int]]:
        left = self._left
        if len(left) <= _CROWD:
            return [(i, j) for place, i in enumerate(left) for j in left[place + 1 :]]
        return list(zip(left, left[1:] + left[:1], strict=True))

    def _rate(self, i: int, j: int, sides: Sides) -> tuple[int, float, int, int]:
        """How ill two faces go together: kind, angle off a straight continuation, places."""
        (ri, oi), (rj, oj) = sides.find(self._part[i]), sides.find(self._part[j])
        up_i, up_j = self._up[i] ^ oi, self._up[j] ^ oj
        alike = up_i == up_j
        kind = (3 if alike else 0) if ri == rj else (2 if alike else 1)
        # The solid lies counter-clockwise from the face that runs down to the one that runs up.
        turn = self._angle[i] - self._angle[j] if up_i else self._angle[j] - self._angle[i]
        wedge = turn % (2.0 * np.pi)
        return kind, abs(np.pi - wedge) + 1e-6 * wedge, i, j

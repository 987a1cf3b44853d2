"""Isolines of an integer-grid map within single faces, and where they meet, by signs alone.

In a face of a settled map (:mod:`vhquad.quad.grid`) an isoline is a segment between two points of
the rim: crossings of edges, or pinned corners. Two segments meet if and only if their ends take
turns around the rim; where a grid point falls on an edge it counts as just left of the halfedge
of lower index, for both faces. So all faces agree, whatever the map does, folded and degenerate
faces included.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vhquad.quad.grid import STEP, SettledMap

__all__ = ["Meetings", "Segments", "face_segments", "meetings", "u_comes_first"]

Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Segments:
    """Isolines of one coordinate within the faces, in the order of the faces.

    Slot 2k of a face is its corner k, slot 2k + 1 its halfedge k; ``first < last``.
    """

    face: Ints
    level: Ints
    first: Ints
    last: Ints
    first_sign: Ints
    """Sign of (coordinate - level) on the rim just after the first end, counter-clockwise; that of
    the last end is the opposite."""
    count: Ints
    """(m,) segments of each face."""
    start: Ints
    """(m,) first segment of each face."""


@dataclass(frozen=True, eq=False)
class Meetings:
    """Where a u segment i and a v segment j meet.

    Counter-clockwise branches: to the first end of i, to an end of j, to the last end of i, to the
    other end of j.
    """

    i: Ints
    j: Ints
    flipped: Bools
    """Whether the second branch leads to the last end of j."""
    sign: Ints
    """1 where the map keeps orientation, -1 where it turns over."""


def face_segments(settled: SettledMap, twin: Ints, c: int) -> Segments:
    """All segments of the isolines of coordinate c."""
    x = settled.x[:, :, c]
    low = -((-x.min(axis=1)) // STEP)
    count = np.maximum(x.max(axis=1) // STEP - low + 1, 0)
    face = np.repeat(np.arange(len(x)), count)
    level = low[face] + np.arange(len(face)) - (np.cumsum(count) - count)[face]
    sign = np.sign(x[face] - STEP * level[:, None]).astype(np.int8)
    after = sign[:, [1, 2, 0]]
    slots = np.zeros((len(face), 6), dtype=bool)
    slots[:, 1::2] = sign * after < 0
    zero = np.flatnonzero((sign == 0).any(axis=1))  # few: pinned corners
    if zero.size:
        s, t = sign[zero], after[zero]
        # From a corner through the opposite halfedge; or, with two corners on the isoline, along
        # their edge, in one of its two faces (a boundary edge needs no segment).
        opposite = (s == 0) & (t * s[:, [2, 0, 1]] < 0)
        h = 3 * face[zero][:, None] + np.arange(3)
        edge = (s == 0) & (t == 0) & (h < twin[h]) & ((s == 0).sum(axis=1) == 2)[:, None]
        slots[zero, 0::2] = opposite | edge | edge[:, [2, 0, 1]]
        slots[zero[~(opposite | edge).any(axis=1)]] = False
    keep = np.flatnonzero(slots.any(axis=1))
    slots, face, level, after = slots[keep], face[keep], level[keep], after[keep]
    first = slots.argmax(axis=1)
    last = 5 - slots[:, ::-1].argmax(axis=1)
    row = np.arange(len(face))
    first_sign = after[row, first // 2].astype(np.int64)
    last_sign = after[row, last // 2].astype(np.int64)
    first_sign = np.where(first_sign == 0, -last_sign, first_sign)
    count = np.bincount(face, minlength=len(x))
    return Segments(face, level, first, last, first_sign, count, np.cumsum(count) - count)


def u_comes_first(settled: SettledMap, lead: Bools, face: Ints, k: Ints, point: Ints) -> Bools:
    """Whether, along halfedge k of a face, the u isoline of a grid point crosses before the v one.

    Parameters
    ----------
    settled : SettledMap
    lead : (3m,) bool
        The halfedge of each edge that decides ties: a point on it counts as left of it.
    face, k : (q,) int64
    point : (q, 2) int64
        Grid points in the units of ``settled.x``; both isolines cross the halfedge.
    """
    x = settled.x
    tail = x[face, k]
    edge, p = x[face, (k + 1) % 3] - tail, point - tail
    side = np.sign(edge[:, 0] * p[:, 1] - edge[:, 1] * p[:, 0])
    side = np.where(side == 0, np.where(lead[3 * face + k], 1, -1), side)
    return np.asarray(side * np.sign(edge[:, 0]) * np.sign(edge[:, 1]) > 0)


def meetings(settled: SettledMap, lead: Bools, u: Segments, v: Segments) -> Meetings:
    """All meetings of u and v segments inside faces."""
    many = v.count[u.face]
    i = np.repeat(np.arange(len(u.face)), many)
    j = np.arange(len(i)) - np.repeat(np.cumsum(many) - many, many) + v.start[u.face[i]]
    a, b, c, d = u.first[i], u.last[i], v.first[j], v.last[j]

    def u_place(slot: Ints) -> Ints:
        """Place around the rim, four to a slot; on a shared halfedge v takes 2, u takes 1 or 3."""
        shared = np.flatnonzero(((slot == c) | (slot == d)) & (slot % 2 == 1))
        place = 4 * slot + slot % 2
        ii, jj = i[shared], j[shared]
        point = STEP * np.stack([u.level[ii], v.level[jj]], axis=1)
        first = u_comes_first(settled, lead, u.face[ii], slot[shared] // 2, point)
        place[shared] += np.where(first, 0, 2)
        return place

    at_a, at_b = u_place(a), u_place(b)
    at_c, at_d = 4 * c + 2 * (c % 2), 4 * d + 2 * (d % 2)
    c_between = (at_a < at_c) & (at_c < at_b)
    d_between = (at_a < at_d) & (at_d < at_b)
    joint = (at_a == at_c) | (at_a == at_d) | (at_b == at_c) | (at_b == at_d)
    meet = np.flatnonzero((c_between != d_between) & ~joint)
    i, j, flipped = i[meet], j[meet], d_between[meet]
    # Where u falls below its level, and at the next end v below its own, orientation is kept.
    end_sign = np.where(flipped, -v.first_sign[j], v.first_sign[j])
    return Meetings(i, j, flipped, np.where(u.first_sign[i] < 0, -end_sign, end_sign))

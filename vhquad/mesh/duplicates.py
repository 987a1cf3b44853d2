"""Faces that lie on one another: copies, and pairs of opposite winding.

Of faces on the same three vertices at most one stays. Where as many look one way as the other,
the surface is folded flat onto itself, and there are three cases:

- a wall between two spaces, all around which at least two other faces meet: both sides go, and
  the two spaces become one;
- a single triangle that sticks out of the surface: both sides go;
- a sheet drawn from both sides: one side stays.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vhquad.mesh.weld import components

__all__ = ["Kept", "drop_copies_of_parts", "drop_duplicates"]

Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Kept:
    """Which faces stay, and how many were dropped for which reason."""

    keep: Bools
    """(m,)"""
    copies: int = 0
    """Faces dropped because another lies there with the same winding."""
    folds: int = 0
    """Faces dropped of pairs of opposite winding."""


def drop_duplicates(faces: Ints, protected: Bools | None = None) -> Kept:
    """Decide which faces stay; rows that name a vertex twice are not looked at.

    Parameters
    ----------
    faces : (m, 3) int64
        Vertex labels; equal labels are one vertex.
    protected : (m,) bool, optional
        Faces that stay in any case, and beside which no other face is needed.
    """
    m = len(faces)
    group, odd, sound = _groups(faces)
    if m == 0 or np.bincount(group).max() == 1:
        return Kept(np.ones(m, dtype=bool))
    n_groups = int(group.max()) + 1
    safe = np.zeros(m, dtype=bool) if protected is None else protected
    size = np.bincount(group, minlength=n_groups)
    net = np.bincount(group, weights=np.where(odd, -1.0, 1.0), minlength=n_groups)
    has_safe = np.bincount(group, weights=safe, minlength=n_groups) > 0

    # One face of each group: the first of the winding that prevails.
    wanted = (np.where(odd, -1.0, 1.0) * net[group] > 0) | (net[group] == 0)
    first = np.full(n_groups, m, dtype=np.int64)
    np.minimum.at(first, group[wanted], np.flatnonzero(wanted))
    keep = np.zeros(m, dtype=bool)
    keep[first] = True
    keep = np.where(has_safe[group], safe, keep) | ~sound

    folded = (net == 0) & (size > 1) & ~has_safe
    pair = folded[group] & keep & sound
    keep[np.flatnonzero(keep & sound)[_vanish(faces[keep & sound], pair[keep & sound])]] = False
    gone = ~keep
    folds = int(gone[folded[group]].sum())
    return Kept(keep, int(gone.sum()) - folds, folds)


def drop_copies_of_parts(faces: Ints, part: Ints, closed: Bools) -> Bools:
    """Faces of closed parts of which every face lies on a face of earlier closed parts; (m,).

    Parameters
    ----------
    faces : (m, 3) int64
        Vertex labels by position.
    part : (m,) int64
        Part that each face belongs to.
    closed : (m,) bool
        Whether that part is closed.
    """
    group, _, sound = _groups(faces)
    if len(faces) == 0 or np.bincount(group).max() == 1:
        return np.zeros(len(faces), dtype=bool)
    earliest = np.full(int(group.max()) + 1, int(part.max()) + 1, dtype=np.int64)
    np.minimum.at(earliest, group[closed], part[closed])
    alone = closed & sound & (earliest[group] >= part)
    has_own = np.zeros(int(part.max()) + 1, dtype=bool)
    has_own[part[alone]] = True
    return closed & ~has_own[part]


def _groups(faces: Ints) -> tuple[Ints, Bools, Bools]:
    """Group of equal vertex sets, odd order, and whether all three vertices differ; (m,) each."""
    a, b, c = np.sort(faces, axis=1).T
    order = np.lexsort((c, b, a))
    new = np.ones(len(faces), dtype=bool)
    ordered = np.stack([a, b, c], axis=1)[order]
    new[1:] = (ordered[1:] != ordered[:-1]).any(axis=1)
    sound = (a != b) & (b != c)
    new |= ~sound[order]  # each of these is a group of its own
    group = np.zeros(len(faces), dtype=np.int64)
    group[order] = np.cumsum(new) - 1
    odd = np.zeros(len(faces), dtype=bool)
    for i, j in ((0, 1), (0, 2), (1, 2)):
        odd ^= faces[:, i] > faces[:, j]
    return group, odd, sound


def _vanish(faces: Ints, pair: Bools) -> Ints:
    """Of faces without duplicates, those that stand for a fold (`pair`) and go altogether."""
    n = np.int64(faces.max() + 1) if len(faces) else np.int64(1)
    tail, head = faces.reshape(-1), np.roll(faces, -1, axis=1).reshape(-1)
    _, edge = np.unique(np.minimum(tail, head) * n + np.maximum(tail, head), return_inverse=True)
    is_pair = np.repeat(pair, 3)
    regular = np.bincount(edge, weights=~is_pair)
    folded = np.bincount(edge, weights=is_pair)

    # Regions of folds that hang together, and what meets along their rims.
    h = np.flatnonzero(is_pair)
    h = h[np.argsort(edge[h], kind="stable")]
    same = np.flatnonzero(edge[h[1:]] == edge[h[:-1]]) if len(h) else h
    region = components(len(faces), h[same] // 3, h[same + 1] // 3)
    rim = h[folded[edge[h]] == 1]
    count = int(region.max()) + 1 if len(faces) else 0
    crossing = np.zeros(count, dtype=bool)
    crossing[region[rim[regular[edge[rim]] >= 2] // 3]] = True
    loose = np.zeros(count, dtype=bool)
    loose[region[rim[regular[edge[rim]] < 2] // 3]] = True
    single = np.bincount(region[pair], minlength=count) == 1
    return np.flatnonzero(pair & crossing[region] & (~loose | single)[region])

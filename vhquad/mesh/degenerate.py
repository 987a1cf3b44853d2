"""Faces without area, removed without opening a crack.

A needle (two corners in one place) is collapsed: the two vertices become one. A cap (a corner on
the opposite side) goes, and every other face on that side is cut in two at the corner, which for a
manifold mesh is an edge flip. The longest side goes first, so that rows of collinear faces end.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vhquad.mesh.duplicates import drop_duplicates
from vhquad.mesh.weld import components

__all__ = ["Flattened", "is_degenerate", "remove_degenerate"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

_THIN = 1e-12
"""A face lower than this share of its longest side has no area."""
_ROUNDING = 8.0 * np.finfo(np.float64).eps
"""Nor has one lower than this share of its largest coordinate."""
_ROUNDS = 200


@dataclass(frozen=True, eq=False)
class Flattened:
    """Faces with area only, and what it took."""

    faces: Ints
    """(m, 3) vertices, not yet replaced by their class."""
    weld: Ints
    """(n,) class of each vertex, the lowest index in it."""
    source: Ints
    """(m,) face that each one is or was cut from."""
    removed: int
    """Faces that had no area."""
    cut: int
    """Faces cut in two."""
    copies: int
    """Faces that came to lie on another."""
    folds: int
    """Faces that came to lie on another of opposite winding."""


def is_degenerate(corners: Floats) -> tuple[Bools, Floats]:
    """Which triangles have no area, and below which length two of their corners are one.

    Parameters
    ----------
    corners : (m, 3, 3) float64

    Returns
    -------
    flat : (m,) bool
    tolerance : (m,) float64
    """
    side = np.roll(corners, -1, axis=1) - corners
    longest = np.linalg.norm(side, axis=2).max(axis=1)
    tolerance = np.maximum(_THIN * longest, _ROUNDING * np.abs(corners).max(axis=(1, 2)))
    double_area = np.linalg.norm(np.cross(side[:, 0], -side[:, 2]), axis=1)
    return double_area <= tolerance * longest, tolerance


def remove_degenerate(points: Floats, faces: Ints, weld: Ints) -> Flattened:
    """Take out faces without area.

    Parameters
    ----------
    points : (n, 3) float64
        Of about unit size, so that products neither overflow nor vanish.
    faces : (m, 3) int64
    weld : (n,) int64
        Class of each vertex: the lowest index in it.
    """
    source = np.arange(len(faces))
    removed = cut = copies = folds = 0
    for last in range(_ROUNDS + 1):
        label = weld[faces]
        distinct = (label != np.roll(label, 1, axis=1)).all(axis=1)
        faces, source, label = faces[distinct], source[distinct], label[distinct]
        removed += int((~distinct).sum())
        kept = drop_duplicates(label)
        faces, source, label = faces[kept.keep], source[kept.keep], label[kept.keep]
        copies, folds = copies + kept.copies, folds + kept.folds

        flat, tolerance = is_degenerate(points[label])
        bad = np.flatnonzero(flat)
        if last == _ROUNDS:  # never seen; a crack is better than no end
            faces, source = faces[~flat], source[~flat]
            removed += len(bad)
            break
        if len(bad) == 0:
            break
        merged = _collapse(points, label[bad], tolerance[bad], weld)
        if merged is not None:
            weld = merged
            continue
        faces, source, count = _cut_caps(points, faces, label, source, bad)
        removed += count[0]
        cut += count[1]
    return Flattened(faces, weld, source, removed, cut, copies, folds)


def _collapse(points: Floats, label: Ints, tolerance: Floats, weld: Ints) -> Ints | None:
    """Classes after joining the ends of sides of no length; None if there are none."""
    p = points[label]
    short = np.linalg.norm(np.roll(p, -1, axis=1) - p, axis=2) <= tolerance[:, None]
    if not short.any():
        return None
    a, b = label[short], np.roll(label, -1, axis=1)[short]
    group = components(len(weld), a, b)
    lowest = np.full(len(weld), len(weld), dtype=np.int64)
    np.minimum.at(lowest, group, np.arange(len(weld)))
    return np.asarray(lowest[group][weld])


def _cut_caps(
    points: Floats, faces: Ints, label: Ints, source: Ints, bad: Ints
) -> tuple[Ints, Ints, tuple[int, int]]:
    """Remove caps that share no face with one another, and cut the faces beside them."""
    n = np.int64(len(points))
    after = np.roll(label, -1, axis=1)
    key = np.minimum(label, after) * n + np.maximum(label, after)
    p = points[label[bad]]
    length = np.linalg.norm(np.roll(p, -1, axis=1) - p, axis=2)
    side = length.argmax(axis=1)
    rank = np.zeros(len(bad), dtype=np.int64)
    rank[np.lexsort((bad, -length.max(axis=1)))] = np.arange(len(bad))

    # All (cap, face beside it) pairs: halfedges with the key of a cap's long side.
    long_key = key[bad, side]
    order = np.argsort(long_key, kind="stable")
    low = np.searchsorted(long_key[order], key.reshape(-1), "left")
    high = np.searchsorted(long_key[order], key.reshape(-1), "right")
    touching = np.flatnonzero(low < high)
    low, high = low[touching], high[touching]
    cap = order[np.repeat(low, high - low) + _ramp(high - low)]
    beside = np.repeat(touching, high - low)
    other = beside // 3 != bad[cap]
    cap, beside = cap[other], beside[other]

    claim = np.full(len(faces), len(bad), dtype=np.int64)
    np.minimum.at(claim, bad, rank)
    np.minimum.at(claim, beside // 3, rank[cap])
    wins = claim[bad] == rank
    wins[cap[claim[beside // 3] != rank[cap]]] = False
    done = wins[cap]
    cap, beside = cap[done], beside[done]

    apex = faces[bad, (side + 2) % 3][cap]
    f, k = beside // 3, beside % 3
    s, t, d = faces[f, k], faces[f, (k + 1) % 3], faces[f, (k + 2) % 3]
    new = np.concatenate([np.stack([s, apex, d], 1), np.stack([apex, t, d], 1)])
    stay = np.ones(len(faces), dtype=bool)
    stay[bad[wins]] = False
    stay[f] = False
    faces = np.concatenate([faces[stay], new])
    source = np.concatenate([source[stay], source[f], source[f]])
    return faces, source, (int(wins.sum()), len(f))


def _ramp(lengths: Ints) -> Ints:
    """0..l-1 for each length l, one after the other."""
    ends = np.cumsum(lengths)
    return np.arange(int(ends[-1]) if len(ends) else 0) - np.repeat(ends - lengths, lengths)

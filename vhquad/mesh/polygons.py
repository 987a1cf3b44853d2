"""PolygonSoup: faces of any number of corners as a file has them, and their cutting into triangles.

Quads take the diagonal of two convex, well-oriented halves, the shorter one if both are; larger
polygons are cut by clipping ears in the plane of their area vector. No diagonal is used twice, nor
where the soup has an edge already, as long as there is a choice: that keeps manifold polygons
manifold.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

__all__ = ["PolygonSoup", "Triangulation", "triangulate"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class PolygonSoup:
    """Vertices and faces of any size; indices are in range, nothing else is promised."""

    vertices: Floats
    """(n, 3) positions; may hold NaN."""
    corners: Ints
    """(c,) vertex of each corner, face after face."""
    sizes: Ints
    """(k,) number of corners of each face."""
    lines: Ints = field(default_factory=lambda: np.zeros((0, 2), dtype=np.int64))
    """(l, 2) vertex pairs of the line elements of an OBJ file."""
    name: str = ""

    @property
    def n_faces(self) -> int:
        """Number of faces, k."""
        return len(self.sizes)

    @property
    def starts(self) -> Ints:
        """First corner of each face; (k,)."""
        return np.cumsum(self.sizes) - self.sizes

    @property
    def faces(self) -> list[list[int]]:
        """Each face as a list of its vertices."""
        corner = iter(self.corners.tolist())
        return [[next(corner) for _ in range(size)] for size in self.sizes.tolist()]

    def of_size(self, size: int) -> tuple[Ints, Ints]:
        """The faces with `size` corners as an (j, size) array, and their places; (j,)."""
        chosen = np.flatnonzero(self.sizes == size)
        return self.corners[self.starts[chosen][:, None] + np.arange(size)], chosen


@dataclass(frozen=True, eq=False)
class Triangulation:
    """Triangles of a polygon soup, in the order of the polygons."""

    faces: Ints
    """(m, 3)"""
    source: Ints
    """(m,) polygon that each triangle is part of."""


def triangulate(soup: PolygonSoup) -> Triangulation:
    """Cut all polygons into triangles; faces of fewer than three corners are left out.

    Parameters
    ----------
    soup : PolygonSoup

    Returns
    -------
    Triangulation
    """
    threes, at3 = soup.of_size(3)
    fours, at4 = soup.of_size(4)
    parts, sources = [threes, _cut_quads(soup, fours)], [at3, np.repeat(at4, 2)]
    starts = soup.starts
    for f in np.flatnonzero(soup.sizes > 4).tolist():
        polygon = soup.corners[starts[f] : starts[f] + soup.sizes[f]]
        with np.errstate(invalid="ignore", over="ignore"):
            parts.append(polygon[_clip_ears(soup.vertices[polygon])])
        sources.append(np.full(len(polygon) - 2, f, dtype=np.int64))
    source = np.concatenate(sources)
    order = np.argsort(source, kind="stable")
    return Triangulation(np.concatenate(parts)[order], source[order])


def _edge_keys(soup: PolygonSoup) -> Ints:
    """low * n + high of each polygon side."""
    after = np.arange(1, len(soup.corners) + 1)
    filled = soup.sizes > 0
    after[(soup.starts + soup.sizes - 1)[filled]] = soup.starts[filled]
    a, b = soup.corners, soup.corners[after]
    return np.minimum(a, b) * np.int64(len(soup.vertices)) + np.maximum(a, b)


def _cut_quads(soup: PolygonSoup, quads: Ints) -> Ints:
    """Two triangles a quad; (2 j, 3)."""
    if len(quads) == 0:
        return np.zeros((0, 3), dtype=np.int64)
    p = soup.vertices[quads]
    with np.errstate(invalid="ignore", over="ignore"):
        normal = np.cross(p[:, 2] - p[:, 0], p[:, 3] - p[:, 1])
        # Signed area of the corner triangle (k - 1, k, k + 1) against the quad's own normal.
        corner = np.cross(p - np.roll(p, 1, axis=1), np.roll(p, -1, axis=1) - p)
        area = np.einsum("jki,ji->jk", corner, normal)
        worst02 = np.minimum(area[:, 1], area[:, 3])
        worst13 = np.minimum(area[:, 0], area[:, 2])
        d02 = np.linalg.norm(p[:, 2] - p[:, 0], axis=1)
        d13 = np.linalg.norm(p[:, 3] - p[:, 1], axis=1)
        both = (worst02 > 0) & (worst13 > 0)
        first = np.where(both, d02 <= d13, worst02 >= worst13)

    n = np.int64(len(soup.vertices))
    low, high = np.minimum(quads, np.roll(quads, 2, 1)), np.maximum(quads, np.roll(quads, 2, 1))
    key = (low * n + high)[:, :2]  # of diagonals 0-2 and 1-3
    taken = _among(key, np.sort(_edge_keys(soup)))
    for _ in range(3):  # the few that clash change over, which may clash once more
        chosen = np.where(first, key[:, 0], key[:, 1])
        _, inverse, count = np.unique(chosen, return_inverse=True, return_counts=True)
        clash = (count[inverse] > 1) | np.where(first, taken[:, 0], taken[:, 1])
        other = np.where(first, key[:, 1], key[:, 0])
        free = ~np.where(first, taken[:, 1], taken[:, 0]) & ~_among(other, np.sort(chosen))
        if not (clash & free).any():
            break
        first = np.where(clash & free, ~first, first)
    cut = np.where(first[:, None], [0, 1, 2, 0, 2, 3], [0, 1, 3, 1, 2, 3])
    return np.take_along_axis(quads, cut, axis=1).reshape(-1, 3)


def _among(values: Ints, ordered: Ints) -> NDArray[np.bool_]:
    """Whether each value is one of a sorted array."""
    place = np.searchsorted(ordered, values).clip(max=len(ordered) - 1)
    return np.asarray(ordered[place] == values)


def _clip_ears(p: Floats) -> Ints:
    """Triangles of one polygon, as places in it; (s - 2, 3).

    Of the ears, the one with the shortest diagonal is cut; where rounding or a twist leaves none,
    the most convex corner.
    """
    normal = np.cross(p - p[0], np.roll(p, -1, axis=0) - p[0]).sum(axis=0)
    axis = int(np.abs(normal).argmax()) if np.isfinite(normal).all() else 2
    flat = np.delete(p, axis, axis=1) * [1.0, (-1.0 if axis == 1 else 1.0)]
    if normal[axis] < 0:
        flat = flat * [-1.0, 1.0]
    rest = np.arange(len(p))
    triangles = []
    while len(rest) > 3:
        before, after = np.roll(rest, 1), np.roll(rest, -1)
        a, b, c = flat[before], flat[rest], flat[after]
        turn = _cross(b - a, c - b)
        inside = np.ones((len(rest), len(rest)), dtype=bool)
        for start, end in ((a, b), (b, c), (c, a)):
            inside &= _cross((end - start)[:, None], flat[rest][None] - start[:, None]) >= 0
        own = (rest[None] == before[:, None]) | (rest[None] == after[:, None])
        inside[own | np.eye(len(rest), dtype=bool)] = False
        ear = (turn > 0) & ~inside.any(axis=1)
        length = np.linalg.norm(c - a, axis=1)
        k = int(np.where(ear, length, np.inf).argmin() if ear.any() else turn.argmax())
        triangles.append([before[k], rest[k], after[k]])
        rest = np.delete(rest, k)
    return np.array([*triangles, rest], dtype=np.int64)


def _cross(a: Floats, b: Floats) -> Floats:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])

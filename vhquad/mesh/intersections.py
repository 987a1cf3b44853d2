"""Self-intersections of a quad mesh: pairs of quads that cut through each other.

Boxes are tested down an implicit binary tree over the quads in Morton order, a level at a time;
the pairs that are left as two triangles each, edge against triangle. Quads that share a vertex are
not compared, and touching is no cutting: an edge must pass from one side of a triangle to the
other.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vhquad.mesh.quad import QuadMesh

__all__ = ["self_intersections"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

_CHUNK = 200_000


def self_intersections(mesh: QuadMesh) -> Ints:
    """Pairs of quads without a common vertex that cross, as the triangles of ``triangles()``.

    Parameters
    ----------
    mesh : QuadMesh
        Any; quads need not be flat.

    Returns
    -------
    (p, 2) int64
        Each pair once, the lower number first, sorted.
    """
    if mesh.n_quads < 2:
        return np.zeros((0, 2), dtype=np.int64)
    corners = mesh.vertices[mesh.quads]
    pairs = _meeting_boxes(corners.min(axis=1), corners.max(axis=1))
    a, b = mesh.quads[pairs].transpose(1, 0, 2)
    apart = np.ones(len(pairs), dtype=bool)
    for k in range(4):
        apart &= (a != np.roll(b, k, axis=1)).all(axis=1)
    pairs = pairs[apart]
    triangles = mesh.vertices[mesh.triangles()].reshape(-1, 2, 3, 3)
    crossing = np.zeros(len(pairs), dtype=bool)
    for start in range(0, len(pairs), _CHUNK):
        part = slice(start, start + _CHUNK)
        for i in (0, 1):
            for j in (0, 1):
                crossing[part] |= _cross(triangles[pairs[part, 0], i], triangles[pairs[part, 1], j])
    return np.sort(pairs[crossing], axis=1)[np.lexsort(np.sort(pairs[crossing], axis=1).T[::-1])]


def _meeting_boxes(low: Floats, high: Floats) -> Ints:
    """Pairs of axis-parallel boxes that meet; (p, 2)."""
    count = len(low)
    depth = int(np.ceil(np.log2(count)))
    order = _morton_order(0.5 * (low + high))
    empty = 2**depth - count
    lows = [np.concatenate([low[order], np.full((empty, 3), np.inf)])]
    highs = [np.concatenate([high[order], np.full((empty, 3), -np.inf)])]
    for _ in range(depth):
        lows.append(np.minimum(lows[-1][::2], lows[-1][1::2]))
        highs.append(np.maximum(highs[-1][::2], highs[-1][1::2]))
    a = b = np.zeros(1, dtype=np.int64)
    for level in range(depth - 1, -1, -1):
        same = a == b
        x, y = a[same], a[~same]
        z = b[~same]
        a = np.concatenate([2 * x, 2 * x + 1, 2 * x, 2 * y, 2 * y, 2 * y + 1, 2 * y + 1])
        b = np.concatenate([2 * x, 2 * x + 1, 2 * x + 1, 2 * z, 2 * z + 1, 2 * z, 2 * z + 1])
        meet = np.ones(len(a), dtype=bool)
        for axis in range(3):
            lo, hi = lows[level][:, axis], highs[level][:, axis]
            meet &= (lo[a] <= hi[b]) & (lo[b] <= hi[a])
        a, b = a[meet], b[meet]
    different = a != b
    return np.stack([order[a[different]], order[b[different]]], axis=1)


def _morton_order(points: Floats) -> Ints:
    """Order along a Z curve, which keeps near points near."""
    low = points.min(axis=0)
    size = float((points.max(axis=0) - low).max())
    cell = ((points - low) * (1023.0 / size if size > 0 else 0.0)).astype(np.int64)
    code = np.zeros(len(points), dtype=np.int64)
    for bit in range(10):
        for axis in range(3):
            code |= ((cell[:, axis] >> bit) & 1) << (3 * bit + axis)
    return np.argsort(code, kind="stable")


def _cross(p: Floats, q: Floats) -> Bools:
    """Whether triangles (n, 3, 3) cut through each other, pair by pair."""
    found = np.zeros(len(p), dtype=bool)
    sides_p, sides_q = _sides(p, q), _sides(q, p)
    maybe = np.flatnonzero(_straddles(sides_p) & _straddles(sides_q))
    p, q = p[maybe], q[maybe]
    hit = _edge_through(p, sides_p[maybe], q) | _edge_through(q, sides_q[maybe], p)
    found[maybe] = hit
    return found


def _sides(p: Floats, q: Floats) -> Floats:
    """Heights of the corners of p over the plane of q, times twice its area; (n, 3)."""
    normal = np.cross(q[:, 1] - q[:, 0], q[:, 2] - q[:, 0])
    return np.asarray(np.einsum("nki,ni->nk", p - q[:, :1], normal))


def _straddles(sides: Floats) -> Bools:
    return np.asarray((sides.min(axis=1) < 0) & (sides.max(axis=1) > 0))


def _edge_through(p: Floats, sides: Floats, q: Floats) -> Bools:
    """Whether an edge of p passes through q, its rim included; (n,)."""
    found = np.zeros(len(p), dtype=bool)
    for k in range(3):
        start, end = p[:, k], p[:, (k + 1) % 3]
        opposite = sides[:, k] * sides[:, (k + 1) % 3] < 0
        # On which side the line passes each edge of q: volumes of tetrahedra.
        line, rel = end - start, q - start[:, None]
        volume = np.einsum("ni,nki->nk", line, np.cross(rel, np.roll(rel, -1, axis=1)))
        found |= opposite & ((volume >= 0).all(axis=1) | (volume <= 0).all(axis=1))
    return found

"""The quad mesh that integer arc lengths stand for: every patch a grid, grids glued along arcs.

Where a patch has a side of length zero, its two long sides (or all of it) become one: points that
fall together form a class, and each class is one vertex of the quad mesh.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from vhquad.quad.tmesh import Patch, TMesh

__all__ = ["Layout", "build_layout"]

Ints = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Layout:
    """Connectivity of the quad mesh over a T-mesh.

    Lattice points are numbered: nodes of the T-mesh first, then inner points of the arcs, then
    inner points of the patches. Vertices are classes of points.

    Attributes
    ----------
    lengths : (a,) int64
        Quads along each arc.
    arc_offset : (a,) int64
        Number of the first inner point of each arc.
    patch_offset : (p,) int64
        Number of the first inner point of each patch.
    n_points : int
    vertex_of : (n_points,) int64
        Vertex of each lattice point.
    n_vertices : int
    quads : (k, 4) int64
        Vertices, counter-clockwise.
    quad_patch : (k,) int64
        Patch of each quad.
    """

    tmesh: TMesh
    lengths: Ints
    arc_offset: Ints
    patch_offset: Ints
    n_points: int
    vertex_of: Ints
    n_vertices: int
    quads: Ints
    quad_patch: Ints

    def half_arc_points(self, half: int) -> Ints:
        """Lattice points along a half-arc, ends included; only its start if its length is zero."""
        arc = self.tmesh.arcs[half >> 1]
        n = int(self.lengths[half >> 1])
        first, last = (arc.end, arc.start) if half & 1 else (arc.start, arc.end)
        out = np.full(n + 1, first, dtype=np.int64)
        if n > 0:
            inner = self.arc_offset[half >> 1] + np.arange(n - 1)
            out[1:n] = inner[:: -1 if half & 1 else 1]
            out[n] = last
        return out

    def side_points(self, side: tuple[int, ...]) -> Ints:
        """Lattice points along a side of a patch, ends included."""
        return _side_points(self, side)

    def grid(self, patch: int) -> Ints:
        """Lattice points of a patch as an (a + 1, b + 1) array, first index along side 0."""
        p = self.tmesh.patches[patch]
        bottom, right, top, left = (_side_points(self, side) for side in p.sides)
        return _grid(bottom, right, top, left, int(self.patch_offset[patch]))


def _side_points(layout: Layout, side: tuple[int, ...]) -> Ints:
    parts = [layout.half_arc_points(h) for h in side]
    return np.concatenate([parts[0][:1], *(p[1:] for p in parts)])


def _grid(bottom: Ints, right: Ints, top: Ints, left: Ints, first: int) -> Ints:
    a, b = len(bottom) - 1, len(right) - 1
    g = np.full((a + 1, b + 1), -1, dtype=np.int64)
    if a > 1 and b > 1:
        g[1:a, 1:b] = first + np.arange((a - 1) * (b - 1)).reshape(a - 1, b - 1)
    g[:, 0] = bottom
    g[:, b] = top[::-1]
    g[a, :] = right
    g[0, :] = left[::-1]
    g[0, 0], g[a, 0], g[a, b], g[0, b] = bottom[0], bottom[-1], top[0], top[-1]
    return g


def side_length(lengths: Ints, side: tuple[int, ...]) -> int:
    """Quads along a side of a patch."""
    return int(sum(lengths[h >> 1] for h in side))


def build_layout(tmesh: TMesh, lengths: Ints) -> Layout:
    """Glue the grids of all patches.

    Parameters
    ----------
    tmesh : TMesh
    lengths : (a,) int64
        Quads along each arc, not negative; opposite sides of every patch must agree.
    """
    lengths = np.asarray(lengths, dtype=np.int64)
    inner = np.maximum(lengths - 1, 0)
    n_nodes = len(tmesh.node_points)
    arc_offset = n_nodes + np.concatenate([[0], np.cumsum(inner)])[:-1]
    width = np.array([side_length(lengths, p.sides[0]) for p in tmesh.patches])
    height = np.array([side_length(lengths, p.sides[1]) for p in tmesh.patches])
    inside = np.maximum(width - 1, 0) * np.maximum(height - 1, 0)
    total_arcs = n_nodes + int(inner.sum())
    patch_offset = total_arcs + np.concatenate([[0], np.cumsum(inside)])[:-1]
    n_points = total_arcs + int(inside.sum())
    draft = Layout(
        tmesh, lengths, arc_offset, patch_offset, n_points,
        np.arange(n_points), n_points, np.zeros((0, 4), np.int64), np.zeros(0, np.int64),
    )  # fmt: skip

    zero = np.flatnonzero(lengths == 0)
    pairs = [np.array([[tmesh.arcs[a].start, tmesh.arcs[a].end] for a in zero]).reshape(-1, 2)]
    quads, owner = [], []
    for number, patch in enumerate(tmesh.patches):
        w, h = width[number], height[number]
        if w > 0 and h > 0:
            g = draft.grid(number)
            cells = np.stack([g[:-1, :-1], g[1:, :-1], g[1:, 1:], g[:-1, 1:]], axis=2)
            quads.append(cells.reshape(-1, 4))
            owner.append(np.full(w * h, number))
        elif w > 0 or h > 0:
            pairs.append(_glued(draft, patch, bool(w > 0)))
    link = np.concatenate(pairs)
    graph = coo_matrix(
        (np.ones(len(link), dtype=np.int8), (link[:, 0], link[:, 1])), shape=(n_points, n_points)
    )
    n_vertices, label = connected_components(graph, directed=False)
    vertex_of = np.asarray(label, dtype=np.int64)
    cells = np.concatenate(quads) if quads else np.zeros((0, 4), dtype=np.int64)
    return Layout(
        tmesh=tmesh,
        lengths=lengths,
        arc_offset=arc_offset,
        patch_offset=patch_offset,
        n_points=n_points,
        vertex_of=vertex_of,
        n_vertices=int(n_vertices),
        quads=np.asarray(vertex_of[cells]),
        quad_patch=np.concatenate(owner) if owner else np.zeros(0, dtype=np.int64),
    )


def _glued(draft: Layout, patch: Patch, wide: bool) -> Ints:
    """Pairs of points that a patch without height (or width) makes one."""
    first = draft.side_points(patch.sides[0 if wide else 1])
    second = draft.side_points(patch.sides[2 if wide else 3])[::-1]
    return np.stack([first, second], axis=1)

"""Vertices bound to polylines: boundary and crease vertices slide along their curves exactly."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vhquad.errors import MeshError
from vhquad.mesh.vectors import nearest_share

__all__ = ["CurveConstraints"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class CurveConstraints:
    """Which vertices must stay on which polyline.

    Parameters
    ----------
    polylines : sequence of (p_i, 3) array_like
        Points of each curve in order, in mesh units. A closed curve does not repeat its first
        point.
    closed : sequence of bool
        Whether each curve closes up.
    curve : (n,) array_like of int
        Index of the curve of each mesh vertex, -1 for a vertex that no curve binds.

    Raises
    ------
    MeshError
        If lengths disagree, a curve has fewer than two points or no length, or ``curve`` names
        a curve that is not there.
    """

    points: Floats  # all curves one after another, closed ones with the first point repeated
    start: Ints  # (c + 1,) first point of each curve in ``points``
    closed: NDArray[np.bool_]  # (c,)
    curve: Ints  # (n,)
    arc: Floats  # arc length at each point, going on from curve to curve without a gap

    def __init__(
        self, polylines: Sequence[ArrayLike], closed: Sequence[bool], curve: ArrayLike
    ) -> None:
        lines = [np.array(line, dtype=np.float64).reshape(-1, 3) for line in polylines]
        loops = np.array(closed, dtype=bool).reshape(-1)
        if len(loops) != len(lines):
            raise MeshError(f"{len(lines)} polylines but {len(loops)} closed flags")
        of = np.array(curve, dtype=np.int64)
        if of.size and (of.min() < -1 or of.max() >= len(lines)):
            raise MeshError(f"vertices name curves outside -1..{len(lines) - 1}")
        lines = [
            np.concatenate([line, line[:1]]) if loop else line
            for line, loop in zip(lines, loops, strict=True)
        ]
        for i, line in enumerate(lines):
            if len(line) < 2 or not (line != line[0]).any():
                raise MeshError(f"curve {i} has no length; drop it or fix its vertices instead")
        points = np.concatenate([*lines, np.zeros((0, 3))])
        start = np.cumsum([0, *(len(line) for line in lines)])
        step = np.zeros(len(points))
        step[1:] = np.linalg.norm(np.diff(points, axis=0), axis=1)
        step[start[:-1]] = 0.0
        for name, value in (
            ("points", points),
            ("start", start.astype(np.int64)),
            ("closed", loops),
            ("curve", of),
            ("arc", np.cumsum(step)),
        ):
            object.__setattr__(self, name, value)

    @classmethod
    def none(cls, n_vertices: int) -> CurveConstraints:
        """No curve at all, for a mesh of n vertices."""
        return cls([], [], np.full(n_vertices, -1))

    def bind(self, curve: Ints) -> CurveConstraints:
        """The same curves for other vertices: vertex i lies on curve ``curve[i]``, -1 for none."""
        other = object.__new__(CurveConstraints)
        for name in ("points", "start", "closed", "arc"):
            object.__setattr__(other, name, getattr(self, name))
        object.__setattr__(other, "curve", curve)
        return other

    def wrap(self, vertices: Ints, arc: Floats) -> Floats:
        """Bring arc lengths back to the curves of the vertices: modulo if closed, else clamped."""
        c = self.curve[vertices]
        low, high = self.arc[self.start[c]], self.arc[self.start[c + 1] - 1]
        around = low + np.mod(arc - low, high - low)
        return np.where(self.closed[c], around, np.clip(arc, low, high))

    def position(self, vertices: Ints, arc: Floats) -> Floats:
        """Points of the curves of the vertices at the arc lengths (wrapped); (q, 3)."""
        c = self.curve[vertices]
        s = self.wrap(vertices, arc)
        k = np.searchsorted(self.arc, s, side="right") - 1
        k = np.clip(k, self.start[c], self.start[c + 1] - 2)
        length = self.arc[k + 1] - self.arc[k]
        t = np.divide(s - self.arc[k], length, out=np.zeros_like(s), where=length > 0)
        t = np.clip(t, 0.0, 1.0)[:, None]
        return np.asarray((1.0 - t) * self.points[k] + t * self.points[k + 1])

    def tangent(self, vertices: Ints, arc: Floats, reach: Floats) -> Floats:
        """Unit chord from ``reach`` before to ``reach`` after each arc length; (q, 3)."""
        chord = self.position(vertices, arc + reach) - self.position(vertices, arc - reach)
        length = np.linalg.norm(chord, axis=1, keepdims=True)
        return np.divide(chord, length, out=np.zeros_like(chord), where=length > 0)

    def locate(self, vertices: Ints, points: Floats) -> Floats:
        """Arc length of the point nearest to each given point on its vertex's curve; (q,)."""
        arc = np.zeros(len(vertices))
        curve = self.curve[vertices]
        for c in np.unique(curve):  # curves are few
            a = self.points[self.start[c] : self.start[c + 1] - 1]
            along = self.points[self.start[c] + 1 : self.start[c + 1]] - a
            mine = np.flatnonzero(curve == c)
            for chunk in np.array_split(mine, 1 + len(mine) * len(a) // 2_000_000):
                near = points[chunk][:, None, :]
                t = nearest_share(near, a, along)
                gap = near - a - t[..., None] * along
                best = np.einsum("qsi,qsi->qs", gap, gap).argmin(axis=1)
                k = self.start[c] + best
                share = t[np.arange(len(chunk)), best]
                arc[chunk] = self.arc[k] + share * (self.arc[k + 1] - self.arc[k])
        return arc

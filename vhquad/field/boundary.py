"""Directions of the boundary: where it truly turns (corners), and smooth tangents in between.

Along a loop of boundary halfedges, let ``psi`` be the direction of each edge unrolled along the
loop: it turns left by pi less the interior angle at each vertex. A vertex is a *corner* where the
one-sided means of ``psi`` before and behind it differ by more than a threshold; between corners
``psi`` is replaced by a local linear fit, and ``lean`` is what that changed. On a rough boundary
the quads then follow the smooth course, not each edge.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vhquad.field.matching import label_sectors
from vhquad.mesh.triangle import TriMesh

__all__ = ["BoundaryTangents", "boundary_tangents"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

CORNER_TURN = np.radians(50.0)
MOST_LEAN = np.radians(60.0)  # beyond 90 degrees the map would run against the edge


@dataclass(frozen=True, eq=False)
class BoundaryTangents:
    """Smooth boundary directions.

    Attributes
    ----------
    lean : (3m,) float64
        Angle from each boundary halfedge to the smooth tangent there, radians; 0 elsewhere.
    corner : (3m,) bool
        Boundary halfedges that start at a corner.
    """

    lean: Floats
    corner: Bools


@dataclass(frozen=True, eq=False)
class _Loop:
    """A closed polyline by its edges: lengths, unrolled directions, the total turn."""

    length: Floats
    direction: Floats
    turn: float

    @property
    def start(self) -> Floats:
        """Arc length at the start of each edge."""
        return np.concatenate([[0.0], np.cumsum(self.length)[:-1]])

    @property
    def perimeter(self) -> float:
        return float(self.length.sum())

    def rolled(self, first: int) -> _Loop:
        """The same loop from another edge on."""
        direction = np.concatenate([self.direction[first:], self.direction[:first] + self.turn])
        return _Loop(np.roll(self.length, -first), direction, self.turn)

    def around(self, offset: int) -> tuple[Floats, Floats, Floats]:
        """Length, start and direction of the edge ``offset`` places on, unrolled along the loop."""
        index = np.arange(len(self.length)) + offset
        wraps, index = np.divmod(index, len(self.length))
        start = self.start[index] + wraps * self.perimeter
        return self.length[index], start, self.direction[index] + wraps * self.turn

    def reach(self, distance: float) -> int:
        """Most edges that lie within a distance of a point, on one side."""
        n = len(self.length)
        ends = np.concatenate([self.start, self.start + self.perimeter])
        return int((np.searchsorted(ends, self.start + distance) - np.arange(n)).max()) + 1


def boundary_tangents(
    mesh: TriMesh, size: Floats | float, seam: Bools | None = None
) -> BoundaryTangents:
    """Find corners and smooth tangents of every boundary loop.

    Parameters
    ----------
    mesh : TriMesh
    size : (m,) float64, or float
        Edge length of the quads to come. Half its mean along a loop is the window that corners are
        judged by (at least two boundary edges, at most a sixth of the loop).
    seam : (3m,) bool, optional
        Boundary halfedges beyond which the surface goes on, mirrored: within them there is no
        convex corner, however sharp.
    """
    lean = np.zeros(3 * mesh.n_faces)
    corner = np.zeros(3 * mesh.n_faces, dtype=bool)
    length = mesh.edge_lengths.reshape(-1)
    edge_length = np.broadcast_to(np.asarray(size, dtype=np.float64), mesh.n_faces)
    fan = label_sectors(mesh, mesh.twin < 0)[1]
    angle = np.bincount(fan, mesh.corner_angles.reshape(-1))
    for h in mesh.boundary_loops:  # few
        turns = np.pi - angle[fan[h]]  # at the tail of each halfedge
        loop = _Loop(length[h], np.cumsum(turns) - turns[0], float(turns.sum()))
        window = max(0.5 * float(edge_length[h // 3].mean()), 2.0 * loop.perimeter / len(h))
        window = min(window, loop.perimeter / 6.0)
        at = _corners(loop, window)
        if seam is not None:
            at = at[~(seam[h[at]] & seam[h[at - 1]] & (turns[at] > 0))]
        corner[h[at]] = True
        first = int(at[0]) if at.size else 0
        rolled, segment = loop.rolled(first), np.zeros(len(h), dtype=np.int64)
        segment[at - first] = 1
        smooth = _fit(rolled, np.cumsum(segment) if at.size else None, 0.5 * window)
        change = np.clip(smooth - rolled.direction, -MOST_LEAN, MOST_LEAN)
        lean[np.roll(h, -first)] = change
    return BoundaryTangents(lean, corner)


def _corners(loop: _Loop, window: float) -> Ints:
    """Edges at whose start the loop turns sharply, strongest first suppressing its neighbours."""

    def weight(near: Floats, far: Floats) -> Floats:
        """Integral of 1 - d / window from near to far, d capped at the window."""
        near, far = np.minimum(near, window), np.minimum(far, window)
        return (far - near) * (1.0 - 0.5 * (far + near) / window)

    here = loop.start
    means = []
    for ahead in (True, False):
        total = np.zeros(len(here))
        mass = np.zeros(len(here))
        for k in range(min(loop.reach(window), len(here))):
            length, start, direction = loop.around(k if ahead else -1 - k)
            near = start - here if ahead else here - start - length
            w = weight(np.maximum(near, 0.0), near + length)
            total += w * direction
            mass += w
        means.append(total / mass)
    turn = np.abs(means[0] - means[1])
    corners: list[int] = []
    for i in np.argsort(-turn, kind="stable"):
        if turn[i] <= CORNER_TURN:
            break
        gap = np.abs(here[corners] - here[i])
        if (np.minimum(gap, loop.perimeter - gap) >= 0.5 * window).all():
            corners.append(int(i))
    return np.sort(np.array(corners, dtype=np.int64))


def _fit(loop: _Loop, segment: Ints | None, sigma: float) -> Floats:
    """Local linear fit of the direction at the middle of each edge, within its segment."""
    n = len(loop.length)
    middle = loop.start + 0.5 * loop.length
    sums = np.zeros((5, n))
    reach = min(loop.reach(3.0 * sigma), n - 1 if segment is not None else (n - 1) // 2)
    for k in range(-reach, reach + 1):
        length, start, direction = loop.around(k)
        x = start + 0.5 * length - middle
        w = length * np.exp(-0.5 * (x / sigma) ** 2)
        if segment is not None:
            index = np.arange(n) + k
            inside = (index >= 0) & (index < n)
            w = np.where(inside & (segment[index % n] == segment), w, 0.0)
        y = direction - loop.direction
        sums += w * np.stack([np.ones(n), x, x * x, y, x * y])
    s0, s1, s2, t0, t1 = sums
    spread = s0 * s2 - s1 * s1
    linear = spread > 1e-6 * s0 * s0 * sigma**2
    fitted = np.where(linear, (s2 * t0 - s1 * t1) / np.where(linear, spread, 1.0), t0 / s0)
    return np.asarray(loop.direction + fitted)

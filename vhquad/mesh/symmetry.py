"""Mirror planes: is a surface its own mirror image, and in which plane.

A plane is judged by how far the mirrored surface is from the surface: the median and the 95 %
quantile of the distances of mirrored samples, as shares of the diagonal. Candidates pass through
the area centroid with a normal along a coordinate or a principal axis (or, where those fail, along
one of many directions), and are refined as in iterative closest points: mirrored samples are drawn
towards their closest points by robust least squares in the plane's three degrees of freedom.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vhquad.errors import MeshError
from vhquad.mesh.closest import ClosestPoints
from vhquad.mesh.distance import sample_surface
from vhquad.mesh.plane import MirrorPlane
from vhquad.mesh.triangle import TriMesh

__all__ = ["LARGEST_MEDIAN", "LARGEST_TAIL", "Symmetry", "find_symmetry"]

Floats = NDArray[np.float64]

LARGEST_MEDIAN = 0.005
"""Share of the diagonal that half of the mirrored surface must keep within to be symmetric."""
LARGEST_TAIL = 0.015
"""The same for 95 % of it: a handle on one side only is no symmetry."""

_SAMPLES = 2000
_FEW = 300  # samples for the first look at a candidate
_DIRECTIONS = 100
_PROMISING = 6.0  # times LARGEST_MEDIAN; a candidate worse than that is not refined
_STEPS = 20
_BLUR = 0.002  # share of the diagonal within which all samples count in full
_CLEAN = 0.01  # a plane this near (radians, share of the diagonal) a coordinate plane may become it
_TIE = 0.0005  # scores that differ less count as equal


@dataclass(frozen=True, eq=False)
class Symmetry:
    """A plane and how well the surface agrees with its mirror image, in shares of the diagonal."""

    plane: MirrorPlane
    median: float
    """Median distance of the mirrored surface from the surface."""
    tail: float
    """95 % of the mirrored surface is nearer than this."""

    @property
    def score(self) -> float:
        """To rank planes by; less is better."""
        return self.median + 0.25 * self.tail

    @property
    def holds(self) -> bool:
        """Whether this counts as a symmetric surface."""
        return self.median < LARGEST_MEDIAN and self.tail < LARGEST_TAIL


def find_symmetry(mesh: TriMesh, axis: int | None = None) -> Symmetry:
    """The best mirror plane that is found; whether the surface is symmetric is for `holds` to say.

    Parameters
    ----------
    mesh : TriMesh
    axis : int, optional
        0, 1 or 2: the normal is this coordinate axis, and only the offset is sought.

    Returns
    -------
    Symmetry
        Planes across coordinate axes, and those through the origin, are preferred where they are
        about as good.

    Raises
    ------
    MeshError
        If `axis` is something else.
    """
    if axis not in (None, 0, 1, 2):
        raise MeshError(f"axis must be 0, 1, 2 or None, not {axis!r}")
    search = _Search(mesh)
    if axis is not None:
        middle = 0.5 * (mesh.vertices.max(axis=0) + mesh.vertices.min(axis=0))
        offsets = [float(search.centre[axis]), float(middle[axis])]
        starts = [MirrorPlane(np.eye(3)[axis], c) for c in offsets]
        return search.best([search.refined(p, False) for p in starts])
    across = [MirrorPlane(n, float(n @ search.centre)) for n in np.eye(3)]
    inertia = np.linalg.eigh(np.cov(search.points.T))[1].T
    tilted = [MirrorPlane(n, float(n @ search.centre)) for n in inertia]
    found = search.best(
        [search.refined(p, False) for p in across] + [search.refined(p, True) for p in tilted]
    )
    if not found.holds:
        some = [MirrorPlane(n, float(n @ search.centre)) for n in _directions(_DIRECTIONS)]
        some = sorted(some, key=lambda p: search.judge(p, search.few).median)[:4]
        found = search.best([found, *(search.refined(p, True) for p in some)])
    return found


class _Search:
    """Samples of a surface and its closest points, for many planes."""

    def __init__(self, mesh: TriMesh) -> None:
        self.mesh = mesh
        self.surface = ClosestPoints(mesh)
        spread = sample_surface(mesh.vertices, mesh.faces, _SAMPLES)
        order = np.random.default_rng(0).permutation(len(spread.point))
        # Samples stand for unlike areas where triangles are larger than their share.
        chance = spread.area / spread.area.sum()
        pick = np.searchsorted(np.cumsum(chance[order]), (np.arange(_SAMPLES) + 0.5) / _SAMPLES)
        self.points = spread.point[order[pick.clip(max=len(order) - 1)]]
        self.few = self.points[np.random.default_rng(1).permutation(_SAMPLES)[:_FEW]]
        middle = mesh.vertices[mesh.faces].mean(axis=1)
        self.centre = np.average(middle, axis=0, weights=mesh.face_areas)

    def judge(self, plane: MirrorPlane, points: Floats | None = None) -> Symmetry:
        """How a plane does."""
        samples = self.points if points is None else points
        gap = self.surface.distance(plane.reflect(samples)) / self.mesh.diagonal
        return Symmetry(plane, float(np.median(gap)), float(np.quantile(gap, 0.95)))

    def refined(self, start: MirrorPlane, tilt: bool) -> Symmetry:
        """The best plane near a start, or a simple one about as good; turned only if `tilt`."""
        best = self.judge(start)
        if tilt and best.median > _PROMISING * LARGEST_MEDIAN:
            return best
        plane = start
        for _ in range(_STEPS):
            plane = self._step(plane, tilt)
            now = self.judge(plane)
            if now.score >= (1.0 - 1e-3) * best.score:
                break
            best = now
        return self.best([*self._simpler(best.plane), best])

    def _step(self, plane: MirrorPlane, tilt: bool) -> MirrorPlane:
        """One robust Gauss-Newton step of the mirrored samples towards the surface."""
        n, p, size = plane.normal, self.points, self.mesh.diagonal
        hits = self.surface.query(plane.reflect(p))
        gap = plane.reflect(p) - hits.point
        # The distance grows along the gap, which is the normal except at borders and ridges.
        known = hits.distance[:, None] > 1e-9 * size
        m = np.where(known, gap, self.mesh.face_normals[hits.face])
        m /= np.linalg.norm(m, axis=1, keepdims=True)
        residual = np.einsum("si,si->s", m, gap)
        # With f the foot of the centre in the plane, n . p - c is n . (p - f); moving the plane by
        # dc and turning it about f by dn moves an image by 2 dc n - 2 (dn . (p - f)) n - 2 h dn.
        foot = plane.project(self.centre)
        across = np.linalg.svd(n[None])[2][1:] if tilt else np.zeros((0, 3))
        turning = [((p - foot) @ e) * (m @ n) + plane.height(p) * (m @ e) for e in across]
        jacobian = np.stack([2.0 * (m @ n), *(-2.0 * t / size for t in turning)], axis=1)
        scale = 4.0 * np.median(hits.distance) + _BLUR * size
        weight = 1.0 / (1.0 + (hits.distance / scale) ** 2) ** 2
        matrix = (jacobian * weight[:, None]).T @ jacobian
        # The damping: every plane through the middle of a sphere is as good as any other.
        matrix += 1e-3 * weight.sum() * np.eye(len(matrix))
        step = -np.linalg.solve(matrix, (jacobian * weight[:, None]).T @ residual)
        if not tilt:
            return MirrorPlane(n, plane.offset + step[0])
        turned = n + step[1:] / size @ across
        turned /= np.linalg.norm(turned)
        return MirrorPlane(turned, turned @ foot + step[0])

    def _simpler(self, plane: MirrorPlane) -> list[Symmetry]:
        """Planes across an axis, and through the origin, that are near a plane; simplest first."""
        size, axis = self.mesh.diagonal, int(np.abs(plane.normal).argmax())
        found = []
        if plane.axis is None:
            if np.linalg.norm(np.delete(plane.normal, axis)) > _CLEAN:
                return []
            across = MirrorPlane(np.eye(3)[axis], plane.project(self.centre)[axis])
            found = [self.refined(across, False)]
            plane = found[0].plane
        if 0 < abs(plane.offset) < _CLEAN * size:
            found.insert(0, self.judge(MirrorPlane(plane.normal, 0.0)))
        return found

    def best(self, found: list[Symmetry]) -> Symmetry:
        """The one with the least score; of about equal ones the first."""
        scores = np.array([s.score for s in found])
        near = scores <= 1.1 * scores.min() + _TIE
        return found[int(np.flatnonzero(near)[0])]


def _directions(count: int) -> Floats:
    """Directions spread evenly over half a sphere (a Fibonacci spiral); (count, 3)."""
    z = (np.arange(count) + 0.5) / count
    turn = np.pi * (3.0 - np.sqrt(5.0)) * np.arange(count)
    r = np.sqrt(1.0 - z * z)
    return np.stack([r * np.cos(turn), r * np.sin(turn), z], axis=1)

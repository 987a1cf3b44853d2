"""ClosestPoints: the nearest surface point of a triangle mesh, with its face and barycentrics."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import igl
import numpy as np
from numpy.typing import ArrayLike, NDArray

from vhquad.errors import MeshError
from vhquad.mesh.triangle import TriMesh
from vhquad.mesh.vectors import cross

__all__ = ["ClosestPoints", "Hits", "closest_barycentrics"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

LOW = 0.5  # height of a query above a face, of its distance from the edges, to be answered there
_NEXT = np.array([1, 2, 0])  # after each corner of a triangle


@dataclass(frozen=True, eq=False)
class Hits:
    """Closest points of q queries; ``point = barycentric @ corners of face``."""

    query: Floats
    """(q, 3) the queries."""
    face: Ints
    """(q,) face that holds the closest point."""
    barycentric: Floats
    """(q, 3) weights of the face's corners, each in [0, 1], summing to 1."""
    point: Floats
    """(q, 3) closest point."""

    @cached_property
    def distance(self) -> Floats:
        """Distance of each closest point from its query, mesh units; (q,)."""
        return np.asarray(np.linalg.norm(self.query - self.point, axis=1))

    def interpolate(self, corner_values: ArrayLike) -> NDArray[Any]:
        """Values at the closest points of a linear function given at face corners.

        Parameters
        ----------
        corner_values : (m, 3, ...) array_like
            Value at corner k of face f; ``x[mesh.faces]`` for a value x per vertex.

        Returns
        -------
        (q, ...) ndarray
        """
        return np.einsum("qk,qk...->q...", self.barycentric, np.asarray(corner_values)[self.face])


class ClosestPoints:
    """Closest-point queries on one mesh; the tree is built once, at construction.

    Parameters
    ----------
    mesh : TriMesh
        Any triangles; topology is not looked at. Kept as the attribute ``mesh``.
    """

    def __init__(self, mesh: TriMesh) -> None:
        self.mesh = mesh
        self._vertices, self._faces = mesh.vertices, mesh.faces
        self._tree = igl.AABB()
        self._tree.init(self._vertices, self._faces)

    def query(self, points: ArrayLike) -> Hits:
        """Closest surface point of each query point.

        Parameters
        ----------
        points : (q, 3) array_like

        Returns
        -------
        Hits

        Raises
        ------
        MeshError
            If the points are not (q, 3) and finite.
        """
        p, _, face = self._search(points)
        corners = self._vertices[self._faces[face]]
        barycentric = closest_barycentrics(corners, p)
        point = np.einsum("qk,qki->qi", barycentric, corners)
        return Hits(p, face, barycentric, point)

    def query_near(self, points: ArrayLike, faces: ArrayLike) -> Hits:
        """Closest point of each query that a walk downhill finds, at most two faces a step.

        Where sheets nearly touch, the closest point of all may be on the other one; this stays on
        the sheet of the starting face.

        Parameters
        ----------
        points : (q, 3) array_like
        faces : (q,) array_like of int
            Where each walk starts.

        Returns
        -------
        Hits
        """
        p = np.array(points, dtype=np.float64)
        face = np.array(faces, dtype=np.int64)
        twin = self.mesh.twin.reshape(-1, 3)
        barycentric, square = self._nearest_in(face, p)
        walking = np.arange(len(p))
        while len(walking):
            here = face[walking]
            one = np.where(twin[here] >= 0, twin[here] // 3, here[:, None])
            two = np.where(twin[one] >= 0, twin[one] // 3, one[:, :, None])
            following = np.concatenate([one, two.reshape(len(here), 9)], axis=1)
            weights, squares = self._nearest_in(
                following.reshape(-1), np.repeat(p[walking], 12, axis=0)
            )
            squares = squares.reshape(-1, 12)
            best = squares.argmin(axis=1)
            row = np.arange(len(walking))
            nearer = squares[row, best] < square[walking] * (1.0 - 1e-9)
            row, best, walking = row[nearer], best[nearer], walking[nearer]
            face[walking] = following[row, best]
            barycentric[walking] = weights.reshape(-1, 12, 3)[row, best]
            square[walking] = squares[row, best]
        point = np.einsum("qk,qki->qi", barycentric, self._vertices[self._faces[face]])
        return Hits(p, face, barycentric, point)

    def query_from(self, points: ArrayLike, faces: ArrayLike) -> Hits:
        """Closest point of each query, for queries that are mostly above a face already known.

        Where the query is low above that face and far from its edges, no face next to it can be
        nearer, unless they meet in a fold of less than 53 degrees: the answer is the closest point
        of the sheet nearby, at a fifth of the time. The others are queried as they come.

        Parameters
        ----------
        points : (q, 3) array_like
        faces : (q,) array_like of int
            Of each query; that of its last position, say.

        Returns
        -------
        Hits
        """
        p = np.array(points, dtype=np.float64)
        face = np.array(faces, dtype=np.int64)
        barycentric, square = self._nearest_in(face, p)
        inward = (barycentric * self.mesh.face_altitudes[face]).min(axis=1)
        left = np.flatnonzero(square >= (LOW * inward) ** 2)
        others = self.query(p[left])
        face[left], barycentric[left] = others.face, others.barycentric
        point = np.einsum("qk,qki->qi", barycentric, self._vertices[self._faces[face]])
        return Hits(p, face, barycentric, point)

    def _nearest_in(self, face: Ints, points: Floats) -> tuple[Floats, Floats]:
        """Barycentrics of the points of given faces nearest to queries, and squared distances."""
        corners = self._vertices[self._faces[face]]
        weights = closest_barycentrics(corners, points)
        gap = points - np.einsum("qk,qki->qi", weights, corners)
        return weights, np.einsum("qi,qi->q", gap, gap)

    def distance(self, points: ArrayLike) -> Floats:
        """Distance of each point from the surface, half the work of :meth:`query`; (q,)."""
        return np.sqrt(self._search(points)[1])

    def faces(self, points: ArrayLike) -> Ints:
        """Face that holds the closest point of each query, without that point; (q,)."""
        return self._search(points)[2]

    def _search(self, points: ArrayLike) -> tuple[Floats, Floats, Ints]:
        """The points as an array, their squared distances and closest faces."""
        p = np.array(points, dtype=np.float64, order="C")
        if p.ndim != 2 or p.shape[1] != 3:
            raise MeshError(f"query points must have shape (q, 3), not {p.shape}")
        if not np.isfinite(p).all():
            raise MeshError("query points must be finite")
        if len(p) == 0:
            return p, np.zeros(0), np.zeros(0, dtype=np.int64)
        square, face, _ = self._tree.squared_distance(self._vertices, self._faces, p)
        return p, np.asarray(square).reshape(-1), np.asarray(face, dtype=np.int64).reshape(-1)


def closest_barycentrics(corners: Floats, points: Floats) -> Floats:
    """Barycentric coordinates of the point of each triangle closest to its query.

    The best of four candidates, the projection to the plane where it falls inside and the closest
    points of the three edges, so that slivers and triangles without area are served too.

    Parameters
    ----------
    corners : (q, 3, 3) float64
        Corner k of triangle i is ``corners[i, k]``.
    points : (q, 3) float64

    Returns
    -------
    (q, 3) float64
        In [0, 1], summing to 1.
    """
    # Three edges: candidate k lies between corners k and k + 1.
    edge = np.take(corners, _NEXT, axis=1)
    edge -= corners
    offset = points[:, None, :] - corners
    square = np.einsum("qki,qki->qk", edge, edge)
    along = np.einsum("qki,qki->qk", edge, offset)
    t = np.divide(along, square, out=np.zeros_like(along), where=square > 0).clip(0.0, 1.0)
    gap = t[:, :, None] * edge
    np.subtract(offset, gap, out=gap)
    distance = np.einsum("qki,qki->qk", gap, gap)
    best = distance.argmin(axis=1)
    row = np.arange(len(points))
    result = np.zeros((len(points), 3))
    result[row, best] = 1.0 - t[row, best]
    result[row, (best + 1) % 3] = t[row, best]

    # The inside: weight of corner k is the area of (k + 1, k + 2, point) over the whole.
    normal = cross(edge[:, 0], -edge[:, 2])
    area = np.einsum("qi,qi->q", normal, normal)
    part = np.einsum("qki,qi->qk", cross(edge, offset), normal)
    weight = np.divide(part, area[:, None], out=np.full_like(part, -1.0), where=area[:, None] > 0)
    weight = np.take(weight, _NEXT, axis=1)
    height = np.divide(
        np.einsum("qi,qi->q", offset[:, 0], normal) ** 2,
        area,
        out=np.full(len(points), np.inf),
        where=area > 0,
    )
    inside = (weight >= 0).all(axis=1) & (height < distance[row, best])
    result[inside] = weight[inside]
    return np.asarray(result / result.sum(axis=1, keepdims=True))

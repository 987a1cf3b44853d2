"""The nearest point of a surface that faces a given way: of two sheets close by, the right one."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import cdist

from vhquad.mesh.closest import closest_barycentrics
from vhquad.mesh.triangle import TriMesh

__all__ = ["FacingPoints"]

Floats = NDArray[np.float64]

SAME_WAY = 0.3  # least cosine between a face's normal and the one asked for


class FacingPoints:
    """Queries of the nearest points on faces that face a given way, near some place.

    Every query is compared with every face around that place, so the place should be small.

    Parameters
    ----------
    mesh : TriMesh
    around : (k, 3) float64
        Points of the place; faces whose boxes are within half the diagonal of theirs are searched.
    """

    def __init__(self, mesh: TriMesh, around: Floats) -> None:
        low, high = around.min(axis=0), around.max(axis=0)
        margin = 0.5 * np.linalg.norm(high - low)
        corners = mesh.vertices[mesh.faces]
        over = (corners.max(axis=1) >= low - margin).all(axis=1)
        near = np.flatnonzero(over & (corners.min(axis=1) <= high + margin).all(axis=1))
        self._corners = corners[near]
        self._normals = mesh.face_normals[near]
        self._centre = self._corners.mean(axis=1)
        self._radius = np.linalg.norm(self._corners - self._centre[:, None], axis=2).max(axis=1)

    def query(self, points: Floats, normals: Floats) -> Floats:
        """Nearest point of a face whose normal is within 72 degrees of the given one; (q, 3).

        Where no face is, the point itself.

        Parameters
        ----------
        points, normals : (q, 3) float64
        """
        out = points.copy()
        if not len(self._centre):
            return out
        to_centre = cdist(points, self._centre)
        to_centre[normals @ self._normals.T <= SAME_WAY] = np.inf
        # A face's nearest point is at most as far as its centre, and at most a radius nearer.
        bound = to_centre.min(axis=1)
        query, face = np.nonzero(
            np.isfinite(to_centre) & (to_centre - self._radius <= bound[:, None])
        )
        corners = self._corners[face]
        weights = closest_barycentrics(corners, points[query])
        point = np.einsum("qk,qki->qi", weights, corners)
        gap = np.linalg.norm(point - points[query], axis=1)
        order = np.lexsort((face, gap, query))
        first = order[np.unique(query[order], return_index=True)[1]]
        out[query[first]] = point[first]
        return out

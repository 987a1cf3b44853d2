"""PN triangles: a smooth surface through the vertices of a mesh, with its sharp edges left sharp.

Over each triangle lies a cubic patch that meets its neighbours along curves which depend on the
ends of the edge alone; it is tangent to the planes of the normals at its corners. Sharp and
boundary edges stay straight, and normals are means over the faces between them.

Reference: A. Vlachos, J. Peters, C. Boyd and J. Mitchell, Curved PN Triangles, 2001.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from vhquad.mesh.triangle import TriMesh, next_halfedge
from vhquad.mesh.vectors import unit

__all__ = ["PnTriangles"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

STEEPEST = 0.35  # sine of the angle between an edge and the tangent plane at its end: no bulges


class PnTriangles:
    """The patches of a mesh.

    Parameters
    ----------
    mesh : TriMesh
    sharp : (3m,) bool
        Halfedges on edges that stay sharp, both of each; boundaries always do.
    """

    def __init__(self, mesh: TriMesh, sharp: Bools) -> None:
        smooth = (mesh.twin >= 0) & ~sharp
        normal = _corner_normals(mesh, smooth)
        p = mesh.vertices[mesh.faces]
        side = np.roll(p, -1, axis=1) - p
        length = np.linalg.norm(side, axis=2)
        bends = smooth.reshape(-1, 3)

        def beside(at: Floats, along: Floats, own: Floats) -> Floats:
            """Control points near the ends ``at`` of sides."""
            rise = np.einsum("fki,fki->fk", along, own)
            rise = np.where(bends, np.clip(rise, -STEEPEST * length, STEEPEST * length), 0.0)
            return np.asarray(at + (along - rise[..., None] * own) / 3.0)

        self.corner = p
        self.first = beside(p, side, normal)  # of each side, near its tail
        self.second = beside(np.roll(p, -1, axis=1), -side, np.roll(normal, -1, axis=1))
        mean = (self.first + self.second).sum(axis=1) / 6.0
        self.centre = mean + 0.5 * (mean - p.mean(axis=1))

    def points(self, face: Ints, share: Floats) -> Floats:
        """Points of patches.

        Parameters
        ----------
        face : (q,) int64
        share : (q, 3) float64
            Barycentric coordinates in the face.

        Returns
        -------
        (q, 3) float64
        """
        ahead = np.roll(share, -1, axis=1)
        found = np.einsum("qk,qki->qi", share**3, self.corner[face])
        found += np.einsum("qk,qki->qi", 3.0 * share**2 * ahead, self.first[face])
        found += np.einsum("qk,qki->qi", 3.0 * share * ahead**2, self.second[face])
        found += 6.0 * share.prod(axis=1, keepdims=True) * self.centre[face]
        return np.asarray(found)


def _corner_normals(mesh: TriMesh, smooth: Bools) -> Floats:
    """Normal at each corner: of the faces around its vertex up to the next sharp edges; (m, 3, 3).

    Weighted by their angles.
    """
    h = np.flatnonzero(smooth)
    n = 3 * mesh.n_faces
    links = coo_matrix((np.ones(len(h), dtype=np.int8), (h, next_halfedge(mesh.twin[h]))), (n, n))
    label = connected_components(links, directed=False)[1]
    weighted = mesh.corner_angles[..., None] * mesh.face_normals[:, None]
    sums = [np.bincount(label, weighted[..., i].reshape(-1))[label] for i in range(3)]
    return np.asarray(unit(np.stack(sums, axis=1)).reshape(-1, 3, 3))

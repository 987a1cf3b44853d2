"""A field bent to features: along boundaries and creases exactly, near the given one elsewhere.

Feature faces get the direction of their edge. On the others the given cross counts by its
confidence, the more the farther from features, against the smoothness of the whole
(``vhquad.field.smooth``).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from vhquad.field.boundary import boundary_tangents
from vhquad.field.cross import CrossField
from vhquad.field.dual import face_angles
from vhquad.field.matching import MatchedField, match_field
from vhquad.field.refine import Refinement
from vhquad.field.smooth import relaxed, settled, unit
from vhquad.mesh.triangle import TriMesh

__all__ = ["Posed", "pose"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

LEAST_SMOOTHING = 1e-9  # of the mesh's diagonal
SURE_SMOOTHING = 0.5  # of the smoothing, where the field is sure: its detail is meant
REACH = 4.0  # sizes beyond which features do not weaken the given field


@dataclass(frozen=True, eq=False)
class Posed:
    """A smoothing problem on a mesh whose features are separated.

    Attributes
    ----------
    mesh : TriMesh
    feature : (3m,) bool
    lean : (3m,) float64
        As in :class:`vhquad.field.matching.MatchedField`.
    corner : (3m,) bool
        Boundary halfedges that start where the boundary turns.
    target : (m,) complex128
        Crosses to stay near, or, where ``fixed``, to keep.
    weight : (m,) float64
        Of staying near.
    fixed : (m,) bool
    size : (m,) float64
        Edge length of the quads to come.
    seam : (3m,) bool, optional
        Boundary halfedges beyond which the surface goes on, mirrored.
    """

    mesh: TriMesh
    feature: Bools
    lean: Floats
    corner: Bools
    target: Complexes
    weight: Floats
    fixed: Bools
    size: Floats
    seam: Bools | None = None

    def solve(self) -> Complexes:
        """The crosses of least energy, unit; (m,)."""
        return unit(relaxed(self.mesh, self.target, self.weight, self.fixed))

    def settle(self, z: Complexes, length: Floats) -> Complexes:
        """Crosses of less energy near unit ones, singularities moved by about ``length``; (m,)."""
        return settled(self.mesh, z, self.target, self.weight, self.fixed, length)

    def match(self, z: Complexes) -> MatchedField:
        """Crosses with their matchings."""
        return match_field(self.mesh, np.angle(z) / 4.0, self.feature, self.lean, self.seam)


def pose(
    refinement: Refinement,
    feature: Bools,
    field: CrossField,
    size: Floats,
    smoothing: float,
    seam: Bools | None = None,
) -> Posed:
    """Set up the problem.

    Parameters
    ----------
    refinement : Refinement
        Of the mesh of ``field``, its features separated.
    feature : (3m,) bool
        Halfedges of that mesh on boundaries and creases.
    field : CrossField
        On its faces.
    size : (m,) float64
        Edge length of the quads to come, at those faces.
    smoothing : float
        Details of the field smaller than this many sizes are smoothed away, where it is sure those
        below half of that.
    seam : (3m,) bool, optional
        Boundary halfedges beyond which the surface goes on, mirrored.
    """
    mesh = refinement.mesh
    if seam is not None:
        seam = refinement.carry(seam, False)
    feature = refinement.carry(feature, False)
    size = size[refinement.parent]
    boundary = boundary_tangents(mesh, size, seam)
    on = np.flatnonzero(feature)
    target = field.z[refinement.parent] * np.exp(-4j * refinement.turn)
    target[on // 3] = np.exp(4j * (face_angles(mesh) + boundary.lean)[on])
    fixed = np.zeros(mesh.n_faces, dtype=bool)
    fixed[on // 3] = True
    detail = smoothing * size * SURE_SMOOTHING ** field.trust[refinement.parent]
    weight = np.ones(mesh.n_faces)
    if field.confidence is not None:
        weight = field.confidence[refinement.parent]
    weight = weight * mesh.face_areas / np.maximum(detail, LEAST_SMOOTHING * mesh.diagonal) ** 2
    weight = weight * (target != 0) * _distance_trust(mesh, on, size)
    return Posed(mesh, feature, boundary.lean, boundary.corner, target, weight, fixed, size, seam)


def _distance_trust(mesh: TriMesh, on: Ints, size: Floats) -> Floats:
    """How far the given field counts: 0 at features, 1 from about a size on; (m,)."""
    if on.size == 0:
        return np.ones(mesh.n_faces)
    h = np.arange(3 * mesh.n_faces)
    once = h[(mesh.twin < 0) | (h < mesh.twin)]
    shape = (mesh.n_vertices, mesh.n_vertices)
    lengths = mesh.edge_lengths.reshape(-1)[once] / size[once // 3]
    graph = csr_matrix((lengths, (mesh.tail[once], mesh.head[once])), shape)
    start = np.unique(np.concatenate([mesh.tail[on], mesh.head[on]]))
    far = dijkstra(graph, directed=False, indices=start, limit=REACH, min_only=True)
    far = np.minimum(far, REACH)[mesh.faces].mean(axis=1)
    return np.asarray(1.0 - np.exp(-(far**2)))

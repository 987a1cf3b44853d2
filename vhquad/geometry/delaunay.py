"""Intrinsic Delaunay triangulation by signpost flips, many edges at a time.

The vertices and their frames stay those of the mesh; only edges change, each a geodesic inside the
old surface. Every halfedge carries its direction at its tail (a signpost), so transports along
flipped edges are known in the same frames, and no edge of the mesh needs to survive.

References
----------
Sharp, Soliman and Crane 2019, "Navigating Intrinsic Triangulations".
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from vhquad.geometry import intrinsic
from vhquad.geometry.frames import Frames, bisector_transport, edge_transport
from vhquad.mesh.triangle import TriMesh, next_halfedge, prev_halfedge

__all__ = ["IntrinsicTriangulation", "intrinsic_delaunay", "intrinsic_triangulation"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Complexes = NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class IntrinsicTriangulation:
    """Triangles glued along edges of given length, on the vertices and frames of a mesh.

    Two edges may join the same two vertices, and an edge may end where it starts.

    Attributes
    ----------
    n_vertices : int
    faces : (m, 3) int64
        Vertex at corner k; halfedge 3 f + k leaves it, as in ``vhquad.mesh.triangle``.
    twin : (3m,) int64
        Opposite halfedge, -1 on a boundary.
    lengths : (m, 3) float64
        Length of halfedge k.
    halfedge_angle : (3m,) float64
        Angle of each halfedge in the frame of its tail (not wrapped).
    angle_scale : (n,) float64
        Frame angle per true angle at each vertex.
    """

    n_vertices: int
    faces: Ints
    twin: Ints
    lengths: Floats
    halfedge_angle: Floats
    angle_scale: Floats

    @cached_property
    def transport(self) -> Complexes:
        """Rotation from the frame of the tail to that of the head of each halfedge; (3m,)."""
        return edge_transport(self.halfedge_angle, self.twin)

    @cached_property
    def corner_angles(self) -> Floats:
        """True angle at corner k, radians; (m, 3)."""
        return intrinsic.corner_angles(self.lengths)

    @cached_property
    def vertex_to_face(self) -> Complexes:
        """Rotation from the frame of corner k to the face's frame (axis halfedge 0); (m, 3)."""
        scale = self.angle_scale[self.faces]
        return bisector_transport(self.corner_angles, self.halfedge_angle.reshape(-1, 3), scale)

    @cached_property
    def cotangents(self) -> Floats:
        """Cotangent of the angle at corner k; (m, 3)."""
        return intrinsic.cotangents(self.lengths)

    @cached_property
    def face_areas(self) -> Floats:
        """Area of each face; (m,)."""
        return intrinsic.areas(self.lengths)

    @cached_property
    def halfedge_weights(self) -> Floats:
        """What the face of each halfedge adds to the cotan weight of its edge; (3m,)."""
        return np.asarray(0.5 * np.roll(self.cotangents, -2, axis=1).reshape(-1))

    @cached_property
    def edge_weights(self) -> Floats:
        """Cotan weight of the edge of each halfedge, from both of its faces; (3m,)."""
        half = self.halfedge_weights
        return half + np.where(self.twin >= 0, half[self.twin], 0.0)


def intrinsic_triangulation(mesh: TriMesh, frames: Frames) -> IntrinsicTriangulation:
    """The mesh itself, seen from inside."""
    return IntrinsicTriangulation(
        mesh.n_vertices,
        mesh.faces,
        mesh.twin,
        frames.lengths,
        frames.halfedge_angle,
        frames.angle_scale,
    )


def intrinsic_delaunay(
    mesh: TriMesh, frames: Frames, tolerance: float = 1e-9, max_rounds: int = 2000
) -> IntrinsicTriangulation:
    """Flip edges until every interior edge is Delaunay (weight not below ``-tolerance``).

    Each round flips a set of edges no two of which share a face, so that a round is a handful of
    array operations. Boundary edges stay. Ends for certain; if ``max_rounds`` were ever met,
    the triangulation is still valid, only not Delaunay everywhere.

    Parameters
    ----------
    mesh : TriMesh
    frames : Frames
        Of the mesh.
    tolerance : float
        How negative ``(cot a + cot b) / 2`` may be; so that cocircular edges do not flip for ever.
    max_rounds : int

    Returns
    -------
    IntrinsicTriangulation
        Of the same vertices and frames.
    """
    flipper = _Flipper(mesh, frames)
    rng = np.random.default_rng(0)
    active = np.flatnonzero(mesh.twin > np.arange(3 * mesh.n_faces))
    for _ in range(max_rounds):
        active = flipper.non_delaunay(active, tolerance)
        if active.size == 0:
            break
        active = flipper.flip(flipper.independent(active, rng), active)
    return IntrinsicTriangulation(
        mesh.n_vertices,
        flipper.tail.reshape(-1, 3),
        flipper.twin,
        flipper.length.reshape(-1, 3),
        flipper.angle,
        frames.angle_scale,
    )


class _Flipper:
    """The changing halfedge arrays of a triangulation; next and previous stay 3 f + k."""

    def __init__(self, mesh: TriMesh, frames: Frames) -> None:
        self.tail = mesh.tail.copy()
        self.twin = mesh.twin.copy()
        self.length = frames.lengths.reshape(-1).copy()
        self.angle = frames.halfedge_angle.copy()
        self.scale = frames.angle_scale
        # Cotangent of the corner opposite to each halfedge.
        self.opposite = np.roll(intrinsic.cotangents(frames.lengths), -2, axis=1).reshape(-1)

    def non_delaunay(self, halfedges: Ints, tolerance: float) -> Ints:
        """Those with a face on either side, two different ones, whose weight is negative."""
        twin = self.twin[halfedges]
        h, twin = halfedges[twin >= 0], twin[twin >= 0]
        weight = 0.5 * (self.opposite[h] + self.opposite[twin])
        return h[(weight < -tolerance) & (h // 3 != twin // 3)]

    def independent(self, halfedges: Ints, rng: np.random.Generator) -> Ints:
        """Some of the edges, no two in one face: those first in a random order at both faces."""
        order = rng.permutation(len(halfedges))
        first = np.full(len(self.tail) // 3, len(halfedges))
        sides = halfedges // 3, self.twin[halfedges] // 3
        for side in sides:
            np.minimum.at(first, side, order)
        return halfedges[(first[sides[0]] == order) & (first[sides[1]] == order)]

    def flip(self, h: Ints, active: Ints) -> Ints:
        """Flip the edges of halfedges ``h`` (independent); return the edges to look at next.

        Before: h = i->j in face (i, j, k), t = j->i in face (j, i, l). After: h = l->k in face
        (l, k, i), t = k->l in face (k, l, j); the four sides move to the slots that follow.
        """
        t = self.twin[h]
        h_next, h_prev = next_halfedge(h), prev_halfedge(h)
        t_next, t_prev = next_halfedge(t), prev_halfedge(t)
        diagonal = self._other_diagonal(h, t)
        moved_from = np.concatenate([h_prev, t_next, t_prev, h_next])
        moved_to = np.concatenate([h_next, h_prev, t_next, t_prev])
        slot = np.arange(len(self.tail))
        slot[moved_from] = moved_to
        partner = self.twin[moved_from]
        partner = np.where(partner >= 0, slot[partner], -1)
        for array in (self.tail, self.length, self.angle):
            array[moved_to] = array[moved_from]
        self.twin[moved_to] = partner
        glued = partner >= 0
        self.twin[partner[glued]] = moved_to[glued]

        self.tail[h], self.tail[t] = self.tail[t_next], self.tail[h_next]
        self.length[h] = self.length[t] = diagonal
        touched = np.concatenate([h // 3, t // 3])
        lengths = self.length.reshape(-1, 3)[touched]
        corner = intrinsic.corner_angles(lengths)
        count = len(h)
        rows = np.arange(count)
        # Counter-clockwise at k: first k->i (slot after h), then the new k->l, by f's corner at k.
        at_k = corner[rows, h_next % 3] * self.scale[self.tail[h_next]]
        self.angle[t] = self.angle[h_next] + at_k
        at_l = corner[count + rows, t_next % 3] * self.scale[self.tail[t_next]]
        self.angle[h] = self.angle[t_next] + at_l
        cot = np.roll(intrinsic.cotangents(lengths), -2, axis=1)
        self.opposite.reshape(-1, 3)[touched] = cot

        around = (3 * touched[:, None] + np.arange(3)).reshape(-1)
        candidates = np.concatenate([slot[active], around])
        candidates = np.maximum(candidates, self.twin[candidates])
        return np.unique(candidates)

    def _other_diagonal(self, h: Ints, t: Ints) -> Floats:
        """Length from k to l across the edge i-j, by the stable law of cosines at i."""
        lengths = self.length.reshape(-1, 3)
        t_next = next_halfedge(t)
        row = np.arange(len(h))
        angle = intrinsic.corner_angles(lengths[h // 3])[row, h % 3]
        angle = angle + intrinsic.corner_angles(lengths[t // 3])[row, t_next % 3]
        a, b = self.length[prev_halfedge(h)], self.length[t_next]
        return np.asarray(np.sqrt((a - b) ** 2 + 4.0 * a * b * np.sin(0.5 * angle) ** 2))

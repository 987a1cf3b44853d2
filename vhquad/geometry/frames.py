"""Tangent frames at vertices and faces, and the rotations that carry vectors between them.

CONVENTIONS (everything else in vhquad points here)

- Halfedge ``h = 3 f + k`` runs from corner k to corner k + 1 of face f (``vhquad.mesh.triangle``).
- A tangent vector is one complex number: its modulus is its length, its argument the angle from
  the frame's axis, counter-clockwise seen from outside (about the outward normal).
- Vertex frame: the axis is the first outgoing halfedge ``mesh.outgoing[v]`` (the boundary one, at
  a boundary). The corner angles around the vertex are rescaled so that they sum to 2 pi inside
  and to pi on a boundary (Knoeppel et al. 2013, section 6; Sharp et al. 2019, section 5.2).
- Face frame: the axis is halfedge 0; angles are the true ones.
- ``r_h`` (unit complex), h from i to j, takes T_i to T_j: ``u_j = r_h u_i`` is the parallel copy
  of u_i. Of the twin it is the conjugate. Around a face the product of its three ``r`` is
  ``exp(i K_f)``, K_f that face's share of the curvature.
- A field of order N (N-RoSy) is stored as the N-th power of any of its directions, hence is
  carried by ``r ** N`` and ``vertex_to_face ** N``.
- 3-D axes (e1, e2): e1 x e2 is the outward normal. At a face e1 runs along halfedge 0. At a
  vertex e1 is fitted to all edges (see :func:`vertex_axes`), because rescaled angles have no exact
  picture in the tangent plane.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vhquad.errors import MeshError
from vhquad.geometry.intrinsic import corner_angles, mollified_lengths
from vhquad.mesh.triangle import TriMesh, prev_halfedge

__all__ = [
    "Axes",
    "Frames",
    "bisector_transport",
    "build_frames",
    "edge_transport",
    "face_axes",
    "from_3d",
    "to_3d",
    "vertex_axes",
]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Complexes = NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class Frames:
    """Angles and transports of a mesh's vertex and face frames (conventions: module head).

    Attributes
    ----------
    lengths : (m, 3) float64
        Edge lengths, mollified if the mesh holds degenerate triangles.
    corner_angle : (m, 3) float64
        True angle at corner k, radians, of the metric ``lengths``.
    angle_sum : (n,) float64
        Sum of the true corner angles around each vertex.
    angle_scale : (n,) float64
        Frame angle per true angle: 2 pi / angle_sum inside, pi / angle_sum on a boundary.
    halfedge_angle : (3m,) float64
        Angle of each halfedge in the frame of its tail, in [0, 2 pi).
    reverse_angle : (3m,) float64
        Angle, in the frame of its head, of the direction back to the tail: that of the twin, or
        pi where the halfedge is a boundary one.
    transport : (3m,) complex128
        ``r_h``, from the frame of the tail to the frame of the head.
    face_angle : (m, 3) float64
        Angle of halfedge k in the frame of its face, in [0, 2 pi).
    vertex_to_face : (m, 3) complex128
        Takes a vector in the frame of corner k to the frame of the face. Matches the bisectors of
        the corner in both frames, so it does not depend on which corner comes first.
    """

    lengths: Floats
    corner_angle: Floats
    angle_sum: Floats
    angle_scale: Floats
    halfedge_angle: Floats
    reverse_angle: Floats
    transport: Complexes
    face_angle: Floats
    vertex_to_face: Complexes


def build_frames(mesh: TriMesh, lengths: Floats | None = None) -> Frames:
    """Compute the frames of a mesh.

    Parameters
    ----------
    mesh : TriMesh
    lengths : (m, 3) float64, optional
        Length of halfedge k of each face, where the metric is another than that in space.

    Raises
    ------
    MeshError
        If an edge or a vertex is not manifold; :func:`vhquad.mesh.repair.repair` splits them.
    """
    if not mesh.has_manifold_vertices:
        bad = np.unique(mesh.tail[mesh.fan_rank < 0])
        raise MeshError(
            f"{len(bad)} vertices join several fans of faces, the first is {bad[0]}; "
            "run repair first"
        )
    lengths = mollified_lengths(mesh.edge_lengths if lengths is None else lengths)
    corner = corner_angles(lengths)
    preceding, angle_sum = _fan_angles(mesh, corner.reshape(-1))
    full = np.where(mesh.is_boundary_vertex, np.pi, 2.0 * np.pi)
    scale = np.divide(full, angle_sum, out=np.ones_like(full), where=angle_sum > 0)

    angle = preceding * scale[mesh.tail]
    return Frames(
        lengths=lengths,
        corner_angle=corner,
        angle_sum=angle_sum,
        angle_scale=scale,
        halfedge_angle=angle,
        reverse_angle=np.where(mesh.twin >= 0, angle[mesh.twin], np.pi),
        transport=edge_transport(angle, mesh.twin),
        face_angle=_face_angles(corner),
        vertex_to_face=bisector_transport(corner, angle.reshape(-1, 3), scale[mesh.faces]),
    )


def edge_transport(halfedge_angle: Floats, twin: Ints) -> Complexes:
    """``r_h`` of each halfedge from the directions at the tails, exactly conjugate to the twin's.

    Parameters
    ----------
    halfedge_angle : (3m,) float64
        Angle in the frame of the tail.
    twin : (3m,) int64
        -1 on a boundary, where the direction back is at pi by convention.

    Returns
    -------
    (3m,) complex128
    """
    reverse = np.where(twin >= 0, halfedge_angle[twin], np.pi)
    transport = np.exp(1j * (reverse + np.pi - halfedge_angle))
    lower = np.flatnonzero(twin > np.arange(len(twin)))
    transport[twin[lower]] = transport[lower].conj()
    return transport


def bisector_transport(corner: Floats, halfedge_angle: Floats, scale: Floats) -> Complexes:
    """Vertex-to-face rotations that match the corners' bisectors.

    Parameters
    ----------
    corner, halfedge_angle, scale : (m, 3) float64
        True corner angles; angle of halfedge k in the frame of its tail; frame angle per true angle
        at corner k's vertex.

    Returns
    -------
    (m, 3) complex128
    """
    turn = _face_angles(corner) - halfedge_angle + 0.5 * corner * (1.0 - scale)
    return np.asarray(np.exp(1j * turn))


def _face_angles(corner: Floats) -> Floats:
    """Angle of halfedge k in the frame of its face, from the corner angles; (m, 3)."""
    first = np.zeros(len(corner))
    return np.stack([first, np.pi - corner[:, 1], np.pi + corner[:, 0]], axis=1)


def _fan_angles(mesh: TriMesh, corner: Floats) -> tuple[Floats, Floats]:
    """True angle from the axis to each halfedge (3m,), and the angle sum of each vertex (n,)."""
    preceding = np.zeros(len(corner))
    total = np.zeros(mesh.n_vertices)
    current = mesh.outgoing[mesh.outgoing >= 0]
    first = mesh.outgoing[mesh.tail]
    while current.size:  # one step a rank of the fan: as many as the largest valence
        vertex = mesh.tail[current]
        preceding[current] = total[vertex]
        total[vertex] += corner[current]
        current = mesh.twin[prev_halfedge(current)]
        current = current[current >= 0]
        current = current[current != first[current]]
    return preceding, total


# ---- pictures in space -----------------------------------------------------------------------


class Axes(NamedTuple):
    """Orthonormal 3-D axes of frames, ``e1 x e2`` the outward normal; both (n, 3) float64."""

    e1: Floats
    e2: Floats


def face_axes(mesh: TriMesh) -> Axes:
    """Axes of the face frames: e1 along halfedge 0. Degenerate faces get some orthonormal axes."""
    p = mesh.vertices[mesh.faces]
    return _orthonormal(p[:, 1] - p[:, 0], mesh.face_normals)


def vertex_axes(mesh: TriMesh, frames: Frames | None = None) -> Axes:
    """Axes of the vertex frames in the plane of the angle-weighted normal.

    e1 is the mean, over the edges around the vertex, of the projected edge turned back by its frame
    angle (weighted by the true angle around it): the rotation that fits the frame best to space.
    Unlike the projection of the axis halfedge alone it does not depend on which edge is the axis.

    Parameters
    ----------
    mesh : TriMesh
    frames : Frames, optional
        Those of the mesh, if at hand.
    """
    frames = build_frames(mesh) if frames is None else frames
    normal = mesh.vertex_normals
    side = mesh.vertices[mesh.head] - mesh.vertices[mesh.tail]
    corner = frames.corner_angle.reshape(-1)
    # Each corner counts half for its halfedge and half for the edge at its other side.
    total = np.zeros((mesh.n_vertices, 3))
    behind = prev_halfedge(np.arange(len(side)))
    for edge, angle in (
        (side, frames.halfedge_angle),
        (-side[behind], frames.reverse_angle[behind]),
    ):
        n = normal[mesh.tail]
        along = _unit(edge - np.einsum("hi,hi->h", edge, n)[:, None] * n)
        turned = np.cos(angle)[:, None] * along - np.sin(angle)[:, None] * np.cross(n, along)
        np.add.at(total, mesh.tail, corner[:, None] * turned)
    return _orthonormal(total, normal)


def to_3d(u: Complexes, axes: Axes) -> Floats:
    """Complex vectors (n,) or (n, c) as vectors in space, (n, 3) or (n, c, 3)."""
    shape = (len(u),) + (1,) * (u.ndim - 1) + (3,)
    real, imag = u.real[..., None], u.imag[..., None]
    return np.asarray(real * axes.e1.reshape(shape) + imag * axes.e2.reshape(shape))


def from_3d(vectors: Floats, axes: Axes) -> Complexes:
    """Vectors in space (n, 3) or (n, c, 3), projected to the tangent planes, as complex numbers."""
    shape = (len(vectors),) + (1,) * (vectors.ndim - 2) + (3,)
    real = (vectors * axes.e1.reshape(shape)).sum(axis=-1)
    return np.asarray(real + 1j * (vectors * axes.e2.reshape(shape)).sum(axis=-1))


def _unit(vectors: Floats) -> Floats:
    length = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.divide(vectors, length, out=np.zeros_like(vectors), where=length > 0)


def _orthonormal(direction: Floats, normal: Floats) -> Axes:
    """Axes with the given normals and e1 towards ``direction``; arbitrary where these vanish."""
    n = _unit(normal)
    n = np.where((n * n).sum(axis=1, keepdims=True) > 0.5, n, np.array([0.0, 0.0, 1.0]))
    d = _unit(direction)
    e1 = d - np.einsum("ni,ni->n", d, n)[:, None] * n
    lost = np.linalg.norm(e1, axis=1) < 1e-8
    if lost.any():  # no usable direction: the coordinate axis farthest from the normal
        spare = np.eye(3)[np.abs(n[lost]).argmin(axis=1)]
        e1[lost] = spare - np.einsum("ni,ni->n", spare, n[lost])[:, None] * n[lost]
    e1 = _unit(e1)
    return Axes(e1, np.cross(n, e1))

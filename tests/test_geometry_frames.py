"""Frames and transports: by hand, flat, on spheres, and what must not depend on the labels."""

from __future__ import annotations

import numpy as np
import pytest

from tests import meshes, soups
from vhquad.errors import MeshError
from vhquad.geometry.frames import (
    Axes,
    build_frames,
    face_axes,
    from_3d,
    to_3d,
    vertex_axes,
)
from vhquad.mesh.triangle import TriMesh, prev_halfedge


def tangent(mesh: TriMesh, axes: Axes, rng: np.random.Generator) -> np.ndarray:
    return to_3d(rng.normal(size=(len(axes.e1), 2)) @ [1, 1j], axes)


def test_right_triangle_by_hand() -> None:
    frames = build_frames(meshes.one_triangle())
    # 1. Every vertex is a corner of the border: its angle is stretched to pi.
    np.testing.assert_allclose(frames.angle_sum, [np.pi / 2, np.pi / 4, np.pi / 4], rtol=1e-15)
    np.testing.assert_allclose(frames.angle_scale, [2.0, 4.0, 4.0], rtol=1e-15)
    # 2. The axis is the outgoing border halfedge; the way back along the incoming one is at pi.
    np.testing.assert_array_equal(frames.halfedge_angle, 0.0)
    np.testing.assert_array_equal(frames.reverse_angle, np.pi)
    # 3. So the border is straight: the axis of the tail becomes the axis of the head.
    np.testing.assert_allclose(frames.transport, 1.0, atol=1e-15)
    # 4. Halfedges turn by the outer angles.
    np.testing.assert_allclose(
        frames.face_angle[0], [0.0, 3 * np.pi / 4, 3 * np.pi / 2], rtol=1e-15
    )
    # 5. Bisector to bisector: at corner 0, pi / 2 in the frame is pi / 4 in the face.
    assert frames.vertex_to_face[0, 0] == pytest.approx(np.exp(-0.25j * np.pi), abs=1e-15)


@pytest.mark.parametrize("case", meshes.EVERY, ids=str)
def test_angles_and_transports_of_the_suite(case: meshes.Case) -> None:
    mesh = case.mesh
    frames = build_frames(mesh)
    # 1. The axis is the first outgoing halfedge.
    np.testing.assert_array_equal(frames.halfedge_angle[mesh.outgoing], 0.0)
    # 2. The next halfedge counter-clockwise is one scaled corner further (2 pi wraps to 0).
    h = np.arange(3 * mesh.n_faces)
    following = mesh.twin[prev_halfedge(h)]
    step = frames.corner_angle.reshape(-1) * frames.angle_scale[mesh.tail]
    expected = np.where(following >= 0, frames.halfedge_angle[following], np.pi)
    turn = np.exp(1j * (frames.halfedge_angle + step))
    np.testing.assert_allclose(turn, np.exp(1j * expected), atol=1e-12)
    # 3. Twins are conjugate, exactly.
    inner = mesh.twin >= 0
    twins = frames.transport[mesh.twin[inner]]
    np.testing.assert_array_equal(frames.transport[inner], twins.conj())
    # 4. Holonomy around a face: exp(i K_f), K_f = sum of its scaled corners - pi.
    curvature = step.reshape(-1, 3).sum(axis=1) - np.pi
    loop = frames.transport.reshape(-1, 3).prod(axis=1)
    np.testing.assert_allclose(loop, np.exp(1j * curvature), atol=1e-12)
    # 5. Gauss-Bonnet: borders are straight in these frames, so nothing but curvature is left.
    assert curvature.sum() / (2 * np.pi) == pytest.approx(case.euler, abs=1e-10)


def test_holonomy_shares_out_the_angle_defect() -> None:
    # Around an interior vertex the scaled corners exceed the true ones by the angle defect.
    mesh = meshes.blob()
    frames = build_frames(mesh)
    excess = frames.corner_angle * (frames.angle_scale[mesh.faces] - 1.0)
    defect = np.bincount(mesh.tail, excess.reshape(-1))
    np.testing.assert_allclose(defect, 2 * np.pi - frames.angle_sum, atol=1e-12)


def test_a_constant_field_on_a_plane_is_parallel() -> None:
    mesh = meshes.grid(9, 9, hole=True)
    frames = build_frames(mesh)
    straight = np.isclose(frames.angle_scale, 1.0)  # all but the corners of the border
    u = from_3d(np.tile([0.6, -0.8, 0.0], (mesh.n_vertices, 1)), vertex_axes(mesh, frames))
    # 1. From vertex to vertex.
    both = straight[mesh.tail] & straight[mesh.head]
    carried = frames.transport * u[mesh.tail]
    np.testing.assert_allclose(carried[both], u[mesh.head][both], atol=1e-12)
    # 2. From vertex to face.
    on_faces = from_3d(np.tile([0.6, -0.8, 0.0], (mesh.n_faces, 1)), face_axes(mesh))
    carried = frames.vertex_to_face * u[mesh.faces]
    use = straight[mesh.faces]
    expected = np.broadcast_to(on_faces[:, None], use.shape)
    np.testing.assert_allclose(carried[use], expected[use], atol=1e-12)


def sphere_transport_error(subdivisions: int) -> float:
    """Largest angle between r and the rotation of the sphere that takes tail to head."""
    mesh = meshes.icosphere(subdivisions)
    frames = build_frames(mesh)
    axes = vertex_axes(mesh, frames)
    p, q = mesh.vertices[mesh.tail], mesh.vertices[mesh.head]
    w = axes.e1[mesh.tail]
    w = w - (w * p).sum(axis=1)[:, None] * p
    along = q - (q * p).sum(axis=1)[:, None] * p
    along /= np.linalg.norm(along, axis=1)[:, None]
    ahead = (p * q).sum(axis=1)[:, None] * along - (along * q).sum(axis=1)[:, None] * p
    side = np.cross(p, along)
    exact = (w * along).sum(axis=1)[:, None] * ahead + (w * side).sum(axis=1)[:, None] * side
    there = Axes(axes.e1[mesh.head], axes.e2[mesh.head])
    return float(np.abs(np.angle(from_3d(exact, there) / frames.transport)).max())


def test_transport_on_spheres_converges() -> None:
    coarse, fine = sphere_transport_error(3), sphere_transport_error(4)
    # Measured 9.2e-4 and 2.3e-4 radians: second order.
    assert coarse < 1e-3
    assert fine < 0.26 * coarse


@pytest.mark.parametrize("case", meshes.EVERY, ids=str)
def test_axes_are_orthonormal_and_outward(case: meshes.Case) -> None:
    mesh = case.mesh
    for axes, normal in (
        (face_axes(mesh), mesh.face_normals),
        (vertex_axes(mesh), mesh.vertex_normals),
    ):
        frame = np.stack([axes.e1, axes.e2, normal], axis=1)
        identity = np.broadcast_to(np.eye(3), frame.shape)
        np.testing.assert_allclose(frame @ frame.transpose(0, 2, 1), identity, atol=1e-12)
        np.testing.assert_allclose(np.linalg.det(frame), 1.0, atol=1e-12)


def test_axes_follow_the_surface_not_its_labels(rng: np.random.Generator) -> None:
    mesh = meshes.half_sphere()
    frames, axes = build_frames(mesh), vertex_axes(mesh)
    u3 = tangent(mesh, axes, rng)
    on_faces = (frames.vertex_to_face * from_3d(u3, axes)[mesh.faces]).mean(axis=1)
    faces3 = to_3d(on_faces, face_axes(mesh))
    # 1. Relabelled vertices, faces and corners: the same vectors in space on vertices and faces.
    other = meshes.relabel(mesh, rng)
    new, new_axes = build_frames(other.mesh), vertex_axes(other.mesh)
    v3 = np.zeros_like(u3)
    v3[other.vertex] = u3
    v = from_3d(v3, new_axes)
    np.testing.assert_allclose(to_3d(v, new_axes), v3, atol=1e-12)
    moved = to_3d((new.vertex_to_face * v[other.mesh.faces]).mean(axis=1), face_axes(other.mesh))
    np.testing.assert_allclose(moved[other.face], faces3, atol=1e-12)
    # 2. Moved rigidly: the numbers stay, the picture turns.
    rigid = meshes.random_rigid(rng)
    turned = vertex_axes(rigid.mesh(mesh))
    np.testing.assert_allclose(turned.e1, rigid.vectors(axes.e1), atol=1e-12)


def test_to_3d_and_back(rng: np.random.Generator) -> None:
    mesh = meshes.torus(8, 6)
    axes = vertex_axes(mesh)
    for shape in ((mesh.n_vertices,), (mesh.n_vertices, 3)):
        u = rng.normal(size=shape) + 1j * rng.normal(size=shape)
        w = to_3d(u, axes)
        assert w.shape == (*shape, 3)
        np.testing.assert_allclose(from_3d(w, axes), u, atol=1e-12)
        np.testing.assert_allclose(np.linalg.norm(w, axis=-1), np.abs(u), atol=1e-12)


def test_degenerate_faces_keep_everything_finite() -> None:
    for soup in (soups.with_cap(), soups.with_needle()):
        mesh = TriMesh(*soup)
        frames = build_frames(mesh)
        for value in (frames.transport, frames.vertex_to_face):
            np.testing.assert_allclose(np.abs(value), 1.0, atol=1e-12)
        for axes in (vertex_axes(mesh, frames), face_axes(mesh)):
            np.testing.assert_allclose(np.linalg.norm(axes.e1, axis=1), 1.0, atol=1e-12)
            np.testing.assert_allclose((axes.e1 * axes.e2).sum(axis=1), 0.0, atol=1e-12)


def test_pinched_vertices_are_refused() -> None:
    with pytest.raises(MeshError, match=r"fans of faces.*repair"):
        build_frames(TriMesh(*soups.bowtie()))

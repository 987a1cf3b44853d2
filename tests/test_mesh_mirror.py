"""Cutting a mesh in half is exact, without slivers; mirroring the half gives the whole again."""

from __future__ import annotations

import numpy as np
import pytest

from tests.meshes import (
    blob,
    cube,
    grid,
    half_sphere,
    icosphere,
    merge,
    moved,
    open_cylinder,
    pretzel,
    random_rigid,
    tetrahedron,
    torus,
    two_spheres,
)
from vhquad.errors import MeshError
from vhquad.mesh.mirror import Half, cut_half, mirror_faces
from vhquad.mesh.plane import MirrorPlane
from vhquad.mesh.plane_cut import cut_faces
from vhquad.mesh.triangle import TriMesh
from vhquad.report import MeshCounts

X, Y, Z = (MirrorPlane(n, 0.0) for n in np.eye(3))

# (mesh, a plane in which it is its own mirror image)
SYMMETRIC = {
    "sphere": (icosphere(3), X),
    "sphere across no edge": (icosphere(2), MirrorPlane([0.36, 0.48, 0.8], 0.0)),
    "tetrahedron": (tetrahedron(), MirrorPlane([0, -1, 1], 0.0)),
    "torus": (torus(), X),
    "torus lying": (torus(), Z),
    "cube": (cube(3), Y),
    "pretzel": (pretzel(2), X),
    "pretzel lying": (pretzel(2), Z),
    "cylinder": (open_cylinder(), X),
    "cylinder across": (open_cylinder(), MirrorPlane([0, 0, 1], 1.0)),
    "half sphere": (half_sphere(3), X),
    "grid with hole": (grid(9, 9, hole=True), MirrorPlane([1, 0, 0], 0.5)),
    "two spheres": (two_spheres(), Y),
    "shoes": (merge(moved(torus(), (2, 0, 0)), moved(torus(), (-2, 0, 0))), X),
}


def whole_of(half: Half) -> TriMesh:
    return TriMesh(
        *mirror_faces(half.mesh.vertices, half.mesh.faces, half.seam_vertices, half.plane)
    )


@pytest.mark.parametrize("name", SYMMETRIC)
def test_half_and_whole(name: str) -> None:
    mesh, plane = SYMMETRIC[name]
    half = cut_half(mesh, plane)
    height = plane.height(half.mesh.vertices)
    seam = half.seam_vertices

    # 1. sound, on one side, and exactly on the plane at the seams, which are boundary
    assert half.mesh.has_manifold_vertices
    assert (half.mesh.face_areas > 0).all()
    assert height.min() > -1e-12
    assert np.abs(height[seam]).max(initial=0.0) < (1e-15 if plane.axis is None else 1e-300)
    assert (half.mesh.twin[half.seam] < 0).all()

    # 2. every face lies in its source (vertices slide by a tenth of an edge at most)
    middle = half.mesh.vertices[half.mesh.faces].mean(axis=1)
    corners = mesh.vertices[mesh.faces[half.face_source]]
    reach = np.linalg.norm(corners - corners.mean(axis=1)[:, None], axis=2).max(axis=1)
    assert (np.linalg.norm(middle - corners.mean(axis=1), axis=1) < 1.2 * reach).all()
    facing = np.einsum("fi,fi->f", half.mesh.face_normals, mesh.face_normals[half.face_source])
    assert (facing > 0.5).all()

    # 3. mirrored: the whole, with its topology and half the area twice
    whole = whole_of(half)
    assert whole.is_closed == mesh.is_closed
    assert MeshCounts.of(whole).topology == MeshCounts.of(mesh).topology == half.topology
    assert whole.area == pytest.approx(mesh.area, rel=0.05)
    assert half.doubled == 0


def test_cut_at_vertices_is_the_mesh_itself() -> None:
    """A cube whose vertices lie on the plane keeps its triangles; area exactly half."""
    mesh = cube(4)
    half = cut_half(mesh, X)
    assert half.mesh.n_faces == mesh.n_faces // 2
    assert half.mesh.area == pytest.approx(mesh.area / 2, rel=1e-15)
    np.testing.assert_array_equal(mesh.vertices[half.vertex_ends[:, 0]], half.mesh.vertices)


def test_one_triangle_by_hand() -> None:
    """Cut at a third of its base: a triangle and a quad, the quad being larger."""
    mesh = TriMesh([[-1, 0, 0], [2, 0, 0], [0.5, 3, 0]], [[0, 1, 2]])
    half = cut_half(mesh, X)
    assert half.mesh.n_faces == 2
    assert half.mesh.area == pytest.approx(4.5 - 1.0)
    at = half.mesh.vertices[half.seam_vertices]
    np.testing.assert_allclose(at[np.argsort(at[:, 1])], [[0, 0, 0], [0, 2, 0]], atol=1e-15)
    assert half.topology == (1, 1, 1)


def test_vertices_near_the_plane_slide_on_to_it(rng: np.random.Generator) -> None:
    """Noise in the heights makes no slivers: angles stay above half of the least before."""
    sphere = icosphere(3)
    v = sphere.vertices + rng.normal(scale=1e-3, size=(sphere.n_vertices, 3)) * [1, 0, 0]
    mesh = TriMesh(v, sphere.faces)
    half = cut_half(mesh, X)
    assert half.mesh.corner_angles.min() > 0.5 * np.radians(30.0)
    assert half.topology == (1, 2, 0)
    pieces = cut_faces(mesh, X, np.ones(mesh.n_faces, dtype=bool))
    gap = np.linalg.norm(pieces.points[: mesh.n_vertices] - mesh.vertices, axis=1)
    assert gap.max() < 0.1 * mesh.edge_lengths.max()


def test_boundary_vertices_slide_along_the_boundary() -> None:
    """The ragged rim of a half sphere: every rim vertex of the half lies on the rim's edges."""
    mesh = half_sphere(3)
    half = cut_half(mesh, MirrorPlane([1, 0, 0], 0.011))
    rim = np.flatnonzero(mesh.twin < 0)
    a, b = mesh.vertices[mesh.tail[rim]], mesh.vertices[mesh.head[rim]]
    own = np.flatnonzero((half.mesh.twin < 0) & ~half.seam)
    assert len(own) > 20
    for p in half.mesh.vertices[half.mesh.tail[own]]:
        t = np.einsum("ei,ei->e", p - a, b - a) / np.einsum("ei,ei->e", b - a, b - a)
        gap = a + np.clip(t, 0.0, 1.0)[:, None] * (b - a) - p
        assert np.linalg.norm(gap, axis=1).min() < 1e-12


def test_the_larger_half_is_kept() -> None:
    for offset, side in ((0.3, -1), (-0.3, 1), (0.0, 1)):
        plane = MirrorPlane([1, 0, 0], offset)
        half = cut_half(icosphere(2), plane)
        assert np.sign(plane.height(half.mesh.vertices).sum()) == side


def test_parts_without_a_partner_are_doubled() -> None:
    """A small ball on the dropped side is mirrored into the half; none is lost."""
    ball = icosphere(1)
    pair = [moved(ball, (3, 0, 0), 0.5), moved(ball, (-3, 0.05, 0), 0.5)]
    alone = [moved(ball, (-3, 2, 0), 0.3), moved(ball, (5, 0, 0), 0.4)]
    half = cut_half(merge(icosphere(2), *pair, *alone), X)
    assert half.doubled == 2
    assert half.topology == (7, 14, 0)
    assert int(half.is_image.sum()) == ball.n_faces
    image = half.mesh.vertices[half.mesh.faces[half.is_image]].reshape(-1, 3).mean(axis=0)
    np.testing.assert_allclose(image, [3, 2, 0], atol=1e-12)
    assert (whole_of(half).face_areas > 0).all()


def test_a_part_that_reaches_over_a_little_is_not_cut() -> None:
    """Two per cent of its area beyond the plane: it belongs to one side."""
    ball = icosphere(3)
    touching = merge(moved(ball, (0, 0, 3)), moved(ball, (0.98, 0, 0)), moved(ball, (-0.98, 0, 0)))
    half = cut_half(touching, X)
    assert (half.mesh.n_components, int(half.is_cut.sum())) == (2, 1)
    assert half.topology == (3, 6, 0)


def test_nothing_to_mirror() -> None:
    with pytest.raises(MeshError, match="x = 5 neither cuts the mesh"):
        cut_half(icosphere(2), MirrorPlane([1, 0, 0], 5.0))


def test_edges_are_carried() -> None:
    """Edges along a cube's rims: those on the kept side, and halves of those that are cut."""
    mesh = cube(3)
    plane = MirrorPlane([1, 0, 0], 0.1)
    sharp = np.abs(mesh.vertices[mesh.edges]) == 0.5
    rims = mesh.edges[(sharp.all(axis=1).sum(axis=1) == 2)]
    half = cut_half(mesh, plane)
    edges = half.carry_edges(rims)
    ends = half.mesh.vertices[edges]
    assert ((np.abs(np.abs(ends) - 0.5) < 1e-12).all(axis=1).sum(axis=1) >= 2).all()
    # The half runs from x = -0.5 to 0.1: four whole rims across x and 4 x 0.6 along it.
    assert np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).sum() == pytest.approx(4 + 4 * 0.6)
    assert half.carry_edges(np.zeros((0, 2), dtype=np.int64)).shape == (0, 2)


def test_mirrored_faces_in_any_plane(rng: np.random.Generator) -> None:
    """Vertex for vertex, wound the same way, the first half unchanged."""
    rigid = random_rigid(rng)
    mesh = rigid.mesh(blob(2))
    plane = MirrorPlane(rng.normal(size=3), 0.0)
    plane = MirrorPlane(plane.normal, float(plane.normal @ rigid.shift))
    half = cut_half(mesh, plane)
    v, f = mirror_faces(half.mesh.vertices, half.mesh.faces, half.seam_vertices, plane)
    n, m = half.mesh.n_vertices, half.mesh.n_faces
    np.testing.assert_allclose(v[:n], half.mesh.vertices, atol=1e-15)
    np.testing.assert_allclose(v[n:], plane.reflect(v[:n][~half.seam_vertices]), atol=1e-15)
    whole = TriMesh(v, f)
    assert whole.is_closed
    np.testing.assert_allclose(
        whole.face_normals[m:], plane.reflect_vectors(whole.face_normals[:m]), atol=1e-9
    )

"""Intrinsic Delaunay flips: what they reach and what they must keep."""

from __future__ import annotations

import igl
import numpy as np
import pytest

from tests import meshes, soups
from tests.data_paths import data_file
from vhquad.geometry.delaunay import (
    IntrinsicTriangulation,
    intrinsic_delaunay,
    intrinsic_triangulation,
)
from vhquad.geometry.frames import build_frames
from vhquad.geometry.laplacian import cotan_laplacian, lumped_mass
from vhquad.mesh.triangle import TriMesh, prev_halfedge


def delaunay(mesh: TriMesh) -> IntrinsicTriangulation:
    return intrinsic_delaunay(mesh, build_frames(mesh))


def bad_mesh(seed: int = 0) -> TriMesh:
    """A wavy open sheet with slanted, stretched triangles: 40 % of its edges are not Delaunay."""
    rng = np.random.default_rng(seed)
    mesh = meshes.grid(30, 12, width=1.0, height=6.0)
    x, y, _ = mesh.vertices.T
    x = x + 0.3 * y + 0.01 * rng.normal(size=len(x))
    return TriMesh(np.stack([x, y, 0.3 * np.sin(3 * x) * np.cos(y)], axis=1), mesh.faces)


def bad_sphere(seed: int = 0) -> TriMesh:
    """A sphere whose points slid along it without their triangles: valid, closed, skewed."""
    mesh = meshes.icosphere(3)
    angle = 2.5 * mesh.vertices[:, 2] ** 3 + seed
    c, s = np.cos(angle), np.sin(angle)
    x, y, z = mesh.vertices.T
    return TriMesh(np.stack([c * x - s * y, s * x + c * y, z], axis=1), mesh.faces)


def check(mesh: TriMesh, tri: IntrinsicTriangulation) -> None:
    """All that must hold of an intrinsic triangulation of a mesh."""
    frames = build_frames(mesh)
    inner = np.flatnonzero(tri.twin >= 0)
    # 1. Delaunay.
    assert tri.edge_weights[inner].min(initial=0.0) >= -1e-9
    # 2. Gluing: twins of twins, equal lengths, opposite ends.
    np.testing.assert_array_equal(tri.twin[tri.twin[inner]], inner)
    length = tri.lengths.reshape(-1)
    np.testing.assert_allclose(length[inner], length[tri.twin[inner]], rtol=1e-12)
    head = np.roll(tri.faces, -1, axis=1).reshape(-1)
    np.testing.assert_array_equal(head[tri.twin[inner]], tri.faces.reshape(-1)[inner])
    # 3. Signposts: each edge is one scaled corner further than the last.
    following = tri.twin[prev_halfedge(np.arange(len(tri.twin)))]
    step = tri.corner_angles.reshape(-1) * tri.angle_scale[tri.faces.reshape(-1)]
    turned = np.exp(1j * (tri.halfedge_angle + step))
    expected = np.where(following >= 0, np.exp(1j * tri.halfedge_angle[following]), -1.0)
    np.testing.assert_allclose(turned, expected, atol=1e-8)
    # 4. The surface is the same: area, and the true angle around every vertex.
    assert tri.face_areas.sum() == pytest.approx(0.5 * _doubled(frames.lengths), rel=1e-10)
    total = np.bincount(tri.faces.reshape(-1), tri.corner_angles.reshape(-1))
    np.testing.assert_allclose(total, frames.angle_sum, atol=1e-8)
    # 5. Borders stay as they are.
    border = np.flatnonzero(tri.twin < 0)
    np.testing.assert_allclose(
        np.sort(length[border]), np.sort(frames.lengths.reshape(-1)[mesh.twin < 0]), rtol=1e-12
    )
    # 6. Holonomy around each new face is its share of the curvature, the total as before.
    share = step.reshape(-1, 3).sum(axis=1) - np.pi
    loop = tri.transport.reshape(-1, 3).prod(axis=1)
    np.testing.assert_allclose(loop, np.exp(1j * share), atol=1e-8)
    assert share.sum() / (2 * np.pi) == pytest.approx(mesh.euler_characteristic, abs=1e-8)


def _doubled(lengths: np.ndarray) -> float:
    a, b, c = lengths.T
    s = (a + b + c) / 2
    return float(2 * np.sqrt(s * (s - a) * (s - b) * (s - c)).sum())


@pytest.mark.parametrize("case", meshes.EVERY, ids=str)
def test_suite(case: meshes.Case) -> None:
    check(case.mesh, delaunay(case.mesh))


@pytest.mark.parametrize("seed", range(3))
def test_bad_triangulations(seed: int) -> None:
    for mesh in (bad_mesh(seed), bad_sphere(seed)):
        tri = delaunay(mesh)
        # 1. There was something to do.
        start = intrinsic_triangulation(mesh, build_frames(mesh))
        assert (start.edge_weights[start.twin >= 0] < -1e-6).mean() > 0.05
        # 2. It was done.
        check(mesh, tri)
        # 3. Dual areas only move between neighbours.
        assert lumped_mass(tri).sum() == pytest.approx(mesh.area, rel=1e-12)


def test_one_flip_by_hand() -> None:
    # A flat kite, wings far out: the edge 0-1 of length 2 must become the edge 2-3 of length 0.4.
    mesh = TriMesh([[-1, 0, 0], [1, 0, 0], [0, 0.2, 0], [0, -0.2, 0]], [[0, 1, 2], [1, 0, 3]])
    frames = build_frames(mesh)
    tri = delaunay(mesh)
    new = np.flatnonzero(tri.twin >= 0)
    # 1. One edge, between the wings, with its length.
    assert len(new) == 2
    assert set(tri.faces.reshape(-1)[new]) == {2, 3}
    np.testing.assert_allclose(tri.lengths.reshape(-1)[new], 0.4, rtol=1e-14)
    # 2. It halves the corner of each wing, which the border frames stretch to pi.
    np.testing.assert_allclose(tri.halfedge_angle[new], np.pi / 2, rtol=1e-14)
    # 3. Both of its ends see the other straight ahead: a half turn between the frames.
    np.testing.assert_allclose(tri.transport[new], np.exp(1j * np.pi), atol=1e-14)
    # 4. The frames are still the mesh's.
    np.testing.assert_array_equal(tri.angle_scale, frames.angle_scale)


def test_edges_that_stay_keep_their_direction() -> None:
    mesh = bad_sphere()
    frames, tri = build_frames(mesh), delaunay(mesh)
    n = mesh.n_vertices
    old = {(t * n + h): k for k, (t, h) in enumerate(zip(mesh.tail, mesh.head, strict=True))}
    heads = np.roll(tri.faces, -1, axis=1).reshape(-1)
    pairs = [
        (k, old[t * n + h])
        for k, (t, h) in enumerate(zip(tri.faces.reshape(-1), heads, strict=True))
        if t * n + h in old
    ]
    new_h, old_h = np.array(pairs).T
    same = np.isclose(tri.lengths.reshape(-1)[new_h], frames.lengths.reshape(-1)[old_h])
    assert same.mean() > 0.5
    a, b = tri.transport[new_h[same]], frames.transport[old_h[same]]
    np.testing.assert_allclose(a, b, atol=1e-10)


def test_laplacian_agrees_with_libigl() -> None:
    for mesh in (bad_mesh(), bad_sphere(), meshes.half_sphere(), meshes.pretzel()):
        theirs = igl.intrinsic_delaunay_cotmatrix(mesh.vertices, mesh.faces)[0]
        ours = cotan_laplacian(delaunay(mesh))
        assert abs(ours + theirs).max() < 1e-10 * abs(ours).max()


def test_degenerate_triangles() -> None:
    for soup in (soups.with_cap(), soups.with_needle()):
        mesh = TriMesh(*soup)
        tri = delaunay(mesh)
        # 1. Mollified, flipped, finite, Delaunay. (Angles of near-degenerate triangles are good to
        #    about 1e-7 only, hence not the full check.)
        assert tri.edge_weights[tri.twin >= 0].min() >= -1e-9
        # 2. Positive areas: the mass can be inverted.
        assert lumped_mass(tri).min() > 0


def test_same_result_each_time() -> None:
    a, b = delaunay(bad_mesh()), delaunay(bad_mesh())
    np.testing.assert_array_equal(a.faces, b.faces)
    np.testing.assert_array_equal(a.halfedge_angle, b.halfedge_angle)


@pytest.mark.parametrize("name", ["wingnut", "cad_bracket", "fish"])
def test_meshes_from_practice(name: str) -> None:
    v, f = igl.read_triangle_mesh(str(data_file("tris", f"{name}.obj")))
    mesh = TriMesh(v, f)
    check(mesh, delaunay(mesh))

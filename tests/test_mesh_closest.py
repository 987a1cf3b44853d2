"""Closest points against closed forms and against brute force."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests import meshes
from tests.meshes import EVERY, Case
from vhquad.errors import MeshError
from vhquad.mesh.closest import ClosestPoints, closest_barycentrics
from vhquad.mesh.triangle import TriMesh


def brute_force(mesh: TriMesh, points: np.ndarray) -> np.ndarray:
    """Distance by trying each triangle."""
    corners = mesh.vertices[mesh.faces]
    best = []
    for p in points:
        b = closest_barycentrics(corners, np.broadcast_to(p, (mesh.n_faces, 3)))
        best.append(np.linalg.norm(np.einsum("mk,mki->mi", b, corners) - p, axis=1).min())
    return np.array(best)


@pytest.mark.parametrize("case", EVERY, ids=str)
def test_hits_agree_with_brute_force(case: Case, rng: np.random.Generator) -> None:
    m = case.mesh
    p = m.vertices.mean(axis=0) + rng.normal(size=(20, 3)) * m.diagonal / 2
    hits = ClosestPoints(m).query(p)
    np.testing.assert_allclose(hits.distance, brute_force(m, p), rtol=1e-10, atol=1e-12)
    assert (hits.barycentric >= 0).all()
    np.testing.assert_allclose(hits.barycentric.sum(axis=1), 1.0, atol=1e-14)
    np.testing.assert_allclose(hits.interpolate(m.vertices[m.faces]), hits.point, atol=1e-14)
    np.testing.assert_allclose(np.linalg.norm(hits.point - p, axis=1), hits.distance)
    np.testing.assert_allclose(ClosestPoints(m).distance(p), hits.distance, rtol=1e-10)
    np.testing.assert_array_equal(ClosestPoints(m).faces(p), hits.face)


@pytest.mark.parametrize("case", EVERY, ids=str)
def test_points_of_the_surface_are_found_again(case: Case, rng: np.random.Generator) -> None:
    m = case.mesh
    f = rng.integers(0, m.n_faces, 50)
    b = rng.dirichlet(np.ones(3), 50)
    p = np.einsum("qk,qki->qi", b, m.vertices[m.faces[f]])
    hits = ClosestPoints(m).query(p)
    assert hits.distance.max() < 1e-12 * m.diagonal
    same = hits.face == f
    assert same.mean() > 0.9
    np.testing.assert_allclose(hits.barycentric[same], b[same], atol=1e-9)


def test_square_and_cube_by_hand() -> None:
    hits = ClosestPoints(meshes.grid(1, 1, 1.0, 1.0)).query(
        [[0.25, 0.5, 2.0], [2.0, 0.5, 0.0], [4.0, 5.0, 0.0], [1.0, 1.0, 0.0]]
    )
    np.testing.assert_allclose(hits.distance, [2.0, 1.0, 5.0, 0.0], atol=1e-15)
    np.testing.assert_allclose(hits.point[1:3], [[1, 0.5, 0], [1, 1, 0]], atol=1e-15)
    centre = ClosestPoints(meshes.cube(2)).query(np.zeros((1, 3)))
    assert centre.distance[0] == pytest.approx(0.5)


def test_no_queries_and_bad_queries() -> None:
    tree = ClosestPoints(meshes.cube(1))
    empty = tree.query(np.zeros((0, 3)))
    assert empty.barycentric.shape == (0, 3)
    assert empty.point.shape == (0, 3)
    with pytest.raises(MeshError, match="shape"):
        tree.query(np.zeros(3))
    with pytest.raises(MeshError, match="finite"):
        tree.query([[0.0, np.nan, 0.0]])


coordinate = st.sampled_from([0.0, 1e-12, 1e-6, 0.5, 1.0, 1.0 + 1e-9, 3.0])
point = st.tuples(coordinate, coordinate, coordinate)


@given(st.tuples(point, point, point), point)
def test_any_triangle_however_thin(corners: tuple, query: tuple) -> None:
    c, p = np.array([corners]), np.array([query])
    b = closest_barycentrics(c, p)
    assert (b >= 0).all()
    assert b.sum() == pytest.approx(1.0, abs=1e-14)
    distance = np.linalg.norm(np.einsum("qk,qki->qi", b, c) - p)
    # No point of a dense sample of the triangle is nearer, beyond rounding.
    t = np.linspace(0.0, 1.0, 21)
    u, v = np.meshgrid(t, t)
    u, v = u[u + v <= 1], v[u + v <= 1]
    sample = np.stack([1 - u - v, u, v], axis=1) @ c[0]
    assert distance <= np.linalg.norm(sample - p, axis=1).min() + 1e-9


def test_triangles_without_area_do_no_harm() -> None:
    v = [[0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 3, 0], [0, 3, 0]]
    tree = ClosestPoints(TriMesh(v, [[0, 1, 2], [3, 4, 3], [0, 3, 4]]))
    points = np.array([[1.5, 1.0, 0.0], [-1.0, 3.0, 0.0], [0.0, 1.5, 2.0]])
    np.testing.assert_allclose(tree.query(points).distance, [1.0, 1.0, 2.0])
    np.testing.assert_allclose(tree.distance(points), [1.0, 1.0, 2.0])


def test_walks_stay_on_their_sheet() -> None:
    """On a thin slab a point beyond the lower side is walked to on the upper one."""
    box = meshes.cube(8)
    slab = TriMesh(box.vertices * [1.0, 1.0, 0.01], box.faces)
    surface = ClosestPoints(slab)
    start = surface.query([[0.3, -0.2, 1.0]])
    hits = surface.query_near([[-0.2, 0.1, -0.02]], start.face)
    np.testing.assert_allclose(hits.point, [[-0.2, 0.1, 0.005]], atol=1e-12)
    assert surface.query([[-0.2, 0.1, -0.02]]).point[0, 2] == pytest.approx(-0.005)


@pytest.mark.parametrize("case", EVERY, ids=str)
def test_a_face_known_before_changes_no_answer(case: Case, rng: np.random.Generator) -> None:
    m = case.mesh
    surface = ClosestPoints(m)
    p = m.vertices.mean(axis=0) + rng.normal(size=(50, 3)) * m.diagonal / 3
    on = surface.query(p)
    near = on.point + 0.01 * m.diagonal * rng.normal(size=(50, 3))
    for start in (on.face, rng.integers(m.n_faces, size=50)):  # right, close by, or anywhere
        np.testing.assert_allclose(surface.query_from(p, start).distance, on.distance, atol=1e-12)
    hits = surface.query_from(near, on.face)
    np.testing.assert_allclose(hits.distance, surface.distance(near), rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(hits.interpolate(m.vertices[m.faces]), hits.point, atol=1e-14)


def test_a_face_known_before_keeps_its_side_of_a_thin_slab() -> None:
    box = meshes.cube(2)
    slab = TriMesh(box.vertices * [1.0, 1.0, 0.01], box.faces)
    surface = ClosestPoints(slab)
    top = surface.query([[-0.2, 0.1, 1.0]])
    below = [[-0.2, 0.1, -0.02]]
    assert surface.query_from(below, top.face).point[0, 2] == pytest.approx(0.005)
    assert surface.query(below).point[0, 2] == pytest.approx(-0.005)


def test_walks_on_a_sphere_end_at_the_closest_point(rng: np.random.Generator) -> None:
    mesh = meshes.icosphere(3)
    surface = ClosestPoints(mesh)
    start = rng.integers(mesh.n_faces, size=50)
    p = mesh.face_normals[start] + 0.5 * rng.normal(size=(50, 3))
    p *= 1.2 / np.linalg.norm(p, axis=1, keepdims=True)
    hits = surface.query_near(p, start)
    np.testing.assert_allclose(hits.distance, surface.distance(p), rtol=1e-6)
    np.testing.assert_allclose(hits.interpolate(mesh.vertices[mesh.faces]), hits.point, atol=1e-12)
    assert len(surface.query_near(np.zeros((0, 3)), np.zeros(0, dtype=int)).face) == 0

"""Cutting polygons into triangles: areas, convexity, concavity, and diagonals that clash."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests import meshes
from vhquad.mesh.polygons import PolygonSoup, triangulate
from vhquad.mesh.triangle import TriMesh


def soup(vertices: object, faces: list[list[int]]) -> PolygonSoup:
    v = np.array(vertices, dtype=np.float64)
    if v.shape[1] == 2:
        v = np.column_stack([v, np.zeros(len(v))])
    corners = np.array([i for f in faces for i in f], dtype=np.int64)
    return PolygonSoup(v, corners, np.array([len(f) for f in faces], dtype=np.int64))


def star(n: int) -> np.ndarray:
    """A flat star polygon of n points, concave at every other corner."""
    a = np.pi * np.arange(2 * n) / n
    r = np.where(np.arange(2 * n) % 2, 0.4, 1.0)
    return np.stack([r * np.cos(a), r * np.sin(a)], axis=1)


def shoelace(p: np.ndarray) -> float:
    q = np.roll(p, -1, axis=0)
    return float((p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]).sum() / 2)


def test_triangles_and_order_are_kept() -> None:
    s = soup(
        np.random.default_rng(0).normal(size=(6, 3)), [[3, 4, 5], [0, 1, 2, 3], [0, 1], [2, 1, 0]]
    )
    t = triangulate(s)
    assert t.source.tolist() == [0, 1, 1, 3]
    assert t.faces[0].tolist() == [3, 4, 5]
    assert t.faces[3].tolist() == [2, 1, 0]
    assert s.faces == [[3, 4, 5], [0, 1, 2, 3], [0, 1], [2, 1, 0]]


def test_convex_quads_take_the_shorter_diagonal() -> None:
    t = triangulate(soup([[0, 0], [3, 0], [4, 1], [1, 1]], [[0, 1, 2, 3]]))
    assert t.faces.tolist() == [[0, 1, 3], [1, 2, 3]]


@pytest.mark.parametrize("turn", range(4))
def test_a_concave_quad_is_cut_through_its_dent(turn: int) -> None:
    v = np.array([[0, 0], [2, -2], [0.5, 0.0], [2, 2]], dtype=float)
    v[2] = [3.0, 0.0]
    v[0] = [1.5, 0.0]  # the dent: the diagonal 1-3 would lie outside
    s = soup(v, [np.roll([0, 1, 2, 3], turn).tolist()])
    m = TriMesh(s.vertices, triangulate(s).faces)
    assert (m.face_normals[:, 2] > 0).all()
    assert m.area == pytest.approx(shoelace(v))


@pytest.mark.parametrize("n", [3, 5, 12, 40])
def test_stars_keep_their_area(n: int) -> None:
    p = star(n)
    flat = soup(p, [list(range(2 * n))])
    m = TriMesh(flat.vertices, triangulate(flat).faces)
    assert m.n_faces == 2 * n - 2
    assert (m.face_normals[:, 2] > 0).all()
    assert m.area == pytest.approx(shoelace(p))
    # The same in a tilted plane, and seen from behind.
    g = meshes.random_rigid(np.random.default_rng(n))
    turned = soup(g.points(flat.vertices), [list(range(2 * n))[::-1]])
    back = TriMesh(turned.vertices, triangulate(turned).faces)
    assert back.area == pytest.approx(shoelace(p))
    np.testing.assert_allclose(back.face_normals @ g.rotation[:, 2], -1.0, atol=1e-9)


@given(st.integers(3, 9), st.integers(0, 10**6))
def test_any_polygon_gives_two_triangles_less(size: int, seed: int) -> None:
    v = np.random.default_rng(seed).integers(0, 3, (size, 3)).astype(float)
    t = triangulate(soup(v, [list(range(size))]))
    assert t.faces.shape == (size - 2, 3)
    # The sides of the polygon and its inner diagonals, twice each, are all the halfedges.
    directed = np.stack([t.faces, np.roll(t.faces, -1, axis=1)], axis=2).reshape(-1, 2)
    net = np.zeros((size, size), dtype=int)
    np.add.at(net, (directed[:, 0], directed[:, 1]), 1)
    net = net - net.T
    expected = np.zeros((size, size), dtype=int)
    expected[np.arange(size), (np.arange(size) + 1) % size] = 1
    np.testing.assert_array_equal(net, expected - expected.T)


def test_clashing_diagonals_are_avoided() -> None:
    # Two flat quads over one pair of opposite corners (a doublet at vertex 4).
    v = [[0, 0], [2, -1.1], [2.2, 0], [2, 1.1], [1.1, 0.05]]
    s = soup(v, [[0, 1, 2, 4], [0, 4, 2, 3]])
    m = TriMesh(s.vertices, triangulate(s).faces)
    assert m.has_manifold_vertices
    assert m.euler_characteristic == 1
    assert np.isin(4, m.faces)


def test_polygons_of_closed_quad_meshes_stay_closed() -> None:
    for q in (meshes.quad_cube(1), meshes.quad_cube(4), meshes.quad_torus()):
        t = triangulate(PolygonSoup(q.vertices, q.quads.reshape(-1), np.full(q.n_quads, 4)))
        m = TriMesh(q.vertices, t.faces)
        assert m.is_closed
        assert m.euler_characteristic == q.euler_characteristic
        assert m.area == pytest.approx(TriMesh(q.vertices, q.triangles()).area, rel=2e-2)


def test_positions_that_are_not_finite_do_no_harm_here() -> None:
    v = np.full((6, 3), np.nan)
    t = triangulate(soup(v, [[0, 1, 2, 3, 4, 5], [0, 1, 2, 3]]))
    assert t.faces.shape == (6, 3)

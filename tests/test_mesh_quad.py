"""QuadMesh topology against known shapes and by hand."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests import meshes
from tests.data_paths import data_file
from vhquad.errors import MeshError
from vhquad.mesh.io import read_quad_mesh
from vhquad.mesh.quad import QuadMesh


def test_grid_by_hand() -> None:
    q = meshes.quad_grid(4, 3)
    assert (q.n_vertices, len(q.edges), q.n_quads) == (20, 31, 12)
    assert (q.euler_characteristic, q.n_boundary_loops, q.n_components, q.genus) == (1, 1, 1, 0)
    assert q.is_manifold
    assert q.irregular_interior == {}
    assert q.irregular_boundary == {2: 4}
    np.testing.assert_allclose(q.edge_lengths, 0.25)


def test_cube_and_torus() -> None:
    c, t = meshes.quad_cube(3), meshes.quad_torus()
    assert c.is_manifold
    assert t.is_manifold
    assert (c.euler_characteristic, c.genus, c.n_boundary_loops) == (2, 0, 0)
    assert (t.euler_characteristic, t.genus, t.n_boundary_loops) == (0, 1, 0)
    assert c.irregular_interior == {3: 8}
    assert t.irregular_interior == {}
    # Indices of a quad mesh: the sum of (4 - valence) / 4 is the Euler characteristic.
    assert sum((4 - v) * n for v, n in c.irregular_interior.items()) == 4 * 2


@pytest.mark.parametrize("make", [meshes.quad_grid, meshes.quad_cube, meshes.quad_torus])
def test_twins(make: object) -> None:
    q = make()  # type: ignore[operator]
    inner = np.flatnonzero(q.twin >= 0)
    assert (q.twin[q.twin[inner]] == inner).all()
    assert (q.tail[q.twin[inner]] == q.head[inner]).all()
    assert (np.flatnonzero(q.twin < 0).size == 0) == (q.n_boundary_loops == 0)


def test_two_components_and_touching_loops() -> None:
    v = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [2, 1], [2, 2], [1, 2]], float)
    q = QuadMesh(np.column_stack([v, np.zeros(7)]), [[0, 1, 2, 3], [2, 4, 5, 6]])
    assert q.n_components == 2
    assert q.n_boundary_loops == 2
    assert q.nonmanifold_vertices.tolist() == [2]
    assert not q.is_manifold


def test_bad_edges_are_found() -> None:
    square = meshes.quad_grid(2, 1)
    turned = QuadMesh(square.vertices, [square.quads[0], square.quads[1][::-1]])
    assert len(turned.misoriented_edges) == 1
    assert not turned.is_manifold
    assert turned.n_boundary_loops == 1
    fins = QuadMesh(
        np.vstack([[[0, 0, 0], [0, 0, 1]], np.random.default_rng(0).normal(size=(6, 3))]),
        [[0, 1, 2, 3], [1, 0, 4, 5], [0, 1, 6, 7]],
    )
    assert fins.edges[fins.nonmanifold_edges].tolist() == [[0, 1]]
    assert fins.nonmanifold_vertices.tolist() == [0, 1]
    assert fins.n_components == 1
    assert QuadMesh(np.eye(4, 3), [[0, 1, 1, 2]]).degenerate_quads.tolist() == [0]


def test_doublet() -> None:
    v = [[0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0], [1, 0.9, 0]]
    q = QuadMesh(v, [[0, 1, 2, 4], [0, 4, 2, 3]])
    assert q.doublets.tolist() == [4]
    assert q.is_manifold
    assert q.irregular_interior == {2: 1}
    assert q.euler_characteristic == 1


def test_triangles_take_the_shorter_diagonal() -> None:
    q = QuadMesh([[0, 0, 0], [3, 0, 0], [4, 1, 0], [1, 1, 0]], [[0, 1, 2, 3], [1, 2, 3, 0]])
    np.testing.assert_array_equal(q.triangles()[:2], [[0, 1, 3], [1, 2, 3]])
    np.testing.assert_array_equal(q.triangles()[2:], [[1, 2, 3], [1, 3, 0]])


def test_no_quads() -> None:
    q = QuadMesh(np.zeros((0, 3)), np.zeros((0, 4), dtype=int))
    assert (q.n_components, q.n_boundary_loops, q.euler_characteristic) == (0, 0, 0)


@pytest.mark.parametrize(
    ("v", "f", "say"),
    [
        (np.zeros((4, 2)), [[0, 1, 2, 3]], "shape"),
        (np.zeros((4, 3)), [[0, 1, 2]], "shape"),
        (np.zeros((4, 3)), [[0.0, 1.0, 2.0, 3.0]], "integers"),
        (np.zeros((4, 3)), [[0, 1, 2, 4]], "outside 0..3, the first is 0"),
        (np.full((4, 3), np.inf), [[0, 1, 2, 3]], "4 vertices are NaN"),
    ],
)
def test_bad_arrays_are_refused(v: object, f: object, say: str) -> None:
    with pytest.raises(MeshError, match=say):
        QuadMesh(v, f)  # type: ignore[arg-type]


@given(st.lists(st.lists(st.integers(0, 7), min_size=4, max_size=4), max_size=12))
def test_any_soup_has_figures(quads: list[list[int]]) -> None:
    v = np.random.default_rng(0).normal(size=(8, 3))
    q = QuadMesh(v, np.array(quads, dtype=np.int64).reshape(-1, 4))
    assert q.n_boundary_loops >= 0
    assert q.edge_quads.sum() == 4 * q.n_quads
    assert q.valence.sum() == 2 * len(q.edges)
    assert q.quad_component.size == q.n_quads
    assert q.triangles().shape == (2 * q.n_quads, 3)
    assert isinstance(q.is_manifold, bool)
    assert q.twin.size == 4 * q.n_quads


@pytest.mark.parametrize(
    ("name", "loops", "genus", "irregular"),
    [
        ("bob", 0, 1, 20),
        ("spot", 0, 0, 100),
        ("anny_head_mean_skin", 4, 0, 44),
        ("scotty_lizard", 0, 0, 299),
    ],
)
def test_figures_of_known_models(name: str, loops: int, genus: int, irregular: int) -> None:
    q = read_quad_mesh(data_file("quads", f"{name}.obj"))
    assert q.is_manifold
    assert (q.n_boundary_loops, q.genus) == (loops, genus)
    assert sum(q.irregular_interior.values()) == irregular

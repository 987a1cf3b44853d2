"""Welding: which vertices are one place, which are open, and quads put together again."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests import meshes, soups
from tests.meshes import EVERY, Case
from vhquad.mesh.quad import QuadMesh
from vhquad.mesh.weld import components, open_vertices, position_classes, weld_quads, weld_seams


def test_places_are_exact_and_zero_has_no_sign() -> None:
    p = np.array([[0, 0, 1], [1, 0, 0], [-0.0, 0, 1], [1, 0, 1e-16], [1, 0, 0]], dtype=float)
    assert position_classes(p).tolist() == [0, 1, 0, 3, 1]
    assert position_classes(np.zeros((0, 3))).tolist() == []


@given(st.lists(st.tuples(*[st.sampled_from([0.0, -0.0, 1.0, 0.1])] * 3), max_size=30))
def test_places_agree_with_a_dictionary(points: list[tuple[float, ...]]) -> None:
    first: dict[tuple[float, ...], int] = {}
    expected = [first.setdefault(p, i) for i, p in enumerate(points)]
    assert position_classes(np.array(points).reshape(-1, 3)).tolist() == expected


@pytest.mark.parametrize("case", EVERY, ids=str)
def test_open_vertices_are_those_of_the_boundary(case: Case) -> None:
    m = case.mesh
    np.testing.assert_array_equal(open_vertices(m.faces, m.n_vertices), m.is_boundary_vertex)


def test_closed_parts_keep_their_own_vertices() -> None:
    twice = meshes.merge(meshes.cube(1), meshes.cube(1))
    assert (weld_seams(twice.vertices, twice.faces) == np.arange(twice.n_vertices)).all()
    v, f = soups.unwelded(meshes.cube(1))
    assert len(np.unique(weld_seams(v, f))) == 8


def test_quads_split_at_seams_are_joined() -> None:
    cube = meshes.quad_cube(2)
    loose = QuadMesh(cube.vertices[cube.quads].reshape(-1, 3), np.arange(96).reshape(-1, 4))
    joined = weld_quads(loose)
    assert joined.is_manifold
    assert (joined.n_vertices, joined.n_boundary_loops) == (26, 0)
    np.testing.assert_array_equal(joined.vertices[joined.quads], cube.vertices[cube.quads])
    same = weld_quads(cube)
    np.testing.assert_array_equal(same.quads, cube.quads)


def test_components_are_numbered_by_lowest_node() -> None:
    pairs = np.array([[5, 1], [1, 3], [4, 2], [2, 4]])
    assert components(6, pairs[:, 0], pairs[:, 1]).tolist() == [0, 1, 2, 1, 2, 1]
    assert components(2, pairs[:0, 0], pairs[:0, 1]).tolist() == [0, 1]

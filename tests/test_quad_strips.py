"""Splitting strips of quads: counts by hand, crossings, and what must not change."""

from __future__ import annotations

import numpy as np
import pytest

from tests.quad_meshes import cube_sphere, quad_grid, quad_torus
from vhquad.mesh.quad import QuadMesh
from vhquad.mesh.quality import scaled_jacobians
from vhquad.quad.strips import split_strips


def edge_between(mesh: QuadMesh, a: int, b: int) -> int:
    return int(np.flatnonzero((mesh.edges == [min(a, b), max(a, b)]).all(axis=1))[0])


def test_one_strip_of_a_grid() -> None:
    """3 x 2 squares, vertex (i, j) is 3 i + j: the strip across the edge (0, 0)-(1, 0) has 2."""
    mesh = QuadMesh(*quad_grid(3, 2))
    made = split_strips(mesh, [edge_between(mesh, 0, 3)])
    assert made.mesh.n_quads == 8
    assert (made.edge >= 0).all()
    np.testing.assert_array_equal(made.mesh.vertices[: mesh.n_vertices], mesh.vertices)
    new = made.mesh.vertices[mesh.n_vertices :]
    np.testing.assert_allclose(new[np.argsort(new[:, 1])], [[0.5, y, 0] for y in (0, 1, 2)])
    assert scaled_jacobians(made.mesh).min() == pytest.approx(1.0)


def test_crossing_strips() -> None:
    """A row of 3 and a column of 2 share one square: 6 + 2 + 3 + 1 quads, one new centre."""
    mesh = QuadMesh(*quad_grid(3, 2))
    made = split_strips(mesh, [edge_between(mesh, 0, 3), edge_between(mesh, 0, 1)])
    assert made.mesh.n_quads == 12
    assert int((made.edge < 0).sum()) == 1
    np.testing.assert_allclose(made.mesh.vertices[-1], [0.5, 0.5, 0])
    assert scaled_jacobians(made.mesh).min() == pytest.approx(1.0)


@pytest.mark.parametrize("quads", [quad_torus(9, 5), cube_sphere(3), quad_grid(4, 3)])
def test_topology_and_valences_stay(quads: tuple[np.ndarray, np.ndarray]) -> None:
    mesh = QuadMesh(*quads)
    for edge in range(0, len(mesh.edges), 7):
        made = split_strips(mesh, [edge]).mesh
        assert made.is_manifold
        assert made.euler_characteristic == mesh.euler_characteristic
        assert made.n_boundary_loops == mesh.n_boundary_loops
        assert made.irregular_interior == mesh.irregular_interior
        assert made.irregular_boundary == mesh.irregular_boundary
        assert made.n_quads > mesh.n_quads


def test_all_strips_make_a_subdivision() -> None:
    mesh = QuadMesh(*quad_torus(6, 4))
    assert split_strips(mesh, np.arange(len(mesh.edges))).mesh.n_quads == 4 * mesh.n_quads


def test_no_edges() -> None:
    mesh = QuadMesh(*quad_grid(2, 2))
    made = split_strips(mesh, [])
    np.testing.assert_array_equal(made.mesh.quads, mesh.quads)

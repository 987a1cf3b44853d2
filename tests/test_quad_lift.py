"""lifted: quads that fold on the surface are opened, a little off it where it must be."""

from __future__ import annotations

import numpy as np
import pytest

from tests.quad_meshes import quad_grid, quad_torus, shaken, triangulated
from vhquad.mesh.closest import ClosestPoints
from vhquad.mesh.quality import least_jacobians
from vhquad.quad.lift import lifted, rim_vertices, wrong_quads
from vhquad.quad.smooth import smooth_quads

NOBODY = np.zeros(0, dtype=np.int64)


def test_what_is_right_is_left_alone() -> None:
    x, q = quad_torus()
    surface = ClosestPoints(triangulated((x, q)))
    nothing = np.zeros(len(x), dtype=bool)
    out, wrong = lifted(x, q, surface, nothing)
    np.testing.assert_array_equal(out, x)
    assert not wrong.any()


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_tube_of_three_quads_around_is_opened(seed: int) -> None:
    """Three quads around a round tube: their corners face 120 degrees apart on the surface."""
    x, q = quad_torus(40, 3, 1.0, 0.03)
    surface = ClosestPoints(triangulated(quad_torus(120, 24, 1.0, 0.03)))
    rng = np.random.default_rng(seed)
    x = surface.query(shaken((x, q), rng, 1.5, NOBODY)).point
    # 1: the test means something: on the surface some stay wrong.
    polished = smooth_quads(x, q, surface)
    assert wrong_quads(polished, q, surface).any()
    # 2: off it none does, and no vertex is farther from it than the tube is thick.
    out, wrong = lifted(polished, q, surface, np.zeros(len(x), dtype=bool))
    assert not wrong.any()
    assert not wrong_quads(out, q, surface).any()
    assert surface.distance(out).max() < 0.06


def test_held_vertices_stay_while_others_can_do() -> None:
    x, q = quad_grid(8)
    surface = ClosestPoints(triangulated((x, q)))
    held = np.zeros(len(x), dtype=bool)
    held[rim_vertices(q)] = True
    moved = x.copy()
    inner = np.flatnonzero(~held)
    moved[inner[24]] += [1.4, 1.3, 0.0]  # beyond its neighbours
    held[inner[0]] = True
    assert wrong_quads(moved, q, surface).any()
    out, wrong = lifted(moved, q, surface, held)
    assert not wrong.any()
    assert not wrong_quads(out, q, surface).any()
    np.testing.assert_array_equal(out[held], x[held])


def test_an_inner_held_vertex_is_let_go_where_nothing_else_helps() -> None:
    x, q = quad_grid(8)
    surface = ClosestPoints(triangulated((x, q)))
    rim = rim_vertices(q)
    moved = x.copy()
    inner = np.setdiff1d(np.arange(len(x)), rim)[24]
    moved[inner] += [1.4, 1.3, 0.0]
    held = np.ones(len(x), dtype=bool)
    assert wrong_quads(moved, q, surface).any()
    out, wrong = lifted(moved, q, surface, held)
    assert not wrong.any()
    assert not wrong_quads(out, q, surface).any()
    np.testing.assert_array_equal(out[rim], x[rim])


def test_a_quad_on_a_line_is_wrong() -> None:
    """Its corners turn the right way by rounding alone, so that none is folded."""
    x, q = quad_grid(3)
    surface = ClosestPoints(triangulated((x, q)))
    flat = np.array([[0.0, 0.0, 0.0], [3.0, 0.0, 0.0], [2.0, 1e-15, 0.0], [1.0, 1e-15, 0.0]])
    quad = np.array([[0, 1, 2, 3]])
    assert (least_jacobians(flat, quad) > 0).all()
    assert wrong_quads(flat, quad, surface).all()


def test_rim_vertices_of_a_grid() -> None:
    x, q = quad_grid(5)
    low, high = x[:, :2].min(axis=0), x[:, :2].max(axis=0)
    outside = ((x[:, :2] == low) | (x[:, :2] == high)).any(axis=1)
    np.testing.assert_array_equal(rim_vertices(q), np.flatnonzero(outside))
    assert rim_vertices(quad_torus()[1]).size == 0

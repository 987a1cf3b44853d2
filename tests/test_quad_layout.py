"""Layouts: grids glued along arcs, and collapsed where lengths are zero."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.map_stages import NAMES, stages
from tests.tmesh_cases import lengths, row
from vhquad.mesh.quad import QuadMesh
from vhquad.quad.layout import Layout, build_layout, side_length


def as_mesh(layout: Layout) -> QuadMesh:
    """The layout with arbitrary positions, for questions of topology."""
    points = np.random.default_rng(0).normal(size=(layout.n_vertices, 3))
    return QuadMesh(points, layout.quads)


@given(
    widths=st.lists(st.integers(0, 4), min_size=1, max_size=4).filter(any),
    height=st.integers(1, 4),
)
def test_a_row_of_rectangles_is_one_grid(widths: list[int], height: int) -> None:
    k = len(widths)
    layout = build_layout(row(k), lengths(k, widths, height))
    # Whatever the rectangles' widths, zero ones included, the row is a sum(widths) x height grid.
    w = sum(widths)
    mesh = as_mesh(layout)
    assert (layout.n_vertices, mesh.n_quads) == ((w + 1) * (height + 1), w * height)
    assert mesh.is_manifold
    assert (mesh.euler_characteristic, mesh.n_boundary_loops) == (1, 1)
    assert sorted(mesh.valence.tolist()) == sorted(
        [2] * 4 + [3] * (2 * (w - 1) + 2 * (height - 1)) + [4] * ((w - 1) * (height - 1))
    )
    assert mesh.irregular_interior == {}
    assert np.bincount(layout.quad_patch, minlength=k).tolist() == [a * height for a in widths]


def test_no_height_leaves_a_line() -> None:
    layout = build_layout(row(2), lengths(2, [2, 3], 0))
    assert len(layout.quads) == 0
    assert layout.n_vertices == 6  # bottom and top are one line of five edges
    assert build_layout(row(2), lengths(2, [0, 0], 0)).n_vertices == 1


def test_points_along_half_arcs() -> None:
    layout = build_layout(row(1), lengths(1, [3], 2))
    forward = layout.half_arc_points(0)
    assert len(forward) == 4
    assert (forward[0], forward[-1]) == (0, 1)  # its nodes
    np.testing.assert_array_equal(layout.half_arc_points(1), forward[::-1])
    flat = build_layout(row(1), lengths(1, [0], 2))
    assert flat.half_arc_points(0).tolist() == [0]
    assert flat.half_arc_points(1).tolist() == [1]


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("target", [20, 200])
def test_grids_share_their_borders(name: str, target: int) -> None:
    layout = stages(name).quantise(target).layout
    tmesh = layout.tmesh
    seen = np.zeros(layout.n_points, dtype=np.int64)
    for number, patch in enumerate(tmesh.patches):
        g = layout.grid(number)
        w, h = (side_length(layout.lengths, patch.sides[i]) for i in (0, 1))
        # 1. opposite sides agree; 2. a grid's border is its sides
        assert (w, h) == tuple(side_length(layout.lengths, patch.sides[i]) for i in (2, 3))
        assert g.shape == (w + 1, h + 1)
        for border, side in zip(
            (g[:, 0], g[-1], g[::-1, -1], g[0, ::-1]), patch.sides, strict=True
        ):
            # ... up to points that are one vertex
            np.testing.assert_array_equal(
                layout.vertex_of[border], layout.vertex_of[layout.side_points(side)]
            )
        if w > 1 and h > 1:
            seen[g[1:-1, 1:-1]] += 1
    # 3. inner points belong to one patch, points of arcs to none
    inner = np.arange(layout.n_points) >= layout.patch_offset[0] if tmesh.patches else seen > 0
    np.testing.assert_array_equal(seen[inner], 1)
    np.testing.assert_array_equal(seen[~inner], 0)
    # 4. every vertex has a quad
    assert np.unique(layout.quads).tolist() == list(range(layout.n_vertices))
    # 5. as many quads as the rectangles hold
    area = [
        np.prod([side_length(layout.lengths, p.sides[i]) for i in (0, 1)]) for p in tmesh.patches
    ]
    np.testing.assert_array_equal(np.bincount(layout.quad_patch, minlength=len(area)), area)


@pytest.mark.parametrize("name", NAMES)
def test_twice_the_lengths_are_four_times_the_quads(name: str) -> None:
    s = stages(name)
    layout = s.quantise(20).layout
    fine = build_layout(s.tmesh, 2 * layout.lengths)
    assert len(fine.quads) == 4 * len(layout.quads)
    a, b = as_mesh(layout), as_mesh(fine)
    # Splitting every quad in four keeps the irregular vertices; edges and quads get one each.
    assert fine.n_vertices == a.n_vertices + len(a.edges) + a.n_quads
    assert b.irregular_interior == a.irregular_interior
    assert (b.euler_characteristic, b.n_boundary_loops) == (
        a.euler_characteristic,
        a.n_boundary_loops,
    )

"""Polygons to quads: valid, same topology, few edits."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.meshes import EVERY, Case, merge, moved, one_triangle
from tests.quad_meshes import cube_sphere, quad_grid, quad_torus
from vhquad.quad.cells import Cells
from vhquad.quad.polygons import Quadrangulation, quads_from_polygons
from vhquad.quad.ragged import PolygonMesh


def assert_repaired(mesh: PolygonMesh, found: Quadrangulation) -> None:
    quads = found.quads
    assert quads.is_manifold
    assert quads.euler_characteristic == mesh.euler_characteristic
    old = found.source >= 0
    assert np.array_equal(quads.vertices[old], mesh.vertices[found.source[old]])


def blotched(mesh: PolygonMesh, share: float, rng: np.random.Generator) -> PolygonMesh:
    """Faces joined across random edges, up to eight sides, with no vertex twice in a face."""
    cells = Cells(mesh)
    for h, _, _ in cells.edges():
        t = cells.twin[h]
        if t < 0 or rng.random() > share or cells.face[h] == cells.face[t]:
            continue
        union = cells.corners(cells.face[h]) + cells.corners(cells.face[t])
        if len(set(union)) == len(union) - 2 and len(union) <= 10:
            cells.merge(h)
    return cells.mesh()


@pytest.mark.parametrize("quads", [quad_grid(5, 4), cube_sphere(3)], ids=["grid", "sphere"])
def test_good_quads_are_left_alone(quads: tuple[np.ndarray, np.ndarray]) -> None:
    mesh = PolygonMesh.from_lists(quads[0], quads[1].tolist())
    found = quads_from_polygons(mesh)
    assert (found.n_edited, found.resorted) == (0, False)
    assert np.array_equal(found.quads.quads, quads[1])
    assert np.array_equal(found.source, np.arange(len(quads[0])))


def test_hexagon_is_cut_in_two() -> None:
    v, q = quad_grid(2, 1)
    mesh = PolygonMesh.from_lists(v, [[0, 2, 4, 5, 3, 1]])
    found = quads_from_polygons(mesh)
    assert {frozenset(c) for c in found.quads.quads.tolist()} == {frozenset(c) for c in q.tolist()}


def test_two_triangles_far_apart_are_joined_by_a_path() -> None:
    """A strip of quads with a triangle at each end: one split edge a quad, nothing else."""
    v, q = quad_grid(6, 1)
    ends = np.array([[-1, 0.5, 0], [7, 0.5, 0]])
    mesh = PolygonMesh.from_lists(np.vstack([v, ends]), [*q.tolist(), [1, 14, 0], [12, 15, 13]])
    found = quads_from_polygons(mesh)
    assert_repaired(mesh, found)
    assert not found.resorted
    # The path crosses the 7 rungs; every quad becomes two.
    assert found.quads.n_quads == 14
    assert (found.source < 0).sum() == 7


def test_one_odd_polygon_runs_out_to_the_boundary() -> None:
    v, q = quad_grid(4, 4)
    middle = int(np.flatnonzero(q[:, 0] == 6)[0])
    a, b, c, d = q[middle]
    polygons = [p for k, p in enumerate(q.tolist()) if k != middle]
    # One of the 16 squares gets a fifth corner that its neighbour does not see: cut it instead.
    mesh = PolygonMesh.from_lists(v, [*polygons, [a, b, c], [a, c, d]])
    cells = Cells(mesh)
    cells.split_edge(cells.faces[-1][1])
    found = quads_from_polygons(cells.mesh())
    assert_repaired(cells.mesh(), found)
    assert not found.resorted


def test_doublets_go() -> None:
    """A quad of a grid replaced by two that share two edges around a new vertex."""
    v, q = quad_grid(3, 3)
    middle = int(np.flatnonzero(q[:, 0] == 5)[0])
    a, b, c, d = q[middle].tolist()
    rest = [p for k, p in enumerate(q.tolist()) if k != middle]
    w = len(v)
    points = np.vstack([v, v[[a, b, c, d]].mean(axis=0)])
    mesh = PolygonMesh.from_lists(points, [*rest, [a, b, c, w], [a, w, c, d]])
    found = quads_from_polygons(mesh)
    assert_repaired(mesh, found)
    assert found.quads.n_quads == 9
    assert len(found.quads.doublets) == 0


def test_coarse_torus_gets_told_apart() -> None:
    """One square glued to a torus: all its edges are loops."""
    mesh = PolygonMesh(
        np.zeros((1, 3)), np.zeros(4, dtype=np.int64), np.array([0, 4]), np.array([2, 3, 0, 1])
    )
    found = quads_from_polygons(mesh)
    assert_repaired(mesh, found)
    assert found.quads.n_quads <= 16


def test_narrow_tube_is_split_along_strips_only() -> None:
    """Two columns around a long tube: rungs repeat vertices, so the strips along it are cut."""
    n = 12
    i = np.arange(n)
    left = np.stack([2 * i, 2 * i + 2, 2 * i + 3, 2 * i + 1], axis=1)[: n - 1]
    right = np.stack([2 * i + 1, 2 * i + 3, 2 * i + 2, 2 * i], axis=1)[: n - 1]
    corners = np.concatenate([left, right]).reshape(-1)
    m = n - 1
    twin = np.full((2 * m, 4), -1, dtype=np.int64)
    k = np.arange(m)
    # Sides: 0 forward, 1 the rung ahead, 2 backward, 3 the rung behind; side 0 meets side 2.
    twin[:m, 0], twin[m:, 2] = 4 * (m + k) + 2, 4 * k
    twin[:m, 2], twin[m:, 0] = 4 * (m + k), 4 * k + 2
    twin[: m - 1, 1], twin[1:m, 3] = 4 * (k[:-1] + 1) + 3, 4 * k[:-1] + 1
    twin[m : 2 * m - 1, 1], twin[m + 1 :, 3] = 4 * (m + k[:-1] + 1) + 3, 4 * (m + k[:-1]) + 1
    angle = np.pi * np.tile([0, 1], n)
    points = np.stack([np.cos(angle), np.sin(angle), np.repeat(i, 2)], axis=1)
    mesh = PolygonMesh(points, corners, 4 * np.arange(2 * m + 1), twin.reshape(-1))
    assert mesh.euler_characteristic == 0
    found = quads_from_polygons(mesh)
    assert_repaired(mesh, found)
    assert not found.resorted
    # One column was cut lengthwise: three columns.
    assert found.quads.n_quads == 3 * m
    assert found.quads.n_boundary_loops == 2


@pytest.mark.parametrize("case", EVERY, ids=str)
def test_triangles_of_any_topology(case: Case) -> None:
    mesh = PolygonMesh.from_lists(case.mesh.vertices, case.mesh.faces.tolist())
    found = quads_from_polygons(mesh)
    assert_repaired(mesh, found)
    assert found.quads.n_boundary_loops == case.loops
    assert found.quads.n_components == case.components


@settings(max_examples=15)
@given(st.sampled_from(EVERY), st.floats(0.1, 0.9), st.integers(0, 10**6))
def test_random_polygons(case: Case, share: float, seed: int) -> None:
    start = PolygonMesh.from_lists(case.mesh.vertices, case.mesh.faces.tolist())
    mesh = blotched(start, share, np.random.default_rng(seed))
    assert mesh.euler_characteristic == start.euler_characteristic
    found = quads_from_polygons(mesh)
    assert_repaired(mesh, found)
    assert found.quads.n_boundary_loops == case.loops
    # Splitting from the centres gives a quad a corner.
    assert found.resorted or found.quads.n_quads < len(mesh.corners)


def test_few_quads_are_enough_after_light_damage() -> None:
    """Some edges of a fine quad torus dropped: hexagons, cut again in two where they were."""
    v, q = quad_torus(24, 12)
    mesh = blotched(PolygonMesh.from_lists(v, q.tolist()), 0.1, np.random.default_rng(0))
    assert (mesh.sides > 4).sum() > 10
    found = quads_from_polygons(mesh)
    assert_repaired(mesh, found)
    # Vertices left with two edges went, hence a few quads less.
    assert 0.95 * len(q) < found.quads.n_quads <= len(q)
    assert len(found.quads.doublets) == 0


def test_several_components_are_paired_each_by_itself() -> None:
    one = one_triangle()
    mesh = merge(one, moved(one, (3, 0, 0)))
    found = quads_from_polygons(PolygonMesh.from_lists(mesh.vertices, mesh.faces.tolist()))
    assert found.quads.n_components == 2
    assert found.quads.n_boundary_loops == 2

"""Extraction from integer-grid maps: exact counts, with and without folds, in any charts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.grid_maps import (
    GridCase,
    case_of,
    cone,
    moved_vertex,
    n_flipped,
    plane,
    torus,
    tube,
    turned_charts,
)
from tests.meshes import merge
from vhquad.errors import ParametrizationError
from vhquad.mesh.triangle import TriMesh
from vhquad.quad.extract import Extraction, extract_polygons
from vhquad.quad.grid import GRID, IntegerGridMap, rotate_quarter, settle
from vhquad.quad.isolines import trace_isolines

SEEDS = st.integers(0, 2**32 - 1)
SMALL = st.integers(1, 6)
LATTICE = st.integers(3, 11)


def counts(found: Extraction) -> tuple[int, int, int]:
    p = found.polygons
    return len(p.vertices), p.n_edges, p.n_polygons


def assert_valid(case: GridCase, found: Extraction) -> None:
    """Exactly the cells of the lattice, all quads, consistently glued, facing as the mesh does."""
    p = found.polygons
    assert counts(found) == (case.n_points, case.n_edges, case.n_cells)
    assert (p.sides == 4).all()
    assert_glued(found)


def assert_glued(found: Extraction) -> None:
    p = found.polygons
    inner = np.flatnonzero(p.twin >= 0)
    assert (p.twin[p.twin[inner]] == inner).all()
    assert (p.corners[p.twin[inner]] == p.corners[p.next[inner]]).all()
    assert (found.barycentric >= 0).all()
    assert np.allclose(found.barycentric.sum(axis=1), 1.0, atol=1e-12)


def any_case(kind: str, seed: int, width: int, height: int, nu: int, nv: int) -> GridCase:
    rng = np.random.default_rng(seed)
    if kind == "plane":
        return plane(width, height, nu * nv // 2, rng, odd=bool(seed % 2))
    if kind == "tube":
        return tube(width, height, nu, nv, rng)
    if kind == "torus":
        return torus(width, height, int(rng.integers(-3, 4)), nu, nv, rng)
    return cone(int(kind[4:]), width, nu, rng)


KINDS = st.sampled_from(["plane", "tube", "torus", "cone2", "cone3", "cone5", "cone6", "cone8"])


# ---- valid maps -----------------------------------------------------------------------------


@given(KINDS, SEEDS, SMALL, SMALL, LATTICE, LATTICE, st.booleans())
def test_valid_maps_give_their_lattice(
    kind: str, seed: int, width: int, height: int, nu: int, nv: int, turned: bool
) -> None:
    case = any_case(kind, seed, width, height, nu, nv)
    if n_flipped(case):  # a sheared torus lattice may fold; that is the next test's matter
        return
    if turned:
        case = turned_charts(case, np.random.default_rng(seed))
    found = extract_polygons(*case.args)
    assert_valid(case, found)
    assert found.n_contracted == 0


def test_a_square_of_two_triangles_by_hand() -> None:
    """Coarse triangles, fine cells, and a diagonal through grid points."""
    mesh = TriMesh([[0, 0, 0], [3, 0, 0], [3, 3, 0], [0, 3, 0.0]], [[0, 1, 2], [0, 2, 3]])
    uv = (mesh.vertices[:, :2] * GRID).astype(np.int64)[mesh.faces]
    found = extract_polygons(*case_of(mesh, uv, (16, 24, 9)).args)
    assert counts(found) == (16, 24, 9)
    lattice = {(i, j) for i in range(4) for j in range(4)}
    x = found.polygons.vertices
    # Positions are the lattice's, to rounding of the barycentric sum.
    assert {tuple(p) for p in np.rint(x[:, :2]).astype(int).tolist()} == lattice
    assert np.abs(x - np.rint(x)).max() < 1e-12
    # Cells are unit squares, counter-clockwise.
    p = x[found.polygons.corners.reshape(-1, 4)]
    area = np.cross(p[:, 2] - p[:, 0], p[:, 3] - p[:, 1]) / 2
    assert np.allclose(area, [0, 0, 1])


def test_vertices_on_grid_points_are_met_exactly() -> None:
    """A mesh whose vertices are the grid points: the output is the lattice of its vertices."""
    i, j = np.meshgrid(np.arange(5), np.arange(4), indexing="ij")
    v = np.stack([i, j, np.sin(i + 2.0 * j)], axis=-1).reshape(-1, 3).astype(float)
    a = (i[:-1, :-1] * 4 + j[:-1, :-1]).reshape(-1)
    squares = np.stack([a, a + 4, a + 5, a + 1], axis=1)
    mesh = TriMesh(v, np.concatenate([squares[:, [0, 1, 2]], squares[:, [0, 2, 3]]]))
    uv = (np.rint(v[:, :2]).astype(np.int64) * GRID)[mesh.faces]
    found = extract_polygons(*case_of(mesh, uv, (20, 31, 12)).args)
    assert counts(found) == (20, 31, 12)
    # Exactly on vertices, though no vertex was pinned but the corners.
    assert (found.barycentric.max(axis=1) == 1.0).all()
    quads = found.polygons.corners.reshape(-1, 4)
    key = {tuple(p): k for k, p in enumerate(v.tolist())}
    back = np.array([key[tuple(p)] for p in found.polygons.vertices.tolist()])[quads]
    assert {frozenset(q) for q in back.tolist()} == {frozenset(q) for q in squares.tolist()}


@pytest.mark.parametrize("quadrants", [2, 3, 5, 6, 7, 8])
def test_cones_become_irregular_vertices(quadrants: int) -> None:
    case = cone(quadrants, 3, 7, np.random.default_rng(quadrants))
    found = extract_polygons(*case.args)
    assert_valid(case, found)
    apex = np.flatnonzero(found.vertex == 0)
    assert len(apex) == 1
    valence = np.bincount(found.polygons.corners, minlength=case.n_points)
    assert valence[apex[0]] == quadrants
    assert (found.polygons.vertices[apex[0]] == case.mesh.vertices[0]).all()


def test_corners_joined_along_isolines() -> None:
    """A cross of five squares: inside edges run along isolines between pinned corners."""
    squares = [(1, 0), (0, 1), (1, 1), (2, 1), (1, 2)]
    corners = sorted({(i + a, j + b) for i, j in squares for a in (0, 1) for b in (0, 1)})
    number = {c: k for k, c in enumerate(corners)}
    faces = []
    for i, j in squares:
        a, b, c, d = (number[i + x, j + y] for x, y in ((0, 0), (1, 0), (1, 1), (0, 1)))
        faces += [[a, b, c], [a, c, d]]
    v = np.column_stack([np.array(corners), np.zeros(len(corners))])
    mesh = TriMesh(v, faces)
    for size in (1, 2, 3):
        uv = np.array(corners)[mesh.faces] * size * GRID
        cells = 5 * size**2
        rim = 12 * size
        case = case_of(mesh, uv, (1 + (2 * cells + rim // 2) - cells, 2 * cells + rim // 2, cells))
        for seed in range(4):
            turned = turned_charts(case, np.random.default_rng(seed))
            assert_valid(case, extract_polygons(*turned.args))


def test_boundary_vertices_lie_on_boundary_edges() -> None:
    case = turned_charts(tube(7, 4, 9, 5, np.random.default_rng(0)), np.random.default_rng(1))
    found = extract_polygons(*case.args)
    on = np.flatnonzero(found.halfedge >= 0)
    assert len(on) == 14
    h = found.halfedge[on]
    assert (case.mesh.twin[h] < 0).all()
    assert (found.barycentric[on, (h % 3 + 2) % 3] == 0.0).all()
    # They are the ends of the boundary edges of the polygons, each once.
    rim = found.polygons.corners[found.polygons.twin < 0]
    assert sorted(rim.tolist()) == on.tolist()


def test_components_come_out_side_by_side() -> None:
    rng = np.random.default_rng(3)
    a, b = cone(3, 2, 4, rng), torus(3, 4, 1, 8, 9, rng)
    mesh = merge(a.mesh, b.mesh)
    case = case_of(mesh, np.concatenate([a.uv, b.uv]), (0, 0, 0))
    total = tuple(
        np.add((a.n_points, a.n_edges, a.n_cells), (b.n_points, b.n_edges, b.n_cells)).tolist()
    )
    assert counts(extract_polygons(*case.args)) == total


# ---- folds ----------------------------------------------------------------------------------


def with_folds(case: GridCase, number: int, reach: float, rng: np.random.Generator) -> GridCase:
    """Some inside vertices that are no cones, moved by up to ``reach`` cells."""
    mesh = case.mesh
    pinned = settle(IntegerGridMap(*case.args)).pinned
    inside = np.flatnonzero(~mesh.is_boundary_vertex & ~pinned)
    for v in rng.permutation(inside)[:number]:
        move = rng.integers(-int(reach * GRID), int(reach * GRID) + 1, 2)
        case = moved_vertex(case, int(v), move)
    return case


@given(
    st.sampled_from(["plane", "tube", "torus", "cone3", "cone5"]),
    SEEDS,
    SMALL,
    SMALL,
    LATTICE,
    LATTICE,
    st.integers(1, 5),
)
def test_folds_are_undone(
    kind: str, seed: int, width: int, height: int, nu: int, nv: int, number: int
) -> None:
    """Moving inside vertices across their neighbours does not change what is extracted."""
    rng = np.random.default_rng(seed)
    flat = any_case(kind, seed, width, height, nu, nv)
    folded = with_folds(flat, number, 1.5, rng)
    found = extract_polygons(*turned_charts(folded, rng).args)
    # 1: a mesh of the topology of the surface, whatever happened.
    assert found.polygons.euler_characteristic == flat.n_points - flat.n_edges + flat.n_cells
    assert_glued(found)
    # 2: and that of the unfolded map, cell for cell.
    assert_valid(flat, found)


def test_fold_at_a_corner_between_the_boundary() -> None:
    """Two arcs of unlike sign join two corners side by side; neither is empty of length."""
    rng = np.random.default_rng(200)
    width, height, nu, nv = rng.integers([1, 1, 3, 3], [7, 7, 12, 12]).tolist()
    flat = any_case("plane", 200, width, height, nu, nv)
    assert_valid(flat, extract_polygons(*with_folds(flat, 20, 2.0, rng).args))


@given(KINDS, SEEDS, SMALL, SMALL, LATTICE, LATTICE)
def test_topology_survives_any_mess(
    kind: str, seed: int, width: int, height: int, nu: int, nv: int
) -> None:
    rng = np.random.default_rng(seed)
    flat = any_case(kind, seed, width, height, nu, nv)
    found = extract_polygons(*with_folds(flat, 30, 4.0, rng).args)
    assert found.polygons.euler_characteristic == flat.n_points - flat.n_edges + flat.n_cells
    assert_glued(found)


def test_folds_were_really_there() -> None:
    """The tests above would be empty if moved vertices made no spurious grid points."""
    seen = 0
    for seed in range(20):
        rng = np.random.default_rng(seed)
        case = with_folds(torus(5, 4, 1, 8, 8, rng), 5, 1.5, rng)
        graph = trace_isolines(IntegerGridMap(*case.args), settle(IntegerGridMap(*case.args)))
        seen += n_flipped(case) > 0 and len(graph.face) > 20 and bool((graph.sign < 0).any())
        # The signs of the grid points add up to the cells of the torus all the same.
        assert graph.sign.sum() == 4 * 20
    assert seen > 10


def test_boundary_that_runs_back_is_mended() -> None:
    wide = 0
    for seed in range(12):
        flat = plane(6, 4, 40, np.random.default_rng(seed), odd=True)
        mesh = flat.mesh
        z = np.rint(mesh.vertices[:, :2] * GRID).astype(np.int64)
        bottom = np.flatnonzero((z[:, 1] == 0) & (z[:, 0] % (6 * GRID) > 0))
        order = bottom[np.argsort(z[bottom, 0])]
        # Two neighbours on the lower side change places.
        z[order[1]], z[order[2]] = z[order[2]].copy(), z[order[1]].copy()
        wide += int(z[order[1], 0] - z[order[2], 0] > GRID)
        assert_valid(flat, extract_polygons(*case_of(mesh, z[mesh.faces], (0, 0, 0)).args))
    # More than a cell apart now and then, so that grid points of the boundary are met thrice.
    assert wide >= 3


# ---- refusals -------------------------------------------------------------------------------


def test_what_is_no_integer_grid_map_is_refused() -> None:
    rng = np.random.default_rng(0)
    case = tube(4, 3, 6, 4, rng)
    bent = case.uv.copy()
    bent[5, 1, 0] += 1
    with pytest.raises(ParametrizationError, match="do not carry"):
        extract_polygons(case.mesh, bent, case.rotation, case.translation)
    off = replace(case, uv=case.uv + np.array([0, GRID // 2]))
    with pytest.raises(ParametrizationError, match="do not run along isolines"):
        extract_polygons(*off.args)
    with pytest.raises(ParametrizationError, match="shapes"):
        extract_polygons(case.mesh, case.uv[1:], case.rotation, case.translation)
    square = plane(3, 3, 20, rng)
    shifted = replace(square, uv=square.uv + np.array([GRID // 2, 0]))
    with pytest.raises(ParametrizationError, match="isolines"):
        extract_polygons(*shifted.args)


def test_a_loop_without_grid_points_is_refused() -> None:
    """A tube half a cell long in its periodic direction cannot close."""
    case = tube(4, 3, 6, 4, np.random.default_rng(0))
    narrow = replace(case, uv=case.uv * np.array([0, 1]), translation=case.translation * [0, 1])
    with pytest.raises(ParametrizationError):
        extract_polygons(*narrow.args)


def test_quarter_turns() -> None:
    z = np.array([3, 1])
    assert rotate_quarter(z, np.array(1)).tolist() == [-1, 3]
    assert rotate_quarter(z, np.array(2)).tolist() == [-3, -1]
    assert rotate_quarter(z, np.array(-1)).tolist() == [1, -3]

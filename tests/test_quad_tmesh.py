"""The T-mesh tiles the surface with rectangles: areas, sides, incidences and Euler's formula."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.map_stages import NAMES, Stages, made, noisy, stages
from tests.meshes import icosphere, torus
from vhquad.errors import ParametrizationError
from vhquad.mesh.closest import ClosestPoints
from vhquad.mesh.triangle import TriMesh
from vhquad.quad.motorcycle import trace
from vhquad.quad.seamless import irregular_vertices
from vhquad.quad.tmesh import TMesh, build_tmesh


def sides(tmesh: TMesh) -> np.ndarray:
    """Parametric length of the four sides of each patch; (p, 4)."""
    length = tmesh.lengths
    return np.array(
        [[sum(length[h >> 1] for h in side) for side in p.sides] for p in tmesh.patches]
    )


def check_tiling(s: Stages) -> None:
    tmesh, mesh = s.tmesh, s.aligned.mesh
    extent = sides(tmesh)
    # 1. rectangles: opposite sides are equal
    np.testing.assert_allclose(extent[:, :2], extent[:, 2:], rtol=1e-9, atol=1e-9)
    # 2. which cover the map once
    assert (extent[:, 0] * extent[:, 1]).sum() == pytest.approx(s.seamless.area, rel=1e-9)
    # 3. every half-arc bounds one patch, or the outside where it runs back along a boundary
    used = Counter(h for p in tmesh.patches for side in p.sides for h in side)
    assert set(used.values()) <= {1}
    outer = 2 * len(tmesh.arcs) - len(used)
    loops = np.concatenate([*mesh.boundary_loops, np.zeros(0, dtype=np.int64)]).astype(np.int64)
    on_boundary = np.isin(
        [c[0] for c in tmesh.curve_halfedges], loops
    )  # curves are boundary or crease throughout
    assert outer == sum(bool(on_boundary[a.feature]) for a in tmesh.arcs if a.feature >= 0)
    # 4. each side is a chain of arcs from node to node, and the sides make a loop
    for p in tmesh.patches:
        ends = [
            (a.end, a.start) if h & 1 else (a.start, a.end)
            for side in p.sides
            for h in side
            for a in [tmesh.arcs[h >> 1]]
        ]
        assert [e for _, e in ends] == [ends[(i + 1) % len(ends)][0] for i in range(len(ends))]
    # 5. Euler's formula
    nodes, arcs, patches = len(tmesh.node_points), len(tmesh.arcs), len(tmesh.patches)
    assert nodes - arcs + patches == mesh.euler_characteristic


@pytest.mark.parametrize("name", NAMES)
def test_patches_tile_the_surface(name: str) -> None:
    check_tiling(stages(name))


@given(seed=st.integers(0, 10_000), strength=st.floats(0.3, 1.0), handle=st.booleans())
@settings(max_examples=10)
def test_patches_tile_the_surface_whatever_the_field(
    seed: int, strength: float, handle: bool
) -> None:
    mesh = torus(16, 8) if handle else icosphere(2)
    s = made(mesh, z=noisy(mesh, strength, np.random.default_rng(seed)))
    if s.seamless.is_valid:
        check_tiling(s)


@pytest.mark.parametrize("name", NAMES)
def test_arcs_and_nodes_lie_on_the_surface(name: str) -> None:
    s = stages(name)
    tmesh, mesh = s.tmesh, s.aligned.mesh
    # 1. arcs join their nodes, run along the surface, and their parameter grows
    for arc in tmesh.arcs:
        assert np.array_equal(arc.points[0], tmesh.node_points[arc.start])
        assert np.array_equal(arc.points[-1], tmesh.node_points[arc.end])
        assert arc.at[0] == 0
        assert (np.diff(arc.at) >= 0).all()
        assert len(arc.at) == len(arc.points)
    points = np.concatenate([arc.points for arc in tmesh.arcs])
    assert ClosestPoints(mesh).query(points).distance.max() < 1e-9 * mesh.diagonal
    # 2. special vertices are nodes; those a polish must not move are the irregular feature ones
    at = tmesh.node_vertex >= 0
    np.testing.assert_array_equal(tmesh.node_points[at], mesh.vertices[tmesh.node_vertex[at]])
    assert set(tmesh.node_vertex[at]) == set(np.flatnonzero(s.tracing.special))
    on_feature = np.zeros(mesh.n_vertices, dtype=bool)
    on_feature[mesh.tail[s.aligned.feature]] = on_feature[mesh.head[s.aligned.feature]] = True
    fixed = np.zeros(mesh.n_vertices, dtype=bool)
    fixed[tmesh.node_vertex[tmesh.node_fixed]] = True
    np.testing.assert_array_equal(fixed, irregular_vertices(s.aligned) & on_feature)
    # 3. nodes with a feature lie on its polyline
    for node in np.flatnonzero(tmesh.node_feature >= 0):
        line = tmesh.curves[tmesh.node_feature[node]]
        assert polyline_distance(tmesh.node_points[node], line) < 1e-12 * mesh.diagonal


def polyline_distance(point: np.ndarray, line: np.ndarray) -> float:
    a, b = line[:-1], line[1:]
    d = b - a
    t = np.clip(((point - a) * d).sum(axis=1) / (d * d).sum(axis=1), 0, 1)
    return float(np.linalg.norm(a + t[:, None] * d - point, axis=1).min())


@pytest.mark.parametrize("name", NAMES)
def test_arcs_of_a_track_or_curve_stand_in_order(name: str) -> None:
    s = stages(name)
    tmesh = s.tmesh
    assert all((a.track >= 0) != (a.feature >= 0) for a in tmesh.arcs)
    for number, track in enumerate(s.tracing.tracks):
        own = [a for a in tmesh.arcs if a.track == number]
        assert tmesh.node_vertex[own[0].start] == track.vertex
        assert [a.end for a in own[:-1]] == [a.start for a in own[1:]]
        length = sum(a.length for a in own)
        assert length == pytest.approx(track.length * s.seamless.unit, rel=1e-9)
    mesh = s.aligned.mesh
    chains = tmesh.curve_halfedges
    assert sorted(int(mesh.halfedge_edge[h]) for c in chains for h in c) == sorted(
        set(mesh.halfedge_edge[s.aligned.feature].tolist())
    )
    for number, chain in enumerate(chains):
        np.testing.assert_array_equal(mesh.head[chain[:-1]], mesh.tail[chain[1:]])
        np.testing.assert_array_equal(tmesh.curves[number][:-1], mesh.vertices[mesh.tail[chain]])
        own = [a for a in tmesh.arcs if a.feature == number]
        assert [a.end for a in own[:-1]] == [a.start for a in own[1:]]


def test_a_rectangle_is_one_patch() -> None:
    s = stages("grid")  # 1 x 0.75
    assert len(s.tmesh.patches) == 1
    lengths = sorted((sides(s.tmesh)[0] * s.edge).tolist())
    np.testing.assert_allclose(lengths, [0.75, 0.75, 1.0, 1.0], rtol=1e-4)
    assert s.tmesh.node_fixed.all()


def test_a_cube_with_creases_is_six_squares() -> None:
    s = stages("cube")
    assert (len(s.tmesh.patches), len(s.tmesh.arcs), len(s.tmesh.node_points)) == (6, 12, 8)
    np.testing.assert_allclose(sides(s.tmesh) * s.edge, 1.0, rtol=1e-4)


def test_a_cylinder_is_cut_open_by_its_seeds() -> None:
    s = stages("cylinder")
    assert len(s.tmesh.patches) == len(s.tmesh.arcs) // 3
    assert len(s.tmesh.curves) == 2
    for curve in s.tmesh.curves:  # closed
        np.testing.assert_array_equal(curve[0], curve[-1])


def test_charts_of_arcs_are_where_the_arcs_are() -> None:
    s = stages("pretzel")
    mesh: TriMesh = s.aligned.mesh
    for arc in s.tmesh.arcs:
        for (face, _, u, v), node in ((arc.chart, arc.start), (arc.back_chart, arc.end)):
            p = s.seamless.uv[face].astype(float)
            e, g, d = p[1] - p[0], p[2] - p[0], np.array([u, v]) - p[0]
            det = e[0] * g[1] - e[1] * g[0]
            w1, w2 = (d[0] * g[1] - d[1] * g[0]) / det, (e[0] * d[1] - e[1] * d[0]) / det
            assert min(w1, w2, 1 - w1 - w2) > -1e-6
            place = np.array([1 - w1 - w2, w1, w2]) @ mesh.vertices[mesh.faces[face]]
            assert np.linalg.norm(place - s.tmesh.node_points[node]) < 1e-6 * mesh.diagonal


def test_a_track_gone_astray_is_noticed() -> None:
    # With one track ended at once where it started, the faces beside it are no rectangles.
    s = stages("blob")
    tracing = trace(s.aligned, s.seamless)
    v = tracing.tracks[0].vertex
    ports = dict(tracing.ports)
    ports[v] = [replace(p, gap=2) for p in ports[v]]
    with pytest.raises(ParametrizationError, match="corners instead of 4"):
        build_tmesh(s.aligned, s.seamless, replace(tracing, ports=ports))

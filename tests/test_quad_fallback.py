"""The last resort: valid quads of the input's topology from any triangles; and its decimation."""

from __future__ import annotations

import numpy as np
import pytest

from tests.meshes import EVERY, Case, grid, icosphere, merge, moved, one_triangle, torus
from vhquad.mesh.closest import ClosestPoints
from vhquad.mesh.triangle import TriMesh
from vhquad.quad.decimate import decimate
from vhquad.quad.fallback import boundary_curves, pair_triangles, triangles_to_quads
from vhquad.quad.sliding import folded_quads


@pytest.mark.parametrize("target", [1, 60, 2000])
@pytest.mark.parametrize("case", EVERY, ids=str)
def test_always_valid_with_the_same_topology(case: Case, target: int) -> None:
    mesh = case.mesh
    quads = triangles_to_quads(mesh, target, iterations=2)
    assert quads.is_manifold
    assert quads.euler_characteristic == case.euler
    assert quads.n_boundary_loops == case.loops
    assert quads.n_components == case.components
    assert len(quads.doublets) == 0
    # On the surface, and the boundary on the boundary, to rounding.
    assert ClosestPoints(mesh).query(quads.vertices).distance.max() < 1e-12
    rim = np.flatnonzero(quads.is_boundary_vertex)
    curves = boundary_curves(mesh)
    gap = np.full(len(rim), np.inf)
    for c in range(case.loops):
        on = curves.bind(np.full(quads.n_vertices, c))
        here = on.position(rim, on.locate(rim, quads.vertices[rim]))
        gap = np.minimum(gap, np.linalg.norm(here - quads.vertices[rim], axis=1))
    assert (gap < 1e-12).all()


def test_count_and_quality_on_a_sphere() -> None:
    mesh = icosphere(4)
    quads = triangles_to_quads(mesh, 800)
    assert 0.85 * 800 < quads.n_quads < 1.15 * 800
    normals = quads.vertices[quads.quads].mean(axis=1)
    assert not folded_quads(quads.vertices, quads.quads, normals).any()


def test_a_single_triangle_becomes_three_quads() -> None:
    quads = triangles_to_quads(one_triangle(), 3)
    assert quads.n_quads == 3
    # Its three corners stay where they are.
    corners = one_triangle().vertices
    assert all((np.abs(quads.vertices - c).sum(axis=1) < 1e-15).any() for c in corners)


@pytest.mark.parametrize("case", EVERY, ids=str)
def test_decimation_keeps_topology_to_the_last_collapse(case: Case) -> None:
    coarse, source = decimate(case.mesh, 0)
    assert coarse.euler_characteristic == case.euler
    assert len(coarse.boundary_loops) == case.loops
    assert coarse.n_components == case.components
    assert coarse.has_manifold_vertices
    assert np.array_equal(coarse.vertices, case.mesh.vertices[source])
    assert case.mesh.is_boundary_vertex[source][coarse.is_boundary_vertex].all()
    again = decimate(case.mesh, case.mesh.n_faces)[0]
    assert np.array_equal(again.faces, case.mesh.faces)


def test_decimation_reaches_its_target() -> None:
    for mesh in (icosphere(4), torus(60, 30), merge(icosphere(3), moved(grid(20, 20), (3, 0, 0)))):
        n = decimate(mesh, 400)[0].n_faces
        assert 380 <= n <= 400


def test_pairing_follows_the_field() -> None:
    """A sheared lattice whose triangles pair in two ways: the cross decides."""
    i, j = np.meshgrid(np.arange(9), np.arange(9), indexing="ij")
    v = np.stack([i + 0.5 * j, np.sqrt(3) / 2 * j, 0 * i], axis=-1).reshape(-1, 3).astype(float)
    a = (i[:-1, :-1] * 9 + j[:-1, :-1]).reshape(-1)
    mesh = TriMesh(
        v, np.concatenate([np.stack([a, a + 9, a + 1], 1), np.stack([a + 9, a + 10, a + 1], 1)])
    )
    for turn in (0.0, np.pi / 3):
        d = np.tile([np.cos(turn), np.sin(turn), 0.0], (mesh.n_vertices, 1))
        polygons = pair_triangles(mesh, d)
        quads = polygons.corners[polygons.start[:-1][polygons.sides == 4][:, None] + np.arange(4)]
        p = v[quads]
        sides = np.roll(p, -1, axis=1) - p
        slope = np.arctan2(sides[..., 1], sides[..., 0])
        follow = (np.abs(np.sin(slope - turn)) < 1e-9).any(axis=1)
        assert len(quads) > 40
        # Rhombi with a side along the field; without it a third would lie across.
        assert follow.mean() > 0.9


def test_pairing_leaves_no_inside_vertex_with_two_polygons() -> None:
    mesh = icosphere(3)
    polygons = pair_triangles(mesh)
    valence = np.bincount(polygons.corners, minlength=mesh.n_vertices)
    assert valence.min() >= 3
    assert (polygons.sides == 4).sum() * 2 + (polygons.sides == 3).sum() == mesh.n_faces
    assert polygons.euler_characteristic == 2

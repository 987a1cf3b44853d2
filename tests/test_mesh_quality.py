"""Quality figures: squares, sheared, folded and flipped quads by hand; distances in closed form."""

from __future__ import annotations

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests import meshes
from tests.data_paths import data_file
from vhquad.mesh.closest import ClosestPoints
from vhquad.mesh.distance import Distance, sample_surface, surface_distance
from vhquad.mesh.io import read_quad_mesh
from vhquad.mesh.quad import QuadMesh
from vhquad.mesh.quality import check_quads, flipped_quads, scaled_jacobians
from vhquad.mesh.triangle import TriMesh


def quad(*corners: tuple[float, ...]) -> QuadMesh:
    v = np.array([(*c, 0.0)[:3] for c in corners], dtype=float)
    return QuadMesh(v, [[0, 1, 2, 3]])


def as_triangles(mesh: QuadMesh) -> TriMesh:
    return TriMesh(mesh.vertices, mesh.triangles())


def apart(result: TriMesh, surface: TriMesh) -> Distance:
    return surface_distance(ClosestPoints(result), ClosestPoints(surface))


def test_scaled_jacobian_is_the_sine_of_the_corner() -> None:
    np.testing.assert_allclose(scaled_jacobians(quad((0, 0), (2, 0), (2, 1), (0, 1))), 1.0)
    angle = np.radians(50)
    c, s = np.cos(angle), np.sin(angle)
    np.testing.assert_allclose(
        scaled_jacobians(quad((0, 0), (1, 0), (1 + 3 * c, 3 * s), (3 * c, 3 * s))), s
    )
    # A dent at corner 2, a straight corner, and a bow tie.
    dent = scaled_jacobians(quad((0, 0), (3, 0), (0.5, 0.5), (0, 3)))[0]
    assert (dent < 0).tolist() == [False, False, True, False]
    straight = scaled_jacobians(quad((0, 0), (1, 0), (2, 0), (0, 2)))[0]
    assert straight[1] == 0
    bow = scaled_jacobians(quad((0, 0), (1, 1), (1, 0), (0, 1)))
    assert (bow == 0).all()
    # A side without length.
    point = scaled_jacobians(quad((0, 0), (1, 0), (1, 0), (0, 1)))[0]
    assert (point[1:3] == 0).all()


@given(st.integers(0, 10**6))
def test_scaled_jacobian_does_not_see_motion_or_scale(seed: int) -> None:
    rng = np.random.default_rng(seed)
    q = QuadMesh(rng.normal(size=(8, 3)), [[0, 1, 2, 3], [4, 5, 6, 7]])
    moved = QuadMesh(meshes.random_rigid(rng).points(7.0 * q.vertices), q.quads)
    value = scaled_jacobians(q)
    np.testing.assert_allclose(scaled_jacobians(moved), value, atol=1e-10)
    np.testing.assert_allclose(
        scaled_jacobians(QuadMesh(q.vertices, q.quads[:, ::-1]))[:, ::-1], value
    )
    assert np.abs(value).max() <= 1 + 1e-12


def test_report_of_a_cube() -> None:
    cube = meshes.quad_cube(4)
    r = check_quads(cube, meshes.cube(3))
    assert r.is_valid
    assert (r.quads, r.vertices, r.components, r.euler_characteristic) == (96, 98, 1, 2)
    assert (r.boundary_loops, r.folded_quads, r.flipped_quads, r.doublets) == (0, 0, 0, 0)
    assert r.irregular_interior == {3: 8}
    assert r.irregular_vertices == 8
    assert r.scaled_jacobian_min == pytest.approx(1.0)
    assert r.scaled_jacobian_mean == pytest.approx(1.0)
    assert (r.edge_length_min, r.edge_length_max) == pytest.approx((0.25, 0.25))
    assert r.distance is not None
    assert r.distance.hausdorff < 1e-12
    assert json.loads(json.dumps(r.to_dict()))["distance"]["mean"] < 1e-12


def test_faults_are_counted() -> None:
    g = meshes.quad_grid(3, 3)
    v = np.vstack([g.vertices, [[9, 9, 9]]])
    v[5] = v[10] + [0.1, 0.05, 0.0]  # an inner vertex dragged across the quad beside it
    r = check_quads(QuadMesh(v, g.quads))
    assert r.folded_quads > 0
    assert r.scaled_jacobian_min < 0
    assert r.unused_vertices == 1
    assert not r.is_valid
    assert r.distance is None
    assert r.flipped_quads is None
    flat = check_quads(quad((0, 0), (1, 0), (2, 0), (3, 0)))
    assert flat.degenerate_quads == 1
    double = check_quads(QuadMesh(g.vertices, np.vstack([g.quads, g.quads[:1]])))
    assert double.nonmanifold_edges > 0
    assert not double.is_valid


def test_nothing_is_judged_too() -> None:
    r = check_quads(QuadMesh(np.zeros((0, 3)), np.zeros((0, 4), dtype=int)), meshes.cube(1))
    assert not r.is_valid
    assert np.isnan(r.scaled_jacobian_min)
    assert r.distance is None


def test_flipped_quads_are_named() -> None:
    torus = meshes.quad_torus()
    surface = meshes.torus(60, 30)
    q = torus.quads.copy()
    q[[3, 50]] = q[[3, 50]][:, ::-1]
    assert flipped_quads(torus, ClosestPoints(surface)).size == 0
    assert flipped_quads(QuadMesh(torus.vertices, q), ClosestPoints(surface)).tolist() == [3, 50]
    # Coarse quads across the cube's edges and corners are not flipped.
    ball = meshes.quad_cube(2)
    v = ball.vertices / np.linalg.norm(ball.vertices, axis=1, keepdims=True) * 0.6
    assert flipped_quads(QuadMesh(v, ball.quads), ClosestPoints(meshes.cube(4))).size == 0


@pytest.mark.parametrize(("thickness", "count"), [(0.02, 0), (0.5, 1)])
def test_sheets_thinner_than_a_quad_flip_nothing(thickness: float, count: int) -> None:
    """A quad of the upper side lies a little below a slab: wrong only if that side is far away."""
    box = meshes.cube(4)
    slab = TriMesh(box.vertices * [1.0, 1.0, thickness], box.faces)
    z = -0.5 * thickness - 0.001
    one = QuadMesh([[0, 0, z], [0.1, 0, z], [0.1, 0.1, z], [0, 0.1, z]], [[0, 1, 2, 3]])
    assert len(flipped_quads(one, ClosestPoints(slab))) == count


def test_distance_between_shells() -> None:
    inner, outer = meshes.icosphere(4, 1.0), meshes.icosphere(4, 1.1)
    d = apart(inner, outer)
    gap = 100 * 0.1 / outer.diagonal
    for value in (d.hausdorff, d.to_surface_max, d.from_surface_max):
        assert value == pytest.approx(gap, rel=0.01)
    for value in (d.mean, d.to_surface_mean, d.from_surface_mean):
        assert value == pytest.approx(gap, rel=0.01)
    assert apart(inner, inner).hausdorff < 1e-12


def test_distance_is_taken_both_ways() -> None:
    # Half of a sheet lies on the whole sheet, but not the other way round.
    whole, half = meshes.grid(8, 6, 2.0, 1.0), meshes.grid(4, 6, 1.0, 1.0)
    d = apart(half, whole)
    assert d.to_surface_max == pytest.approx(0.0, abs=1e-12)
    assert d.from_surface_max == pytest.approx(100 / np.sqrt(5))
    assert d.from_surface_mean == pytest.approx(100 / np.sqrt(5) / 4, rel=1e-3)
    assert d.hausdorff == d.from_surface_max


def test_samples_cover_the_area_evenly() -> None:
    m = meshes.blob(2)
    s = sample_surface(m.vertices, m.faces, 20_000)
    assert s.area.sum() == pytest.approx(m.area)
    assert (np.bincount(s.face, minlength=m.n_faces) >= 1).all()
    assert len(s.point) == pytest.approx(20_000, rel=0.05)
    # The mean of a linear function over a triangle is its value at the centroid: samples agree.
    by_face = np.stack([np.bincount(s.face, weights=s.point[:, i] * s.area) for i in range(3)], 1)
    exact = m.vertices[m.faces].mean(axis=1) * m.face_areas[:, None]
    assert np.abs(by_face - exact).max() < 0.03 * m.face_areas.max() * m.edge_lengths.max()
    one = sample_surface(m.vertices, m.faces, 0)
    np.testing.assert_allclose(one.point, m.vertices[m.faces].mean(axis=1), atol=1e-12)


def test_an_artists_mesh() -> None:
    q = read_quad_mesh(data_file("quads", "bob.obj"))
    r = check_quads(q, as_triangles(q))
    assert r.is_valid
    assert (r.euler_characteristic, r.irregular_vertices, r.flipped_quads) == (0, 20, 0)
    assert r.distance is not None
    assert r.distance.hausdorff < 1e-10
    assert 0.5 < r.scaled_jacobian_mean <= 1

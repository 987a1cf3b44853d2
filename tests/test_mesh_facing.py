"""FacingPoints: the nearest point among faces that face the way asked for."""

from __future__ import annotations

import numpy as np

from tests.meshes import icosphere
from vhquad.mesh.closest import ClosestPoints
from vhquad.mesh.facing import FacingPoints
from vhquad.mesh.triangle import TriMesh


def plate(height: float) -> TriMesh:
    """Two unit squares, one a height above the other, facing away from each other."""
    square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=np.float64)
    below = np.array([[0, 2, 1], [0, 3, 2]])
    vertices = np.concatenate([square, square + np.array([0, 0, height])])
    return TriMesh(vertices, np.concatenate([below, below[:, ::-1] + 4]))


def test_the_sheet_that_faces_that_way_is_found_though_the_other_is_nearer() -> None:
    mesh = plate(0.1)
    rng = np.random.default_rng(0)
    points = np.column_stack([rng.random((20, 2)), np.full(20, 0.08)])
    near = FacingPoints(mesh, points)
    up = np.tile([0.0, 0.0, 1.0], (20, 1))
    np.testing.assert_allclose(near.query(points, up)[:, 2], 0.1, atol=1e-12)
    found = near.query(points, -up)
    np.testing.assert_allclose(found, points * [1, 1, 0], atol=1e-12)


def test_without_a_face_that_way_points_stay() -> None:
    points = np.array([[0.5, 0.5, 0.05]])
    near = FacingPoints(plate(0.1), points)
    np.testing.assert_array_equal(near.query(points, np.array([[1.0, 0.0, 0.0]])), points)
    far = points + 100.0
    nothing = FacingPoints(plate(0.1), far)
    np.testing.assert_array_equal(nothing.query(far, np.array([[0.0, 0.0, 1.0]])), far)


def test_on_one_sheet_it_is_the_closest_point() -> None:
    mesh = icosphere(3)
    rng = np.random.default_rng(1)
    normal = rng.normal(size=(200, 3))
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    points = normal * rng.uniform(0.7, 1.3, (200, 1))
    found = FacingPoints(mesh, points).query(points, normal)
    np.testing.assert_allclose(found, ClosestPoints(mesh).query(points).point, atol=1e-12)

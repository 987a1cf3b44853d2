"""Triangles known by their edge lengths alone."""

from __future__ import annotations

import numpy as np
import pytest

from tests import meshes
from vhquad.errors import MeshError
from vhquad.geometry import intrinsic

RIGHT = np.array([[3.0, 4.0, 5.0]])  # halfedges 0->1, 1->2, 2->0: the right angle is corner 1


def test_right_triangle_by_hand() -> None:
    # 1. Area of a 3-4-5 triangle.
    assert intrinsic.areas(RIGHT) == pytest.approx([6.0], rel=1e-15)
    # 2. Corner 1 lies between the legs; the others have tangents 4/3 and 3/4.
    assert intrinsic.corner_angles(RIGHT)[0] == pytest.approx(
        [np.arctan2(4, 3), np.pi / 2, np.arctan2(3, 4)], rel=1e-15
    )
    # 3. Cotangents.
    assert intrinsic.cotangents(RIGHT)[0] == pytest.approx([0.75, 0.0, 4 / 3], abs=1e-15)


def test_agrees_with_the_embedding() -> None:
    mesh = meshes.blob()
    np.testing.assert_allclose(intrinsic.areas(mesh.edge_lengths), mesh.face_areas, rtol=1e-12)
    angles = intrinsic.corner_angles(mesh.edge_lengths)
    np.testing.assert_allclose(angles, mesh.corner_angles, rtol=1e-12)


def test_needle_keeps_its_digits() -> None:
    # Base 1e-9, legs 1: Heron's plain formula would lose half the digits of the area.
    needle = np.array([[1.0, 1e-9, 1.0]])
    assert intrinsic.areas(needle) == pytest.approx([5e-10], rel=1e-12)


def test_mollified_lengths_leave_good_triangles_alone() -> None:
    mesh = meshes.torus()
    np.testing.assert_array_equal(intrinsic.mollified_lengths(mesh.edge_lengths), mesh.edge_lengths)


@pytest.mark.parametrize(
    "lengths", [[[1.0, 1.0, 2.0]], [[1.0, 0.0, 1.0], [1.0, 1.0, 1.0]], [[1.0, 1.0, 2.0 + 1e-12]]]
)
def test_mollified_lengths_open_degenerate_triangles(lengths: list[list[float]]) -> None:
    better = intrinsic.mollified_lengths(np.array(lengths))
    # 1. Strict triangle inequality, by the margin asked for.
    slack = better.sum(axis=1) - 2 * better.max(axis=1)
    assert slack.min() >= 0.99e-6 * np.mean(lengths)
    # 2. Everything derived is finite.
    assert np.isfinite(intrinsic.cotangents(better)).all()
    # 3. Little has changed.
    assert np.abs(better - lengths).max() <= 2e-6


def test_a_point_is_no_mesh() -> None:
    with pytest.raises(MeshError, match="length zero"):
        intrinsic.mollified_lengths(np.zeros((2, 3)))

"""Polished fields against the truth: measured on faces, weighted by area and coherence."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.meshes import grid
from vhquad.field.cross import CrossField
from vhquad.geometry.frames import from_3d, vertex_axes
from vhquad.learn.polished import compare_polished, polished
from vhquad.mesh.triangle import TriMesh

FLAT = grid(12, 9)


def turned(mesh: TriMesh, degrees: float) -> CrossField:
    """Crosses on the vertices of a flat grid, turned against its sides; unknown on the border.

    There angles are stretched, and a direction in the plane is none in the frame.
    """
    way = np.radians(degrees)
    arm = np.tile([np.cos(way), np.sin(way), 0.0], (mesh.n_vertices, 1))
    z = np.where(mesh.is_boundary_vertex, 0.0, from_3d(arm, vertex_axes(mesh)) ** 4)
    return CrossField("vertices", z)


@pytest.mark.parametrize("degrees", [0.0, 7.0, 30.0, 45.0])
def test_a_known_turn(degrees: float) -> None:
    """1. A field along the sides of a rectangle stays so; it is off what is turned by the angle."""
    aligned = polished(FLAT, turned(FLAT, 0.0), 0.1)
    assert aligned is not None
    errors = compare_polished(aligned, FLAT, turned(FLAT, degrees))
    assert errors is not None
    assert errors.direction == pytest.approx(1 - np.cos(np.radians(4 * degrees)), abs=1e-9)
    assert errors.weight.sum() == pytest.approx(1.0)
    assert errors.ratio is None


def test_weights() -> None:
    """2. Faces count by area and the coherence of their corners; unknown ones do not."""
    aligned = polished(FLAT, turned(FLAT, 0.0), 0.1)
    assert aligned is not None
    truth = turned(FLAT, 0.0)
    left = FLAT.vertices[:, 0] < 0.4
    truth = CrossField("vertices", np.where(left, 0.0, truth.z), None, np.full(len(truth), 0.5))
    errors = compare_polished(aligned, FLAT, truth)
    assert errors is not None
    middle = aligned.mesh.vertices[aligned.mesh.faces][:, :, 0]
    assert (errors.weight[middle.min(axis=1) < 0.4] == 0).all()
    counted = errors.weight > 0
    share = errors.weight[counted] / aligned.mesh.face_areas[counted]
    np.testing.assert_allclose(share, share[0])
    assert compare_polished(aligned, FLAT, replace(truth, z=np.zeros_like(truth.z))) is None

"""The field along principal curvatures, where these are known."""

from __future__ import annotations

import numpy as np
import pytest

from tests.field_checks import check_aligned
from tests.meshes import EVERY, Case, grid, icosphere, open_cylinder, torus
from vhquad.field.align import align_field
from vhquad.field.baseline import curvature_field
from vhquad.geometry.frames import face_axes, from_3d
from vhquad.mesh.triangle import TriMesh


def degrees_off(mesh: TriMesh, vectors: np.ndarray, z: np.ndarray) -> np.ndarray:
    truth = from_3d(vectors, face_axes(mesh)) ** 4
    return np.degrees(np.abs(np.angle(z * truth.conj()))) / 4.0


def about_z(mesh: TriMesh) -> np.ndarray:
    return np.cross([0.0, 0.0, 1.0], mesh.vertices[mesh.faces].mean(axis=1))


def test_it_follows_the_circles_of_a_torus_and_a_cylinder() -> None:
    ring = torus(48, 24)
    assert degrees_off(ring, about_z(ring), curvature_field(ring).z).max() < 3.0
    tube = open_cylinder(48, 24)
    assert degrees_off(tube, about_z(tube), curvature_field(tube).z).mean() < 1.0


def test_confidence_is_high_where_the_surface_bends_one_way() -> None:
    tube, ball, flat = open_cylinder(48, 24), icosphere(3), grid()
    assert curvature_field(tube).confidence.mean() > 0.4
    # A sphere and a plane have no direction: what little there is comes from the mesh.
    assert curvature_field(flat).confidence.max() < 1e-3
    assert curvature_field(ball).confidence.mean() < 0.3


@pytest.mark.parametrize("case", EVERY, ids=str)
def test_it_serves_every_mesh(case: Case) -> None:
    field = curvature_field(case.mesh)
    np.testing.assert_allclose(np.abs(field.z), 1.0)
    check_aligned(case.mesh, align_field(case.mesh, field))

"""Mirror planes are found where there are some, judged by how well they hold, and exact."""

from __future__ import annotations

import numpy as np
import pytest

from tests.meshes import (
    blob,
    cube,
    grid,
    half_sphere,
    icosphere,
    merge,
    moved,
    open_cylinder,
    pretzel,
    random_rigid,
    torus,
)
from vhquad.errors import MeshError
from vhquad.mesh.plane import MirrorPlane
from vhquad.mesh.symmetry import LARGEST_MEDIAN, LARGEST_TAIL, find_symmetry
from vhquad.mesh.triangle import TriMesh

# ---- planes ---------------------------------------------------------------------------------


def test_reflection_is_its_own_inverse(rng: np.random.Generator) -> None:
    p = rng.normal(size=(50, 3))
    for plane in (MirrorPlane(rng.normal(size=3), 0.3), MirrorPlane([0, 1, 0], -0.2)):
        np.testing.assert_allclose(plane.reflect(plane.reflect(p)), p, atol=1e-15)
        np.testing.assert_allclose(plane.height(plane.reflect(p)), -plane.height(p), atol=1e-15)
        assert np.abs(plane.height(plane.project(p))).max() < 1e-15
        middle = 0.5 * (p + plane.reflect(p))
        np.testing.assert_allclose(plane.project(p), middle, atol=1e-15)
        difference = plane.reflect(p[1:]) - plane.reflect(p[:-1])
        np.testing.assert_allclose(plane.reflect_vectors(p[1:] - p[:-1]), difference, atol=1e-14)


def test_reflection_across_an_axis_changes_a_sign_only(rng: np.random.Generator) -> None:
    p = rng.normal(size=(50, 3))
    for axis in range(3):
        plane = MirrorPlane(np.eye(3)[axis], 0.0)
        assert plane.axis == axis
        image = plane.reflect(p)
        np.testing.assert_array_equal(image[:, axis], -p[:, axis])
        np.testing.assert_array_equal(np.delete(image, axis, 1), np.delete(p, axis, 1))
        np.testing.assert_array_equal(plane.reflect(image), p)


def test_names_and_refusals() -> None:
    assert MirrorPlane([1, 0, 0], 0.0).name == "x = 0"
    assert MirrorPlane([0, 0, 2.0], 1.5).name == "z = 1.5"
    assert MirrorPlane([1, 1, 0], 0.5).axis is None
    for normal in ([0, 0, 0], [1, np.nan, 0], [1, 0]):
        with pytest.raises(MeshError):
            MirrorPlane(normal, 0.0)


# ---- search ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("mesh", "name"),
    [
        (icosphere(2), "x = 0"),
        (torus(), "x = 0"),
        (cube(), "x = 0"),
        (open_cylinder(), "x = 0"),
        (half_sphere(2), "x = 0"),
        (moved(icosphere(2), (3.0, 0.0, 0.0)), "x = 3"),
        (grid(9, 9, hole=True), "x = 0.5"),
    ],
    ids=["sphere", "torus", "cube", "cylinder", "half sphere", "moved sphere", "grid"],
)
def test_exact_shapes(mesh: TriMesh, name: str) -> None:
    """Coordinate planes come before others that are as good; the agreement is to rounding."""
    found = find_symmetry(mesh)
    assert found.holds
    assert found.plane.name == name
    assert found.tail < 1e-6


def test_a_plane_at_any_angle_is_found(rng: np.random.Generator) -> None:
    """An ellipsoid with bumps, mirror-symmetric across x, turned and shifted: normal to 1e-4."""
    sphere = icosphere(3)
    x = sphere.vertices
    bump = 1 + 0.12 * np.sin(3 * x[:, 1] + 1) * np.cos(4 * x[:, 0]) + 0.1 * np.sin(5 * x[:, 2])
    mesh = TriMesh(x * bump[:, None] * [1.0, 1.5, 0.8], sphere.faces)
    for _ in range(3):
        rigid = random_rigid(rng)
        found = find_symmetry(rigid.mesh(mesh))
        assert found.holds
        assert abs(found.plane.normal @ rigid.rotation[:, 0]) > 1 - 1e-4
        assert abs(found.plane.height(rigid.points(np.zeros((1, 3))))[0]) < 1e-3


def test_no_principal_axis_is_needed(rng: np.random.Generator) -> None:
    """A turned cube and a three-legged pretzel: their inertia says nothing or little."""
    for mesh in (cube(6), pretzel(3)):
        assert find_symmetry(random_rigid(rng).mesh(mesh)).holds


def test_across_an_axis() -> None:
    mesh = open_cylinder()
    for axis, offset in ((0, 0.0), (1, 0.0), (2, 1.0)):
        found = find_symmetry(mesh, axis)
        assert found.plane.axis == axis
        assert found.plane.offset == pytest.approx(offset, abs=1e-6)
        assert found.holds
    with pytest.raises(MeshError, match="axis"):
        find_symmetry(mesh, 3)


def test_what_is_not_symmetric() -> None:
    """No plane for random bumps or a bowl from above; a handle on one side does not pass."""
    assert not find_symmetry(blob(strength=0.6)).holds
    assert not find_symmetry(half_sphere(3), 2).holds
    handle = merge(icosphere(3), moved(torus(), (1.0, 0.0, 0.0), 0.35))
    found = find_symmetry(handle, 0)
    assert found.median < LARGEST_MEDIAN
    assert found.tail > LARGEST_TAIL
    assert find_symmetry(handle).plane.axis == 1

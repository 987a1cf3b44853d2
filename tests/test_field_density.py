"""Fields bent to a density: the polar field of an annulus, nothing where the density is even."""

from __future__ import annotations

import numpy as np
import pytest

from tests.meshes import disk, icosphere, open_cylinder
from vhquad.errors import ConfigError, FieldError
from vhquad.field.baseline import curvature_field
from vhquad.field.cross import CrossField
from vhquad.field.density import bend_to_density
from vhquad.geometry.frames import face_axes, from_3d
from vhquad.mesh.triangle import TriMesh
from vhquad.quad.pipeline import RemeshSettings, remesh_mesh
from vhquad.quad.sizing import checked_density, wanted_sizes


def annulus(rings: int = 24) -> TriMesh:
    """A flat disk without its middle third."""
    mesh = disk(rings)
    radius = np.linalg.norm(mesh.vertices[mesh.faces].mean(axis=1), axis=1)
    return mesh.submesh(radius > 1 / 3)[0]


def radial(mesh: TriMesh) -> np.ndarray:
    """Crosses with an arm away from the middle."""
    return from_3d(mesh.vertices[mesh.faces].mean(axis=1), face_axes(mesh)) ** 4


def off(field: CrossField, z: np.ndarray) -> np.ndarray:
    """Angle between two fields, less its mean; radians."""
    relative = field.z * z.conj()
    return np.asarray(np.angle(relative / relative.mean()) / 4)


def test_density_of_a_polar_grid(rng: np.random.Generator) -> None:
    """With density 1 / r^2 the annulus is a cylinder: noise on the polar field goes, it stays.

    With even density the same noise is hardly smoothed.
    """
    mesh = annulus()
    noise = np.exp(4j * rng.uniform(-0.4, 0.4, mesh.n_faces))
    field = CrossField("faces", radial(mesh) * noise)
    density = 1.0 / (mesh.vertices**2).sum(axis=1)
    bent = bend_to_density(mesh, field, density, 0.05)
    assert np.abs(off(bent, radial(mesh))).mean() < 0.02
    flat = bend_to_density(mesh, field, np.ones(mesh.n_vertices), 0.05)
    assert np.abs(off(flat, radial(mesh))).mean() > 0.05


def test_even_density_changes_little() -> None:
    """No more than details below half an edge length; sizes and confidences stay."""
    mesh = open_cylinder(32, 16)
    along = np.tile([0.0, 0.0, 1.0], (mesh.n_faces, 1))
    z = from_3d(along, face_axes(mesh)) ** 4
    trust = np.linspace(0, 1, mesh.n_faces)
    field = CrossField("faces", z, np.arange(1.0, mesh.n_faces + 1), trust)
    bent = bend_to_density(mesh, field, np.full(mesh.n_vertices, 7.0), 0.1)
    assert np.abs(np.angle(bent.z * field.z.conj())).max() < 1e-6
    np.testing.assert_array_equal(bent.size, field.size)
    np.testing.assert_array_equal(bent.confidence, trust)


def test_scale_of_the_density_does_not_matter() -> None:
    mesh = icosphere(3)
    field = curvature_field(mesh)
    density = 4.0 ** mesh.vertices[:, 2]
    a = bend_to_density(mesh, field, density, 0.1)
    b = bend_to_density(mesh, field, 100.0 * density, 0.1)
    assert np.abs(a.z - b.z).max() < 1e-6


def test_nothing_known_stays_unknown() -> None:
    mesh = icosphere(1)
    field = CrossField("faces", np.zeros(mesh.n_faces))
    assert (bend_to_density(mesh, field, np.ones(mesh.n_vertices), 0.1).z == 0).all()
    with pytest.raises(FieldError, match="80 faces"):
        bend_to_density(mesh, CrossField("faces", np.ones(3)), np.ones(42), 0.1)


def test_quads_follow_the_density() -> None:
    """16 times as dense at one pole as at the other: 5.7 between the caps beyond 1/4 of the axis.

    Which cross field a sphere gets is down to rounding, and with it how well it suits one axis (on
    24 of them 5.3 to 6.6): so the mean over several. Without bending it was 3.4.
    """
    mesh = icosphere(4)
    field = curvature_field(mesh)
    settings = RemeshSettings(target_quads=800)
    axes = np.random.default_rng(0).standard_normal((5, 3))
    axes /= np.linalg.norm(axes, axis=1)[:, None]
    log_ratio = []
    for axis in axes:
        density = 16.0 ** (0.5 + 0.5 * mesh.vertices @ axis)
        quads = remesh_mesh(mesh, field, settings, density=density).quads
        p = quads.vertices[quads.quads]
        area = 0.5 * np.linalg.norm(np.cross(p[:, 2] - p[:, 0], p[:, 3] - p[:, 1]), axis=1)
        height = p.mean(axis=1) @ axis
        dense, coarse = (
            (side > 0.25).sum() / area[side > 0.25].sum() for side in (height, -height)
        )
        log_ratio.append(np.log(dense / coarse))
    assert 4.7 < np.exp(np.mean(log_ratio)) < 7.0


# ---- sizes ----------------------------------------------------------------------------------


def _sizes(mesh: TriMesh, field: CrossField, **wish: object) -> tuple[np.ndarray, int]:
    """Edge lengths and count; the sizes up to a factor are the same for any count."""
    wanted = wanted_sizes(mesh, field, **wish)
    other = wanted_sizes(mesh, field, density=wish["density"], target_quads=777)
    np.testing.assert_array_equal(wanted.relative, other.relative)
    return wanted.lengths, wanted.quads


def test_sizes_of_a_density() -> None:
    """Edges go as the root; a count asked for is met; without one the count is multiplied."""
    mesh = icosphere(3)
    field = CrossField("faces", np.ones(mesh.n_faces), np.full(mesh.n_faces, 0.1))
    four = np.full(mesh.n_vertices, 4.0)
    size, count = _sizes(mesh, field, density=four)
    np.testing.assert_allclose(size, 0.05)
    assert count == round(4 * mesh.area / 0.1**2)
    half = np.where(mesh.vertices[:, 2] > 0, 9.0, 1.0)
    size, count = _sizes(mesh, field, density=half, target_quads=1000)
    assert count == 1000
    assert (mesh.face_areas / size**2).sum() == pytest.approx(1000)
    assert size.max() / size.min() == pytest.approx(3.0)
    size, count = _sizes(mesh, field, density=half, edge_length=0.2)
    assert count == round(mesh.area / 0.2**2)


def test_absurd_sizes_are_not_believed() -> None:
    """Those of a barely trained model; a count that is asked for stands."""
    mesh = icosphere(2)
    field = CrossField("faces", np.ones(mesh.n_faces), np.full(mesh.n_faces, 1e-7))
    assert wanted_sizes(mesh, field).quads == 4000
    assert wanted_sizes(mesh, field, target_quads=9000).quads == 9000


@pytest.mark.parametrize("bad", [0.0, -1.0, np.nan, np.inf])
def test_unusable_densities(bad: float) -> None:

    values = np.ones(5)
    values[3] = bad
    with pytest.raises(ConfigError, match=r"positive and finite: 1 values.*at vertex 3"):
        checked_density(values, 5)
    with pytest.raises(ConfigError, match="each of 6 vertices"):
        checked_density(np.ones(5), 6)

"""Local features: closed forms, and how little they mind a crop."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from tests import meshes
from tests.data_paths import ROOT
from vhquad import api
from vhquad.geometry.delaunay import intrinsic_delaunay
from vhquad.geometry.features import ShapeContext, compute_features
from vhquad.geometry.frames import build_frames, from_3d, to_3d, vertex_axes
from vhquad.geometry.local import LocalCurvature, local_curvature, local_vectors
from vhquad.learn.targets import isotropic_remesh
from vhquad.mesh.triangle import TriMesh

Complexes = NDArray[np.complex128]


def curvature_of(mesh: TriMesh, *radii: float) -> LocalCurvature:
    frames = build_frames(mesh)
    return local_curvature(mesh, frames, intrinsic_delaunay(mesh, frames), np.array(radii))


def features_of(name: str, mesh: TriMesh) -> Complexes:
    frames = build_frames(mesh)
    shape = ShapeContext(mesh, frames, intrinsic_delaunay(mesh, frames), 128)
    return compute_features(name, shape, turned=False).vectors


def in_space(mesh: TriMesh, vectors: Complexes) -> NDArray[np.float64]:
    return np.asarray(to_3d(vectors, vertex_axes(mesh)))


def test_a_sphere_is_the_same_everywhere() -> None:
    """1. Its curvatures in units of the radii, no gradients, no lines."""
    radii = np.array([0.2, 0.6])
    found = curvature_of(meshes.icosphere(4, 2.0), *radii)
    np.testing.assert_allclose(
        found.gaussian, np.tile(radii**2 / 4.0, (len(found.mean), 1)), rtol=0.02
    )
    np.testing.assert_allclose(found.mean, np.tile(radii / 2.0, (len(found.mean), 1)), rtol=0.02)
    assert np.abs(found.mean_slope).max() < 2e-3
    assert np.abs(found.gaussian_slope).max() < 2e-3
    assert np.abs(found.line).max() < 5e-3


def test_lines_of_a_cylinder() -> None:
    """2. (k1 - k2) / 2 = 1 / 2r around it, whatever the neighbourhood."""
    mesh = meshes.open_cylinder(96, 60, 0.5, 4.0)
    found = curvature_of(mesh, 0.1, 0.3)
    p = mesh.vertices
    inside = np.abs(p[:, 2] - p[:, 2].mean()) < 1.0  # away from the open ends
    around = from_3d(np.stack([-p[:, 1], p[:, 0], 0 * p[:, 0]], axis=1), vertex_axes(mesh))
    expected = (around / np.abs(around)) ** 2
    np.testing.assert_allclose(found.line[inside, 0] / 0.1, expected[inside], atol=0.02)
    np.testing.assert_allclose(found.line[inside, 1] / 0.3, expected[inside], atol=0.02)


def test_slopes_of_a_torus() -> None:
    """3. K = cos v / (a (R + a cos v)), H = (1 / a + cos v / (R + a cos v)) / 2, by arc length."""
    major, minor, radius = 1.0, 0.4, 0.06
    mesh = meshes.torus(160, 80, major, minor)
    found = curvature_of(mesh, radius)
    p = mesh.vertices
    ring = np.linalg.norm(p[:, :2], axis=1)
    v = np.arctan2(p[:, 2], ring - major)
    along = np.stack([-np.sin(v) * p[:, 0] / ring, -np.sin(v) * p[:, 1] / ring, np.cos(v)], axis=1)
    # d/dv of cos v / (R + a cos v) is -R sin v / (R + a cos v)^2; an arc is a dv long.
    slope = (-major * np.sin(v) / ring**2 / minor)[:, None] * along
    steepest = np.linalg.norm(slope, axis=1).max()
    gaussian = in_space(mesh, found.gaussian_slope[:, 0]) / radius**3
    mean = in_space(mesh, found.mean_slope[:, 0]) / radius**2
    np.testing.assert_allclose(gaussian * minor, slope, atol=0.1 * steepest)
    np.testing.assert_allclose(mean * 2.0, slope, atol=0.1 * steepest)
    # Smoothing flattens: never steeper than the truth by more than the mesh's error.
    assert np.linalg.norm(mean * 2.0, axis=1).max() < 1.02 * steepest


def test_reflection_at_the_lines() -> None:
    """4. The second third holds the gradients reflected, the last one the gradients lengthened."""
    found = curvature_of(meshes.blob(3), *np.full(6, 0.2))
    x = local_vectors(found)
    assert x.shape[1] == 36
    np.testing.assert_allclose((x[:, 24:] * x[:, :12].conj()).imag, 0.0, atol=1e-12)
    turned = x[:, 6:12] * x[:, 18:24]  # v times q conj(v) has the direction of q
    cosine = (turned * found.line.conj()).real / np.abs(turned * found.line)
    np.testing.assert_allclose(cosine, 1.0, atol=1e-9)


@pytest.fixture(scope="module")
def head() -> TriMesh:
    """The head in examples/ with fewer triangles."""
    mesh = api.load(ROOT / "examples" / "head.obj").mesh
    return isotropic_remesh(np.array(mesh.vertices), np.array(mesh.faces), 3000)


def crop_change(name: str, mesh: TriMesh) -> float:
    """How much a crop changes features where the cut is far; 1: as much as they are long.

    The cut takes the lowest 30 % of the vertices; what is compared lies in the upper half.
    """
    height = mesh.vertices[:, 2]
    level = np.quantile(height, 0.3)
    part, used = mesh.submesh((height[mesh.faces] > level).all(axis=1))
    far = height[used] > np.quantile(height, 0.5)
    before = in_space(mesh, features_of(name, mesh))[used][far]
    after = in_space(part, features_of(name, part))[far]
    change = np.linalg.norm(after - before, axis=-1).mean(axis=0)
    return float(np.mean(change / np.linalg.norm(before, axis=-1).mean(axis=0)))


def test_a_crop_far_away_matters_little(head: TriMesh) -> None:
    """5. The heat kernel signature turns into something else, local features hardly change."""
    local, global_ = crop_change("local", head), crop_change("hks", head)
    assert local < 0.4, (local, global_)
    assert global_ > 2.0 * local, (local, global_)

"""Curvatures of spheres, tori, cylinders and sheets; their directions; what must not matter."""

from __future__ import annotations

import numpy as np
import pytest

from tests import meshes
from vhquad.geometry.curvature import (
    CurvatureCross,
    angle_defect,
    curvature_cross,
    vertex_curvature,
)
from vhquad.geometry.frames import build_frames, face_axes, from_3d, vertex_axes
from vhquad.mesh.triangle import TriMesh


def torus_truth(points: np.ndarray, major: float, minor: float) -> tuple[np.ndarray, np.ndarray]:
    """Curvature the long way round at points of a torus, and the direction about the tube."""
    x, y, z = points.T
    rho = np.hypot(x, y)
    normal = np.stack([(rho - major) * x / rho, (rho - major) * y / rho, z], axis=1)
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    long_way = np.stack([-y / rho, x / rho, 0 * z], axis=1)
    return (rho - major) / (minor * rho), np.cross(long_way, normal)


def test_dihedral_angles_of_a_cube() -> None:
    cube = meshes.cube(2)
    angle = cube.dihedral_angles
    # 1. Right angles at the 24 pieces of edge, seen from both sides; convex is positive.
    assert (np.abs(angle - np.pi / 2) < 1e-12).sum() == 48
    # 2. Flat elsewhere.
    assert (np.abs(angle) < 1e-12).sum() == angle.size - 48
    # 3. Inside out it is concave.
    inverse = TriMesh(cube.vertices, cube.faces[:, ::-1])
    assert inverse.dihedral_angles.min() == pytest.approx(-np.pi / 2)


@pytest.mark.parametrize("case", meshes.CLOSED, ids=str)
def test_gauss_bonnet(case: meshes.Case) -> None:
    total = angle_defect(case.mesh, build_frames(case.mesh)).sum()
    assert total == pytest.approx(2 * np.pi * case.euler, abs=1e-9)


def test_sphere() -> None:
    c = vertex_curvature(meshes.icosphere(4, radius=2.0))
    # 1. H = 1 / r, K = 1 / r^2, everywhere to a few percent (5-valent vertices are worst).
    np.testing.assert_allclose(c.mean, 0.5, rtol=0.05)
    np.testing.assert_allclose(c.gaussian, 0.25, rtol=0.05)
    # 2. No direction to speak of.
    assert np.abs(c.line).max() < 0.02
    np.testing.assert_allclose(c.k1, c.k2, atol=0.04)


def test_torus_converges() -> None:
    errors = []
    for n in (24, 48):
        mesh = meshes.torus(2 * n, n)
        k_long, around = torus_truth(mesh.vertices, 1.0, 0.4)
        c = vertex_curvature(mesh, radius=0.0)
        errors.append(
            [
                np.abs(c.k1 - 2.5).max() / 2.5,
                np.abs(c.k2 - k_long).max() / 2.5,
                np.abs(c.gaussian - 2.5 * k_long).max() / 6.25,
                np.abs(np.angle(c.line / from_3d(around, vertex_axes(mesh)) ** 2)).max() / 2,
            ]
        )
    coarse, fine = np.array(errors)
    # 1. Small already (measured 0.0102), 2. second order: the mesh is regular.
    assert coarse.max() < 0.011
    assert (fine < 0.27 * coarse).all()


def test_the_neighbourhood_holds_noise_down(rng: np.random.Generator) -> None:
    clean = meshes.torus(96, 48)
    noise = 0.05 * clean.edge_lengths.mean() * rng.normal(size=clean.vertices.shape)
    mesh = TriMesh(clean.vertices + noise, clean.faces)
    k_long, around = torus_truth(clean.vertices, 1.0, 0.4)
    frames = build_frames(mesh)
    line = from_3d(around, vertex_axes(mesh, frames)) ** 2

    def errors(radius: float) -> tuple[float, float]:
        c = vertex_curvature(mesh, frames, radius=radius)
        angle = np.degrees(np.abs(np.angle(c.line / line)) / 2)
        return np.abs(c.mean - (2.5 + k_long) / 2).mean() / 2.5, angle.mean()

    # Measured: raw 0.85 and 25 degrees, default radius 0.07 and 2.6 degrees.
    raw, smooth = errors(0.0), errors(0.02)
    assert smooth[0] < 0.1 < 0.5 < raw[0]
    assert smooth[1] < 4.0 < 15.0 < raw[1]


def test_cylinder_and_sheet_with_borders() -> None:
    tube = vertex_curvature(meshes.open_cylinder(48, 24, radius=0.5))
    # 1. k1 = 1 / r up to the polygon's corner (1 - cos), k2 = 0, K = 0 up to the very border.
    np.testing.assert_allclose(tube.k1, 2.0, rtol=2e-3)
    np.testing.assert_allclose(tube.k2, 0.0, atol=1e-10)
    np.testing.assert_allclose(tube.gaussian, 0.0, atol=1e-10)
    # 2. Flat: nothing, and no direction is invented.
    flat = vertex_curvature(meshes.sheet())
    for value in (flat.gaussian, flat.k1, flat.k2):
        np.testing.assert_allclose(value, 0.0, atol=1e-9)
    cross = curvature_cross(meshes.sheet())
    for value in (cross.vertex_z, cross.face_z, cross.vertex_weight, cross.face_weight):
        np.testing.assert_array_equal(value, 0.0)


def test_a_cap_of_a_sphere_keeps_its_curvature_at_the_border() -> None:
    c = vertex_curvature(meshes.half_sphere(4))
    np.testing.assert_allclose(c.gaussian, 1.0, rtol=0.05)


def test_cross_lies_along_the_principal_directions() -> None:
    mesh = meshes.torus(48, 24)
    cross = curvature_cross(mesh)
    # 1. At vertices.
    around = torus_truth(mesh.vertices, 1.0, 0.4)[1]
    expected = from_3d(around, vertex_axes(mesh)) ** 4
    np.testing.assert_allclose(cross.vertex_z, expected, atol=0.01)
    # 2. At faces.
    around = torus_truth(mesh.vertices[mesh.faces].mean(axis=1), 1.0, 0.4)[1]
    expected = from_3d(around, face_axes(mesh)) ** 4
    expected /= np.abs(expected)
    np.testing.assert_allclose(cross.face_z, expected, atol=0.03)
    # 3. Weights are shares: higher inside the ring, where the curvatures differ most.
    inner = np.hypot(*mesh.vertices[:, :2].T) < 0.7
    assert 0 < cross.vertex_weight[~inner].mean() < cross.vertex_weight[inner].mean() < 1


def test_cross_moves_with_the_shape(rng: np.random.Generator) -> None:
    mesh = meshes.blob()
    cross = curvature_cross(mesh)

    def same(other: CurvatureCross, vertex: object = ..., face: object = ...) -> None:
        np.testing.assert_allclose(other.vertex_weight[vertex], cross.vertex_weight, atol=1e-9)
        np.testing.assert_allclose(other.face_weight[face], cross.face_weight, atol=1e-9)

    # 1. Rigid motion and scale: not even the numbers in the frames change.
    rigid = meshes.random_rigid(rng)
    other = curvature_cross(meshes.moved(rigid.mesh(mesh), (1.0, 2.0, 3.0), 7.0))
    same(other)
    np.testing.assert_allclose(other.vertex_z, cross.vertex_z, atol=1e-9)
    # 2. Other labels: the same in the frames that go with them.
    relabelled = meshes.relabel(mesh, rng)
    other = curvature_cross(relabelled.mesh)
    same(other, relabelled.vertex, relabelled.face)
    turn = face_axes(relabelled.mesh).e1[relabelled.face]
    between = from_3d(turn, face_axes(mesh)) ** 4  # the new axis in the old frame
    np.testing.assert_allclose(other.face_z[relabelled.face] * between, cross.face_z, atol=1e-9)

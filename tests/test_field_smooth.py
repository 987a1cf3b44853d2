"""Energies and solvers of face fields against closed forms and against each other."""

from __future__ import annotations

import numpy as np
import pytest

from tests.meshes import EVERY, Case, blob, disk, grid, icosphere, torus, two_spheres
from vhquad.field.dual import carry4, dirichlet, dual_weights
from vhquad.field.smooth import polish, relaxed, smoothest, unit
from vhquad.geometry.frames import face_axes, from_3d
from vhquad.mesh.triangle import TriMesh


def energy(mesh: TriMesh, z: np.ndarray) -> float:
    matrix = dirichlet(mesh, dual_weights(mesh), carry4(mesh))
    return float((z.conj() @ (matrix @ z)).real)


def along_x(mesh: TriMesh) -> np.ndarray:
    return unit(from_3d(np.tile([1.0, 0, 0], (mesh.n_faces, 1)), face_axes(mesh)) ** 4)


@pytest.mark.parametrize("case", EVERY, ids=str)
def test_the_energy_is_hermitian_and_not_negative(case: Case) -> None:
    mesh = case.mesh
    matrix = dirichlet(mesh, dual_weights(mesh), carry4(mesh))
    assert abs(matrix - matrix.conj().T).max() < 1e-12
    assert np.linalg.eigvalsh(matrix.toarray()).min() > -1e-9 if mesh.n_faces < 400 else True
    h = np.flatnonzero(mesh.twin >= 0)
    np.testing.assert_allclose(dual_weights(mesh)[h], dual_weights(mesh)[mesh.twin[h]])


def test_energy_of_known_fields_in_the_plane() -> None:
    # 1. a parallel field has none
    assert energy(grid(), along_x(grid())) < 1e-20
    # 2. angle turning at a constant rate a over a unit square of near-regular triangles: each
    #    direction's fourth power turns at 4a, so the energy tends to 16 a^2
    errors = []
    for n in (10, 20, 40):
        mesh = grid(n, n, 1.0, 1.0)
        x = mesh.vertices[mesh.faces].mean(axis=1)[:, 1]
        value = energy(mesh, along_x(mesh) * np.exp(4j * 0.3 * x))
        errors.append(abs(value / (16 * 0.3**2) - 1.0))
    # The weights are exact on equilateral triangles; on right ones within a third.
    assert errors[-1] < 0.35
    assert max(errors) - min(errors) < 0.2


def test_smoothest_is_smoother_than_anything_tried() -> None:
    for mesh in (icosphere(2), torus(), two_spheres()):
        area = mesh.face_areas
        z = smoothest(mesh)
        rng = np.random.default_rng(0)
        others = [np.exp(2j * np.pi * rng.random(mesh.n_faces)) for _ in range(5)]
        assert all(energy(mesh, z) < 0.5 * energy(mesh, other) for other in others)
        assert (area > 0).all()


def test_smoothest_is_the_lowest_eigenvector() -> None:
    # A surface without symmetry, so that the lowest eigenvalue is simple.
    mesh = blob(2, seed=6, strength=0.8)
    matrix = dirichlet(mesh, dual_weights(mesh), carry4(mesh)).toarray()
    root = np.sqrt(mesh.face_areas)
    values, vectors = np.linalg.eigh(matrix / root[:, None] / root)
    assert values[1] > 1.3 * values[0]
    truth = unit(vectors[:, 0] / root)
    z = smoothest(mesh)
    turn = unit(np.array([np.vdot(truth, z)]))
    assert np.abs(z - turn * truth).max() < 0.2
    assert np.abs(z - turn * truth).mean() < 0.02


def test_polish_keeps_fixed_faces_and_fills_the_rest() -> None:
    mesh = disk(8)
    truth = along_x(mesh)
    fixed = mesh.is_boundary_vertex[mesh.faces].any(axis=1)
    z = polish(mesh, np.where(fixed, truth, 0.0), np.zeros(mesh.n_faces), fixed)
    np.testing.assert_allclose(z, truth, atol=1e-9)


def test_weight_goes_from_given_to_smooth() -> None:
    mesh = torus(24, 12)
    about = np.cross([0.0, 0.0, 1.0], mesh.vertices[mesh.faces].mean(axis=1))
    truth = unit(from_3d(about, face_axes(mesh)) ** 4)
    rng = np.random.default_rng(0)
    noisy = truth * np.exp(0.8j * rng.normal(size=len(truth)))
    off = [
        np.abs(np.angle(polish(mesh, noisy, mesh.face_areas / length**2) * truth.conj())).mean()
        for length in (1e-6, 0.2, 0.3)
    ]
    assert off[0] == pytest.approx(np.abs(np.angle(noisy * truth.conj())).mean(), rel=1e-6)
    assert off[2] < off[1] < 0.4 * off[0]


def test_modulus_tells_how_much_the_target_has_to_say() -> None:
    mesh = grid(20, 20, 1.0, 1.0)
    x = mesh.vertices[mesh.faces].mean(axis=1)[:, 0]
    truth = along_x(mesh)
    agreed = relaxed(mesh, truth, mesh.face_areas / 0.1**2)
    torn = relaxed(mesh, np.where(x < 0.5, truth, -truth), mesh.face_areas / 0.1**2)
    np.testing.assert_allclose(agreed, truth, atol=1e-9)
    assert np.abs(torn)[np.abs(x - 0.5) < 0.03].max() < 0.4
    assert np.abs(torn)[np.abs(x - 0.5) > 0.4].min() > 0.9


def test_components_without_a_word_get_their_smoothest_field() -> None:
    mesh = two_spheres()
    said = mesh.face_component == 0
    target = np.where(said, smoothest(mesh), 0.0)
    z = polish(mesh, target, np.where(said, mesh.face_areas, 0.0))
    np.testing.assert_allclose(np.abs(z), 1.0)

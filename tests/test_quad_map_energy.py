"""The distortion of a map: least at the wanted one, its derivatives, and how far a step may go."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.sparse import csr_matrix, eye_array

from tests.meshes import blob, grid
from vhquad.mesh.triangle import TriMesh
from vhquad.quad.map_energy import MapEnergy, determinants, largest_step, solve_positive


def flat_energy(mesh: TriMesh) -> MapEnergy:
    """Maps of a flat mesh by its vertices; wanted: the identity."""
    direction = mesh.vertices[mesh.faces[:, 1]] - mesh.vertices[mesh.faces[:, 0]]
    angle = -np.arctan2(direction[:, 1], direction[:, 0])  # of the x axis in the face's frame
    n = 2 * mesh.n_vertices
    return MapEnergy(mesh, mesh.faces, eye_array(n, format="csr"), np.exp(1j * angle))


def test_the_identity_is_ideal() -> None:
    mesh = grid()
    energy = flat_energy(mesh)
    x = mesh.vertices[:, :2].ravel()
    frames = energy.frames(x)
    np.testing.assert_allclose(frames, np.tile([1.0, 0, 0, 0], (mesh.n_faces, 1)), atol=1e-12)
    # |J|^2 + |J^-1|^2 = 4 there, and a mean over the area stays 4.
    assert energy.value(frames) == pytest.approx(4.0)
    slope, _ = energy.derivatives(frames)
    np.testing.assert_allclose(slope, 0, atol=1e-14)


@pytest.mark.parametrize(
    ("matrix", "value"),
    [
        ([[2, 0], [0, 2]], 8.5),  # 2 s^2 + 2 / s^2
        ([[3, 0], [0, 0.5]], 9 + 0.25 + 1 / 9 + 4),
        ([[0, -1], [1, 0]], 4.0),  # turned: as good
        ([[1, 0.5], [0, 1]], 2.25 + 2.25),  # sheared: |J|^2 = |J^-1|^2 = 2 + 1/4
        ([[1, 0], [0, -1]], np.inf),  # mirrored
    ],
)
def test_values_in_closed_form(matrix: list[list[float]], value: float) -> None:
    mesh = grid()
    energy = flat_energy(mesh)
    x = (mesh.vertices[:, :2] @ np.array(matrix).T).ravel()
    frames = energy.frames(x)
    np.testing.assert_allclose(determinants(frames), np.linalg.det(np.array(matrix)))
    assert energy.value(frames) == pytest.approx(value)


def test_derivatives_by_differences(rng: np.random.Generator) -> None:
    mesh = grid(2, 2)
    energy = flat_energy(mesh)
    x = mesh.vertices[:, :2].ravel()
    frames = energy.frames(x + 0.02 * rng.normal(size=x.shape))
    slope, hessian = energy.derivatives(frames)
    h = 1e-5
    for k in rng.choice(frames.size, 12, replace=False):
        e = np.zeros(frames.size)
        e[k] = h
        step = e.reshape(frames.shape)
        up, down = energy.value(frames + step), energy.value(frames - step)
        # central differences: error h^2 times a third derivative of some tens
        assert (up - down) / (2 * h) == pytest.approx(slope[k], abs=1e-7)
    dense = hessian.toarray()
    np.testing.assert_allclose(dense, dense.T, atol=1e-12)
    assert np.linalg.eigvalsh(dense).min() > 0
    # Near the ideal nothing is clamped but turns: second differences agree along other ways.
    ideal = energy.frames(x)
    _, hessian = energy.derivatives(ideal)
    way = rng.normal(size=ideal.shape)
    way[:, 1] = 0.0  # the turning part of A costs nothing
    second = (
        energy.value(ideal + h * way) - 2 * energy.value(ideal) + energy.value(ideal - h * way)
    ) / h**2
    assert way.ravel() @ (hessian @ way.ravel()) == pytest.approx(second, rel=1e-3)


@given(seed=st.integers(0, 1000))
def test_largest_step(seed: int) -> None:
    mesh = grid(3, 3)
    energy = flat_energy(mesh)
    rng = np.random.default_rng(seed)
    x = mesh.vertices[:, :2].ravel()
    frames = energy.frames(x)
    move = energy.frames(rng.normal(size=x.shape))
    t = largest_step(frames, move)
    assert t > 0
    # No triangle has lost its area before; one has at t.
    assert (determinants(frames + 0.999 * t * move) > 0).all()
    assert abs(determinants(frames + t * move).min()) < 1e-9


def test_steps_without_an_end() -> None:
    mesh = grid(3, 3)
    energy = flat_energy(mesh)
    frames = energy.frames(mesh.vertices[:, :2].ravel())
    assert largest_step(frames, frames) == np.inf  # growing
    assert largest_step(frames, -frames) == pytest.approx(1.0, abs=1e-6)  # to a point


def test_least_squares_with_some_held() -> None:
    # The rim held at a stretched place: the inside follows linearly.
    mesh = grid(6, 6)
    energy = flat_energy(mesh)
    wanted = mesh.vertices[:, :2] * [1.5, 0.5]
    rim = mesh.is_boundary_vertex
    x = np.where(rim[:, None], wanted, 7.0).ravel()
    free = np.flatnonzero(np.repeat(~rim, 2))
    out = energy.least_squares(np.ones(mesh.n_faces), x, free)
    np.testing.assert_allclose(out.reshape(-1, 2), wanted, atol=1e-10)
    # With nothing held but a vertex, the identity comes out, whatever the weights.
    free = np.arange(2, 2 * mesh.n_vertices)
    x = np.zeros(2 * mesh.n_vertices)
    out = energy.least_squares(np.linspace(1, 50, mesh.n_faces), x, free)
    np.testing.assert_allclose(out.reshape(-1, 2), mesh.vertices[:, :2], atol=1e-10)


def test_on_a_curved_surface_turns_do_not_matter(rng: np.random.Generator) -> None:
    mesh = blob(1)
    z = np.exp(1j * rng.uniform(0, 2 * np.pi, mesh.n_faces))
    wedge = np.arange(3 * mesh.n_faces).reshape(-1, 3)  # every face by itself
    basis = eye_array(6 * mesh.n_faces, format="csr")
    energy = MapEnergy(mesh, wedge, basis, 2.0 * z)
    x = energy.least_squares(
        np.ones(mesh.n_faces),
        np.zeros(6 * mesh.n_faces),
        np.setdiff1d(np.arange(6 * mesh.n_faces), wedge[:, :1] * 2 + [0, 1]),
    )
    # Faces are mapped congruently, twice as large.
    uv = x.reshape(-1, 3, 2)
    length = np.linalg.norm(np.roll(uv, -1, axis=1) - uv, axis=2)
    np.testing.assert_allclose(length, 2 * mesh.edge_lengths, rtol=1e-9)
    assert energy.value(energy.frames(x)) == pytest.approx(4.0)


def test_solve_positive(rng: np.random.Generator) -> None:
    a = rng.normal(size=(5, 5))
    a = a @ a.T + np.eye(5)
    b = rng.normal(size=5)
    np.testing.assert_allclose(solve_positive(csr_matrix(a), b), np.linalg.solve(a, b))

"""Eigenpairs against known spectra: spheres, flat tori, cylinders; and the fast way against ARPACK.

On the unit sphere an order-N field is a section of the line bundle of degree 2N, and its connection
Laplacian has the eigenvalues l (l + 1) - N^2 for l >= N, each 2 l + 1 times (Wu and Yang 1976,
"Dirac monopole without strings": monopole harmonics of charge N). N = 0 is the scalar Laplacian;
N = 1 gives l (l + 1) - 1: gradients and curls of the scalar harmonics, together one complex
dimension for each.
"""

from __future__ import annotations

import numpy as np
import pytest

from tests import meshes
from vhquad.geometry import spectral
from vhquad.geometry.delaunay import (
    IntrinsicTriangulation,
    intrinsic_delaunay,
    intrinsic_triangulation,
)
from vhquad.geometry.frames import build_frames
from vhquad.geometry.laplacian import connection_laplacian, cotan_laplacian, lumped_mass
from vhquad.geometry.spectral import Spectrum, smallest_eigenpairs
from vhquad.mesh.triangle import TriMesh


def delaunay(mesh: TriMesh) -> IntrinsicTriangulation:
    return intrinsic_delaunay(mesh, build_frames(mesh))


def check_pairs(laplacian: object, mass: np.ndarray, s: Spectrum, tolerance: float) -> None:
    """Ascending, M-orthonormal, and solutions."""
    p = s.eigenvectors
    # 1. Ascending, none below zero.
    assert (np.diff(s.eigenvalues) >= -1e-9 * s.eigenvalues[-1]).all()
    assert s.eigenvalues[0] >= 0
    # 2. Phi^H M Phi = I.
    gram = p.conj().T @ (mass[:, None] * p)
    np.testing.assert_allclose(gram, np.eye(len(gram)), atol=1e-11)
    # 3. Rayleigh quotients.
    energy = (p.conj() * (laplacian @ p)).sum(axis=0).real  # type: ignore[operator]
    np.testing.assert_allclose(energy, s.eigenvalues, atol=tolerance * s.eigenvalues[-1])


def span_error(reference: Spectrum, other: Spectrum, mass: np.ndarray) -> float:
    """Sine of the largest angle between two spans."""
    mixed = reference.eigenvectors.conj().T @ (mass[:, None] * other.eigenvectors)
    cosine = np.linalg.svd(mixed, compute_uv=False).min()
    return float(np.sqrt(max(0.0, 1.0 - cosine**2)))


def sphere_values(order: int, count: int) -> np.ndarray:
    values = [[l * (l + 1) - order**2] * (2 * l + 1) for l in range(order, order + count)]
    return np.concatenate(values).astype(np.float64)


@pytest.mark.parametrize("order", [0, 1, 2, 4])
def test_unit_sphere(order: int) -> None:
    exact = sphere_values(order, 4)
    errors = []
    for subdivisions in (2, 3, 4):
        tri = delaunay(meshes.icosphere(subdivisions))
        mass = lumped_mass(tri)
        laplacian = connection_laplacian(tri, order) if order else cotan_laplacian(tri)
        s = smallest_eigenpairs(laplacian, mass, len(exact), exact=True)
        check_pairs(laplacian, mass, s, 1e-10)
        errors.append(np.abs(s.eigenvalues - exact).max() / exact[-1])
    # 1. Values and multiplicities (a wrong multiplicity would leave an error of the next gap).
    assert errors[-1] < 0.004 * (1 + order)
    # 2. Second order, when the mesh can resolve the field.
    assert errors[2] < 0.3 * errors[1] < 0.12 * errors[0]


def test_flat_torus() -> None:
    # The metric of a 2 pi x 1.5 pi rectangle with its sides glued, given by lengths alone.
    nu, nv, a, b = 40, 30, 2 * np.pi, 1.5 * np.pi
    mesh = meshes.torus(nu, nv)
    place = np.stack([np.arange(mesh.n_vertices) // nv, np.arange(mesh.n_vertices) % nv], axis=1)
    step = place[np.roll(mesh.faces, -1, axis=1)] - place[mesh.faces]
    step = (step + 1) % [nu, nv] - 1  # across the seam too a step is -1, 0 or 1
    lengths = np.linalg.norm(step * [a / nu, b / nv], axis=2)
    frames = build_frames(mesh, lengths)
    # 1. Flat at every vertex.
    np.testing.assert_allclose(frames.angle_scale, 1.0, rtol=1e-12)
    tri = intrinsic_delaunay(mesh, frames)
    mass = lumped_mass(tri)
    assert mass.sum() == pytest.approx(a * b)
    p, q = np.meshgrid(np.arange(-6, 7), np.arange(-6, 7))
    exact = np.sort(((2 * np.pi * p / a) ** 2 + (2 * np.pi * q / b) ** 2).ravel())[:25]
    scalar = smallest_eigenpairs(cotan_laplacian(tri), mass, 25, exact=True)
    # 2. Known spectrum (second order: h^2 lambda / 12 is 0.6 % at most).
    np.testing.assert_allclose(scalar.eigenvalues, exact, rtol=0.02, atol=1e-9)
    # 3. There is no holonomy, so all orders have the same spectrum, parallel fields included.
    for order in (1, 4):
        s = smallest_eigenpairs(connection_laplacian(tri, order), mass, 25, exact=True)
        np.testing.assert_allclose(s.eigenvalues, scalar.eigenvalues, atol=1e-9)


def test_open_cylinder() -> None:
    # Free ends: (2 pi p / length round)^2 + (pi q / height)^2, for vectors as for numbers.
    mesh = meshes.open_cylinder(64, 20, radius=1.0, height=2.0)
    tri = delaunay(mesh)
    mass = lumped_mass(tri)
    p, q = np.meshgrid(np.arange(-5, 6), np.arange(6))
    exact = np.sort((p**2 + (np.pi * q / 2.0) ** 2).ravel())[:12]
    for laplacian in (
        cotan_laplacian(tri),
        connection_laplacian(tri),
        connection_laplacian(tri, 4),
    ):
        s = smallest_eigenpairs(laplacian, mass, 12)
        np.testing.assert_allclose(s.eigenvalues, exact, rtol=0.01, atol=1e-9)


@pytest.mark.parametrize(
    "build", [lambda: meshes.blob(4), lambda: meshes.torus(80, 40)], ids=["blob", "torus"]
)
def test_fast_way_agrees_with_arpack(build: object) -> None:
    tri = delaunay(build())  # type: ignore[operator]
    mass = lumped_mass(tri)
    for laplacian in (cotan_laplacian(tri), connection_laplacian(tri)):
        exact = smallest_eigenpairs(laplacian, mass, 64, exact=True)
        # A cut through a cluster of eigenvalues leaves the span undefined: take a gap.
        gaps = np.diff(exact.eigenvalues)[40:]
        k = 41 + int(gaps.argmax())
        exact = Spectrum(exact.eigenvalues[:k], exact.eigenvectors[:, :k])
        fast = smallest_eigenpairs(laplacian, mass, k, exact=False)
        check_pairs(laplacian, mass, fast, 1e-10)
        # 1. Eigenvalues to 1e-4 of the largest, 2. the span to 1e-3.
        error = np.abs(fast.eigenvalues - exact.eigenvalues).max()
        assert error < 1e-4 * exact.eigenvalues[-1]
        assert span_error(exact, fast, mass) < 1e-3


def test_fast_way_gives_up_where_single_precision_does_not_do() -> None:
    # A sliver cap of relative height 1e-6 on one face spoils single precision.
    mesh = meshes.icosphere(4)
    v, f = mesh.vertices, mesh.faces
    a, b = v[f[0, 0]], v[f[0, 1]]
    new = 0.5 * (a + b) + 1e-7 * (v[f[0, 2]] - a)
    n = len(v)
    split = [[f[0, 0], f[0, 1], n], [f[0, 1], f[0, 2], n], [f[0, 2], f[0, 0], n]]
    bad = TriMesh(np.vstack([v, new]), np.vstack([f[1:], split]))
    tri = intrinsic_triangulation(bad, build_frames(bad))  # not flipped: keep the sliver
    mass = lumped_mass(tri)
    s = smallest_eigenpairs(cotan_laplacian(tri), mass, 25)
    assert np.abs(s.eigenvalues - sphere_values(0, 5)).max() < 0.02 * 20


def test_lost_orthogonality_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    # Never cleaned, single precision finds copies of the pairs nearest to the shift.
    monkeypatch.setattr(spectral, "_cleaned", lambda basis, image: image)
    tri = delaunay(meshes.blob(4))
    mass, laplacian = lumped_mass(tri), connection_laplacian(tri)
    exact = smallest_eigenpairs(laplacian, mass, 100, exact=True)
    fast = smallest_eigenpairs(laplacian, mass, 100, exact=False)
    check_pairs(laplacian, mass, fast, 1e-10)
    np.testing.assert_allclose(
        fast.eigenvalues, exact.eigenvalues, atol=1e-4 * exact.eigenvalues[-1]
    )


def test_a_strip_whose_eigenvalues_lie_below_the_shift() -> None:
    # A hundred times longer than wide: the least grow like squares, far below Weyl's estimate.
    tri = delaunay(meshes.grid(400, 4, 20.0, 0.2))
    fast = smallest_eigenpairs(cotan_laplacian(tri), lumped_mass(tri), 12, exact=False)
    exact = (np.pi * np.arange(12) / 20.0) ** 2
    np.testing.assert_allclose(fast.eigenvalues, exact, rtol=1e-3, atol=1e-6 * exact[-1])


def test_more_equal_eigenvalues_than_a_block_holds() -> None:
    # Three equal spheres: the kernel has dimension 3, l = 1 comes 9 times, l = 2 15 times.
    sphere = meshes.icosphere(4)
    many = meshes.merge(*(meshes.moved(sphere, (3.0 * i, 0.0, 0.0)) for i in range(3)))
    tri = delaunay(many)
    for exact in (True, False):
        s = smallest_eigenpairs(cotan_laplacian(tri), lumped_mass(tri), 27, exact=exact)
        np.testing.assert_allclose(
            s.eigenvalues, np.sort(np.tile(sphere_values(0, 3), 3)), atol=0.02
        )


def test_small_meshes_give_what_they_have() -> None:
    for mesh, k in ((meshes.one_triangle(), 128), (meshes.tetrahedron(), 4), (meshes.grid(), 128)):
        tri = delaunay(mesh)
        mass = lumped_mass(tri)
        s = smallest_eigenpairs(connection_laplacian(tri), mass, k)
        assert s.eigenvectors.shape == (mesh.n_vertices, min(k, mesh.n_vertices))
        check_pairs(connection_laplacian(tri), mass, s, 1e-10)


def test_scale_and_repetition() -> None:
    mesh = meshes.blob(4)
    results = []
    for scale in (1.0, 1.0, 1e-3):
        tri = delaunay(meshes.moved(mesh, (0.0, 0.0, 0.0), scale))
        results.append(smallest_eigenpairs(connection_laplacian(tri), lumped_mass(tri), 20))
    # 1. The same again, to the bit.
    np.testing.assert_array_equal(results[0].eigenvectors, results[1].eigenvectors)
    # 2. Eigenvalues are 1 / length^2.
    np.testing.assert_allclose(results[2].eigenvalues * 1e-6, results[0].eigenvalues, rtol=1e-4)

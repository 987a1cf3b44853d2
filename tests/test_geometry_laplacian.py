"""Laplacians, mass, gradient and diffusion against closed forms and other libraries."""

from __future__ import annotations

import igl
import numpy as np
import pytest
from scipy.sparse import csr_matrix, diags_array
from scipy.sparse.csgraph import breadth_first_order

from tests import meshes
from tests.test_geometry_delaunay import bad_mesh, bad_sphere
from vhquad.geometry.delaunay import (
    IntrinsicTriangulation,
    intrinsic_delaunay,
    intrinsic_triangulation,
)
from vhquad.geometry.frames import build_frames, from_3d, vertex_axes
from vhquad.geometry.laplacian import (
    connection_laplacian,
    cotan_laplacian,
    diffuse,
    gradient_operator,
    lumped_mass,
)
from vhquad.geometry.spectral import smallest_eigenpairs
from vhquad.mesh.triangle import TriMesh


def delaunay(mesh: TriMesh) -> IntrinsicTriangulation:
    return intrinsic_delaunay(mesh, build_frames(mesh))


def gauge_between(a: csr_matrix, b: csr_matrix) -> np.ndarray:
    """Unit numbers g with ``b ~ diag(g) a diag(conj g)``, from a spanning tree of the edges."""
    strong = abs(a).multiply(abs(a) > 1e-6 * abs(a).max()).tocsr()
    order, parent = breadth_first_order(strong, 0, directed=False)
    a, b = a.tocsr(), b.tocsr()
    g = np.ones(a.shape[0], dtype=np.complex128)
    for v in order[1:]:
        ratio = b[v, parent[v]] / a[v, parent[v]]
        g[v] = g[parent[v]] * ratio / abs(ratio)
    return g


@pytest.mark.parametrize("case", meshes.EVERY, ids=str)
def test_hermitian_semidefinite_with_the_right_kernel(case: meshes.Case) -> None:
    tri = delaunay(case.mesh)
    scale = abs(cotan_laplacian(tri)).max()
    for order in (0, 1, 2, 4):
        laplacian = connection_laplacian(tri, order)
        # 1. Hermitian.
        assert abs(laplacian - laplacian.conj().T).max() <= 1e-12 * scale
        # 2. Semidefinite, whatever the order, as all weights are positive.
        values = np.linalg.eigvalsh(laplacian.toarray())
        assert values[0] > -1e-10 * scale
    # 3. Order 0 is the cotan Laplacian, but for negative weights on the border; constants of each
    # component are its kernel.
    plain = cotan_laplacian(tri)
    if tri.edge_weights.min() >= -1e-9:
        assert abs(plain - connection_laplacian(tri, 0)).max() <= 1e-12 * scale
    assert abs(plain @ np.ones(tri.n_vertices)).max() <= 1e-12 * scale
    zero = np.linalg.eigvalsh(plain.toarray()) < 1e-9 * scale
    assert zero.sum() == case.components


def with_caps_at_the_border(flatness: float) -> TriMesh:
    """A half sphere whose border triangles have their third corners almost on the border."""
    mesh = meshes.half_sphere(3)
    v = mesh.vertices.copy()
    for h in np.flatnonzero(mesh.twin < 0):
        apex = mesh.faces[h // 3, (h + 2) % 3]
        middle = 0.5 * (mesh.vertices[mesh.tail[h]] + mesh.vertices[mesh.head[h]])
        v[apex] = (1.0 - flatness) * middle + flatness * mesh.vertices[apex]
    return TriMesh(v, mesh.faces)


@pytest.mark.parametrize("order", [1, 2, 4])
@pytest.mark.parametrize("flatness", [0.3, 0.03, 0.003])
def test_semidefinite_with_caps_at_the_border(flatness: float, order: int) -> None:
    mesh = with_caps_at_the_border(flatness)
    tri = delaunay(mesh)
    assert tri.edge_weights[tri.twin < 0].min() < -0.1 / flatness  # what would not be so otherwise
    laplacian, mass = connection_laplacian(tri, order), lumped_mass(tri)
    values = np.linalg.eigvalsh(laplacian.toarray())
    assert values[0] > -1e-10 * values[-1]
    # Diffusion averages: nothing comes out longer than the longest that went in.
    rng = np.random.default_rng(order)
    u = np.exp(2j * np.pi * rng.random(mesh.n_vertices))
    for time in (1e-3, 1e-2, 1e-1):
        assert np.abs(diffuse(laplacian, mass, time, u)).max() <= 1.0 + 1e-9


def test_one_element_by_hand() -> None:
    # Eq. 3 of the paper on the right triangle: cotangents 0, 1, 1; all transports are 1.
    laplacian = connection_laplacian(delaunay(meshes.one_triangle())).toarray()
    expected = 0.5 * np.array([[2, -1, -1], [-1, 1, 0], [-1, 0, 1]])
    np.testing.assert_allclose(laplacian, expected, atol=1e-15)


def test_mass_is_the_area() -> None:
    mesh = meshes.blob()
    plain = intrinsic_triangulation(mesh, build_frames(mesh))
    np.testing.assert_allclose(lumped_mass(plain), mesh.vertex_areas, rtol=1e-12)
    assert lumped_mass(delaunay(mesh)).sum() == pytest.approx(mesh.area, rel=1e-12)


def test_without_flips_it_is_the_cotan_matrix_of_libigl() -> None:
    mesh = bad_mesh()
    ours = cotan_laplacian(intrinsic_triangulation(mesh, build_frames(mesh)))
    theirs = igl.cotmatrix(mesh.vertices, mesh.faces)
    assert abs(ours + theirs).max() < 1e-12 * abs(ours).max()


@pytest.mark.parametrize(
    "build",
    [meshes.blob, meshes.pretzel, meshes.torus, meshes.half_sphere, meshes.cone, bad_sphere],
)
def test_agrees_with_potpourri3d_up_to_the_frames(build: object) -> None:
    pp3d = pytest.importorskip("potpourri3d")
    mesh = build()  # type: ignore[operator]
    theirs = pp3d.MeshVectorHeatSolver(mesh.vertices, mesh.faces).get_connection_laplacian()
    ours = connection_laplacian(delaunay(mesh))
    turn = diags_array(gauge_between(ours, theirs))
    assert abs(turn @ ours @ turn.conj() - theirs).max() < 1e-10 * abs(ours).max()


def test_relabelling_is_a_change_of_gauge(rng: np.random.Generator) -> None:
    mesh = bad_mesh()
    other = meshes.relabel(mesh, rng)
    back = csr_matrix(
        (np.ones(mesh.n_vertices), (np.arange(mesh.n_vertices), other.vertex)),
        shape=(mesh.n_vertices,) * 2,
    )
    for order in (1, 4):
        ours = connection_laplacian(delaunay(mesh), order)
        theirs = back @ connection_laplacian(delaunay(other.mesh), order) @ back.T
        turn = diags_array(gauge_between(ours, theirs))
        assert abs(turn @ ours @ turn.conj() - theirs).max() < 1e-10 * abs(ours).max()


def test_bending_a_sheet_changes_nothing() -> None:
    flat, rolled = (connection_laplacian(delaunay(meshes.sheet(turn=t)), 4) for t in (0.0, 5.0))
    assert abs(flat - rolled).max() < 1e-10


def test_gradient_of_a_linear_function_is_exact_on_a_plane(rng: np.random.Generator) -> None:
    mesh = meshes.grid(9, 9, hole=True)
    frames = build_frames(mesh)
    straight = np.isclose(frames.angle_scale, 1.0)
    value = mesh.vertices @ [2.0, -3.0, 0.0]
    expected = from_3d(np.tile([2.0, -3.0, 0.0], (len(value), 1)), vertex_axes(mesh, frames))
    for tri in (delaunay(mesh), intrinsic_triangulation(mesh, frames)):
        found = gradient_operator(tri) @ value
        np.testing.assert_allclose(found[straight], expected[straight], atol=1e-12)
        # Constants have none, at corners too.
        assert np.abs(gradient_operator(tri) @ np.ones(len(value))).max() < 1e-12


def gradient_error(subdivisions: int) -> float:
    mesh = meshes.icosphere(subdivisions)
    tri, axes = delaunay(mesh), vertex_axes(mesh)
    x, y, z = mesh.vertices.T
    slope = np.stack([y, x, 3 * z**2], axis=1)
    slope -= (slope * mesh.vertices).sum(axis=1)[:, None] * mesh.vertices
    exact = from_3d(slope, axes)
    error = gradient_operator(tri) @ (x * y + z**3) - exact
    mass = lumped_mass(tri)
    return float(np.sqrt((mass @ np.abs(error) ** 2) / (mass @ np.abs(exact) ** 2)))


def test_gradient_on_spheres_converges() -> None:
    coarse, fine = gradient_error(2), gradient_error(3)
    # Measured 0.1 and 0.027: about second order on these nearly regular meshes.
    assert coarse < 0.12
    assert fine < 0.35 * coarse


def test_diffusion_keeps_the_total_and_tends_to_the_mean(rng: np.random.Generator) -> None:
    mesh = meshes.half_sphere()
    tri = delaunay(mesh)
    laplacian, mass = cotan_laplacian(tri), lumped_mass(tri)
    u = rng.normal(size=(len(mass), 2))
    # 1. Heat is conserved.
    np.testing.assert_allclose(mass @ diffuse(laplacian, mass, 0.1, u), mass @ u, atol=1e-12)
    # 2. Long after, it is spread evenly.
    late = diffuse(laplacian, mass, 1e9, u)
    np.testing.assert_allclose(late, np.tile(mass @ u / mass.sum(), (len(u), 1)), atol=1e-6)
    # 3. At time zero nothing has happened; shapes are kept.
    np.testing.assert_allclose(diffuse(laplacian, mass, 0.0, u[:, 0]), u[:, 0], atol=1e-12)


def test_spectral_diffusion_tends_to_implicit_euler(rng: np.random.Generator) -> None:
    mesh = meshes.blob(2)
    tri = delaunay(mesh)
    laplacian, mass = connection_laplacian(tri), lumped_mass(tri)
    n = len(mass)
    u = rng.normal(size=(n, 2)) @ [1, 1j]
    time = 0.1
    exact = diffuse(laplacian, mass, time, u)
    norm = np.sqrt(mass @ np.abs(exact) ** 2)

    def error(k: int, steps: int, decay: str) -> float:
        s = smallest_eigenpairs(laplacian, mass, k)
        if decay == "euler":
            factor = 1.0 / (1.0 + time * s.eigenvalues)
        else:
            factor = np.exp(-time * s.eigenvalues)
        target = exact
        if steps > 1:
            target = u
            for _ in range(steps):
                target = diffuse(laplacian, mass, time / steps, target)
        p = s.eigenvectors
        found = p @ (factor * (p.conj().T @ (mass * u)))
        return float(np.sqrt(mass @ np.abs(found - target) ** 2) / norm)

    # 1. With the whole basis and the factor of one Euler step they are the same.
    assert error(n, 1, "euler") < 1e-10
    # 2. The truncation falls with k.
    errors = [error(k, 1, "euler") for k in (8, 32, 128, n)]
    assert errors == sorted(errors, reverse=True)
    # 3. The network's factor exp(-lambda t) is the limit of many small steps (first order).
    few, many = error(n, 20, "exp"), error(n, 40, "exp")
    assert many < 0.02
    assert 0.45 < many / few < 0.55

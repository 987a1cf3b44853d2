"""Features: by name, scale-free, tied to the shape and not to its place, labels or bending."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import block_diag

from tests import meshes
from vhquad.errors import ConfigError
from vhquad.geometry.delaunay import intrinsic_delaunay
from vhquad.geometry.features import (
    FEATURES,
    HKS_TIMES,
    ShapeContext,
    compute_features,
    heat_kernel_signature,
    hks_gradients,
)
from vhquad.geometry.frames import build_frames, from_3d, to_3d, vertex_axes
from vhquad.geometry.laplacian import cotan_laplacian, lumped_mass
from vhquad.geometry.local import RADII
from vhquad.geometry.spectral import Spectrum, smallest_eigenpairs
from vhquad.mesh.triangle import TriMesh


def context(mesh: TriMesh, k: int = 48) -> ShapeContext:
    frames = build_frames(mesh)
    return ShapeContext(mesh, frames, intrinsic_delaunay(mesh, frames), k)


@pytest.mark.parametrize("name", list(FEATURES))
def test_shape_type_and_length(name: str) -> None:
    shape = context(meshes.blob())
    mass = lumped_mass(shape.tri)
    found = compute_features(name, shape, turned=False)
    x = found.vectors
    # 1. One row a vertex; the number of channels that the name promises.
    channels = {"hks": len(HKS_TIMES), "gaussian": 1, "mean": 1, "pcd": 2, "local": 36}[name]
    assert x.shape == (mass.size, channels)
    assert found.lines.shape == (mass.size, len(RADII) if name == "local" else 0)
    assert x.dtype == found.lines.dtype == np.complex128
    # 2. Mean length 1 over the area; "local" keeps its lengths, short ones on so smooth a shape.
    length = mass @ np.abs(x) / mass.sum()
    if name == "local":
        assert length.min() > 0.01
        assert length.max() < 1.0
    else:
        np.testing.assert_allclose(length, 1.0, rtol=1e-12)
    # 3. Turned copies stand behind, all together; principal directions have none.
    both = compute_features(name, shape, turned=True)
    expected = x if name == "pcd" else np.hstack([x, 1j * x])
    np.testing.assert_array_equal(both.vectors, expected)
    np.testing.assert_array_equal(both.lines, found.lines)


def test_unknown_name() -> None:
    with pytest.raises(ConfigError, match="choose from hks, gaussian, mean, pcd, local"):
        compute_features("shot", context(meshes.tetrahedron()))


@pytest.mark.parametrize("name", list(FEATURES))
def test_move_scale_and_relabel(name: str, rng: np.random.Generator) -> None:
    mesh = meshes.blob()
    x = compute_features(name, context(mesh))
    # 1. Rigid motion and scale: the same numbers.
    rigid = meshes.random_rigid(rng)
    other = meshes.moved(rigid.mesh(mesh), (0.0, 5.0, 0.0), 0.01)
    y = compute_features(name, context(other))
    np.testing.assert_allclose(y.vectors, x.vectors, atol=1e-10)
    np.testing.assert_allclose(y.lines, x.lines, atol=1e-10)
    # 2. Other labels, hence other frames: the same vectors and lines in space.
    relabelled = meshes.relabel(mesh, rng)
    y = compute_features(name, context(relabelled.mesh))
    there, here = vertex_axes(relabelled.mesh), vertex_axes(mesh)
    np.testing.assert_allclose(
        from_3d(to_3d(y.vectors, there)[relabelled.vertex], here), x.vectors, atol=1e-10
    )
    root = from_3d(to_3d(np.sqrt(y.lines), there)[relabelled.vertex], here)
    np.testing.assert_allclose(root**2, x.lines, atol=1e-10)


def test_bending_a_sheet_changes_no_heat_kernel() -> None:
    # 187 vertices: the whole spectrum, in double precision.
    flat, rolled = (
        compute_features("hks", context(meshes.sheet(turn=t))).vectors for t in (0.0, 5.0)
    )
    np.testing.assert_allclose(flat, rolled, atol=1e-9)


def test_features_that_a_shape_lacks_stay_small() -> None:
    for name in ("gaussian", "mean", "pcd", "local"):
        found = compute_features(name, context(meshes.disk()))
        assert np.abs(found.vectors).max() < 1e-4
        assert np.abs(found.lines).max(initial=0.0) < 1e-4


def test_heat_kernel_of_the_sphere() -> None:
    # Sum over l of (2 l + 1) exp(-l (l + 1) t) / 4 pi, everywhere the same.
    tri = context(meshes.icosphere(4)).tri
    s = smallest_eigenpairs(cotan_laplacian(tri), lumped_mass(tri), 64)
    times = np.array([0.2, 1.0])
    l = np.arange(30)[:, None]
    exact = ((2 * l + 1) * np.exp(-l * (l + 1) * times)).sum(axis=0) / (4 * np.pi)
    found = heat_kernel_signature(s, times)
    np.testing.assert_allclose(found, np.tile(exact, (len(found), 1)), rtol=0.01)


def test_heat_kernel_does_not_see_the_basis_of_an_eigenspace(rng: np.random.Generator) -> None:
    tri = context(meshes.icosphere(2)).tri
    s = smallest_eigenpairs(cotan_laplacian(tri), lumped_mass(tri), 9)
    q3 = np.linalg.qr(rng.normal(size=(3, 3)))[0]  # l = 1: three equal eigenvalues
    q5 = np.linalg.qr(rng.normal(size=(5, 5)))[0]  # l = 2: five
    mixed = Spectrum(s.eigenvalues, s.eigenvectors @ block_diag([[-1.0]], q3, q5))
    times = np.array([0.1, 1.0])
    np.testing.assert_allclose(
        heat_kernel_signature(mixed, times), heat_kernel_signature(s, times), rtol=1e-9
    )


def test_late_channels_are_signal_in_both_precisions() -> None:
    # At time 10 the changing part of a round shape's signature is exp(-20) of the constant part.
    shape = context(meshes.blob(4), 64)
    mass, laplacian = lumped_mass(shape.tri), cotan_laplacian(shape.tri)
    exact = smallest_eigenpairs(laplacian, mass, 64, exact=True)
    fast = smallest_eigenpairs(laplacian, mass, 64, exact=False)
    a, b = (hks_gradients(s, shape) for s in (exact, fast))
    assert np.abs(a - b).max() < 1e-3
    np.testing.assert_allclose(mass @ np.abs(b) / mass.sum(), 1.0, rtol=1e-12)


def test_times_follow_each_component() -> None:
    # With the whole basis, a pair of shapes has the features of each, up to the common length.
    one = meshes.half_sphere()
    pair = meshes.merge(one, meshes.moved(one, (4.0, 0.0, 0.0), 3.0))
    alone = compute_features("hks", context(one, k=500), turned=False).vectors
    both = compute_features("hks", context(pair, k=500), turned=False).vectors
    n = one.n_vertices
    for part in (both[:n], both[n:]):
        ratio = np.abs(part).sum(axis=0) / np.abs(alone).sum(axis=0)
        np.testing.assert_allclose(part, alone * ratio, atol=1e-6 * np.abs(part).max())


def test_another_triangulation_of_the_same_surface() -> None:
    # The same torus with its diagonals the other way: other triangles, same vertices.
    mesh = meshes.torus(60, 30)
    other = TriMesh(mesh.vertices * [1, -1, 1], mesh.faces[:, ::-1])  # mirrored: diagonals flip
    a, b = (compute_features("hks", context(m, 128), turned=False).vectors for m in (mesh, other))
    nu, nv = 60, 30
    index = np.arange(nu * nv).reshape(nu, nv)[-np.arange(nu) % nu].reshape(-1)
    space = to_3d(b, vertex_axes(other))[index]
    found = from_3d(space, vertex_axes(mesh))
    error = np.abs(found - a).mean(axis=0) / np.abs(a).mean(axis=0)
    assert error.max() < 0.02

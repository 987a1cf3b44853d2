"""PN triangles: through the vertices, alike from both sides of an edge, near a smooth surface."""

from __future__ import annotations

import numpy as np
import pytest

from tests import meshes
from vhquad.field.features import crease_halfedges, find_creases
from vhquad.mesh.pn_triangles import PnTriangles
from vhquad.mesh.triangle import TriMesh


def smooth(mesh: TriMesh) -> PnTriangles:
    return PnTriangles(mesh, np.zeros(3 * mesh.n_faces, dtype=bool))


def points(
    patches: PnTriangles, mesh: TriMesh, n: int, seed: int = 0
) -> tuple[np.ndarray, np.ndarray]:
    """Some points of patches, and those of the flat triangles."""
    rng = np.random.default_rng(seed)
    face = rng.integers(mesh.n_faces, size=n)
    share = rng.dirichlet([1.0, 1.0, 1.0], size=n)
    flat = np.einsum("qk,qki->qi", share, mesh.vertices[mesh.faces[face]])
    return patches.points(face, share), flat


@pytest.mark.parametrize("case", meshes.EVERY, ids=str)
def test_through_the_vertices(case: meshes.Case) -> None:
    mesh = case.mesh
    patches = smooth(mesh)
    for k in range(3):
        found = patches.points(np.arange(mesh.n_faces), np.tile(np.eye(3)[k], (mesh.n_faces, 1)))
        np.testing.assert_allclose(found, mesh.vertices[mesh.faces[:, k]], atol=1e-12)


@pytest.mark.parametrize("some", [0.0, 0.3])
def test_neighbours_meet(some: float, rng: np.random.Generator) -> None:
    mesh = meshes.blob(2)
    sharp = np.zeros(3 * mesh.n_faces, dtype=bool)
    sharp[rng.random(len(sharp)) < some] = True
    sharp |= sharp[mesh.twin]
    patches = PnTriangles(mesh, sharp)
    h = np.arange(3 * mesh.n_faces)
    for t in (0.2, 0.5):
        along, back = np.zeros((len(h), 3)), np.zeros((len(h), 3))
        along[h, h % 3], along[h, (h + 1) % 3] = 1.0 - t, t
        back[h, mesh.twin % 3], back[h, (mesh.twin + 1) % 3] = t, 1.0 - t
        one, two = patches.points(h // 3, along), patches.points(mesh.twin // 3, back)
        np.testing.assert_allclose(one, two, atol=1e-12)
        straight = np.einsum("hk,hki->hi", along, mesh.vertices[mesh.faces[h // 3]])
        np.testing.assert_allclose(one[sharp], straight[sharp], atol=1e-12)
        assert np.linalg.norm(one - straight, axis=1)[~sharp].max() > 1e-3


@pytest.mark.parametrize("subdivisions", [1, 2, 3])
def test_a_ball_is_round(subdivisions: int) -> None:
    """Ten times nearer to the sphere than flat triangles, at every size."""
    mesh = meshes.icosphere(subdivisions)
    found, flat = points(smooth(mesh), mesh, 1000)
    off, was = (np.abs(np.linalg.norm(x, axis=1) - 1.0).mean() for x in (found, flat))
    assert off < 0.1 * was


def test_planes_and_borders_stay() -> None:
    mesh = meshes.grid(5, 4)
    found, flat = points(smooth(mesh), mesh, 200)
    np.testing.assert_allclose(found, flat, atol=1e-12)
    half = meshes.half_sphere(2)
    h = np.flatnonzero(half.twin < 0)
    share = np.zeros((len(h), 3))
    share[np.arange(len(h)), h % 3] = share[np.arange(len(h)), (h + 1) % 3] = 0.5
    middle = 0.5 * (half.vertices[half.tail[h]] + half.vertices[half.head[h]])
    np.testing.assert_allclose(smooth(half).points(h // 3, share), middle, atol=1e-12)


def test_sharp_edges_stay_sharp() -> None:
    """A cube stays a cube if its edges are sharp, and is rounded if they are not."""
    mesh = meshes.cube(3)
    sharp = crease_halfedges(mesh, find_creases(mesh, 40.0))
    found, flat = points(PnTriangles(mesh, sharp), mesh, 500)
    np.testing.assert_allclose(found, flat, atol=1e-12)
    rounded, _ = points(smooth(mesh), mesh, 500)
    assert np.abs(rounded - flat).max() > 0.01


def test_no_bulges() -> None:
    """However the normals lie, no point is farther from its triangle than a quarter of an edge."""
    spiky = meshes.blob(2, seed=3, strength=1.5)
    found, flat = points(smooth(spiky), spiky, 2000)
    assert np.isfinite(found).all()
    assert np.linalg.norm(found - flat, axis=1).max() < 0.25 * spiky.edge_lengths.max()

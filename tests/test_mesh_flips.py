"""Edge flips: towards Delaunay, on flat parts only, with topology and chosen edges as they were."""

from __future__ import annotations

import numpy as np
import pytest

from tests import meshes
from vhquad.mesh.flips import flip_edges
from vhquad.mesh.triangle import TriMesh

NONE = np.zeros((0, 2), dtype=np.int64)


def excess(mesh: TriMesh) -> np.ndarray:
    """Opposite angles of interior edges less pi."""
    h = mesh.edge_halfedges[(mesh.edge_halfedges >= 0).all(axis=1)]
    apex = h - h % 3 + (h + 2) % 3
    return mesh.corner_angles.reshape(-1)[apex].sum(axis=1) - np.pi


def sheared(shear: float) -> TriMesh:
    mesh = meshes.grid(12, 9)
    v = np.array(mesh.vertices)
    v[:, 0] += shear * v[:, 1]
    return TriMesh(v, mesh.faces)


def test_two_triangles_by_hand() -> None:
    v = np.array([[0, 0, 0], [2, 0, 0], [1, 0.2, 0], [1, -0.2, 0]], dtype=float)
    mesh = TriMesh(v, [[0, 1, 2], [1, 0, 3]])
    flipped = flip_edges(mesh, NONE)
    assert sorted(map(tuple, flipped.edges.tolist())) == [(0, 2), (0, 3), (1, 2), (1, 3), (2, 3)]
    assert flipped.area == pytest.approx(mesh.area, rel=1e-12)
    kept = flip_edges(mesh, np.array([[1, 0]]))
    assert np.array_equal(kept.faces, mesh.faces)


@pytest.mark.parametrize("shear", [-1.5, 1.5])
def test_a_sheared_sheet_gets_delaunay(shear: float) -> None:
    mesh = sheared(shear)
    assert (excess(mesh) > 1e-6).any() or shear > 0
    flipped = flip_edges(mesh, NONE)
    assert (excess(flipped) <= 1e-6).mean() > 0.98
    assert flipped.euler_characteristic == mesh.euler_characteristic
    assert flipped.area == pytest.approx(mesh.area, rel=1e-12)
    assert (flipped.face_normals[:, 2] > 0.999).all()


def test_edges_of_a_cube_stay() -> None:
    mesh = meshes.cube(6)
    v = np.array(mesh.vertices)
    v[:, 2] *= 3.0
    mesh = TriMesh(v, mesh.faces)
    flipped = flip_edges(mesh, NONE)
    normals = np.abs(flipped.face_normals)
    assert np.allclose(np.sort(normals, axis=1), [0.0, 0.0, 1.0], atol=1e-12)
    assert flipped.area == pytest.approx(mesh.area, rel=1e-12)


def test_a_noisy_blob_keeps_its_topology_and_its_normals() -> None:
    mesh = meshes.blob(4, strength=0.5)
    flipped = flip_edges(mesh, NONE)
    assert flipped.has_manifold_vertices
    assert flipped.euler_characteristic == 2
    assert excess(flipped).clip(min=0).sum() <= excess(mesh).clip(min=0).sum()
    outward = np.einsum("mi,mi->m", flipped.face_normals, flipped.vertices[flipped.faces[:, 0]])
    assert (outward > 0).mean() > 0.99

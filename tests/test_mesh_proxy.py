"""Decimation: sound results near the surface, in the asked size, whatever the scale."""

from __future__ import annotations

import numpy as np
import pytest

from tests import meshes
from tests.data_paths import data_file
from tests.meshes import EVERY, Case
from vhquad.mesh.closest import ClosestPoints
from vhquad.mesh.load import load
from vhquad.mesh.proxy import decimate
from vhquad.mesh.triangle import TriMesh


def volume(mesh: TriMesh) -> float:
    p = mesh.vertices[mesh.faces]
    return float(np.einsum("mi,mi->", p[:, 0], np.cross(p[:, 1], p[:, 2])) / 6.0)


@pytest.mark.parametrize("case", EVERY, ids=str)
def test_suite_at_half_size_is_sound(case: Case) -> None:
    proxy = decimate(case.mesh, case.mesh.n_faces // 2)
    assert proxy.has_manifold_vertices
    assert proxy.n_components == case.components
    assert proxy.is_used_vertex.all()
    assert proxy.is_closed == (case.loops == 0)
    gap = ClosestPoints(case.mesh).distance(proxy.vertices).max()
    assert gap < 0.05 * case.mesh.diagonal


def test_count_and_closeness_of_a_sphere() -> None:
    ball = meshes.icosphere(5)
    proxy = decimate(ball, 2000)
    assert proxy.n_faces == pytest.approx(2000, rel=0.02)
    assert proxy.is_closed
    assert proxy.euler_characteristic == 2
    assert volume(proxy) == pytest.approx(4 * np.pi / 3, rel=0.01)
    assert np.abs(np.linalg.norm(proxy.vertices, axis=1) - 1).max() < 0.01


def test_a_small_mesh_is_left_alone() -> None:
    mesh = meshes.blob(2)
    assert decimate(mesh, mesh.n_faces) is mesh
    assert decimate(mesh, 10).n_faces == pytest.approx(64, abs=4)


@pytest.mark.parametrize("scale", [1e-6, 1e6])
def test_scale_does_not_matter(scale: float) -> None:
    mesh = meshes.blob(4)
    plain = decimate(mesh, 800)
    scaled = decimate(TriMesh(scale * mesh.vertices, mesh.faces), 800)
    assert scaled.n_faces == pytest.approx(plain.n_faces, rel=0.02)
    assert volume(scaled) / scale**3 == pytest.approx(volume(plain), rel=1e-3)


def test_components_and_their_winding_are_kept() -> None:
    outer, inner = meshes.icosphere(4), meshes.icosphere(3, 0.5)
    cavity = TriMesh(inner.vertices, inner.faces[:, ::-1])
    both = meshes.merge(outer, cavity, meshes.moved(meshes.tetrahedron(), (5, 0, 0)))
    proxy = decimate(both, 2000)
    assert proxy.n_components == 3
    assert proxy.n_faces == pytest.approx(2000, rel=0.05)
    parts = [proxy.submesh(proxy.face_component == k)[0] for k in range(3)]
    assert volume(parts[0]) == pytest.approx(4 / 3 * np.pi, rel=0.02)
    assert volume(parts[1]) == pytest.approx(-4 / 3 * np.pi / 8, rel=0.05)
    assert parts[2].n_faces == 4


@pytest.mark.parametrize("name", ["skull", "scorpion", "demosthenes"])
def test_scans_keep_one_sound_component(name: str) -> None:
    mesh = load(data_file("tris", f"{name}.obj")).mesh
    proxy = decimate(mesh, 3000)
    assert proxy.has_manifold_vertices
    assert proxy.n_components == 1
    assert proxy.euler_characteristic == mesh.euler_characteristic
    assert ClosestPoints(mesh).distance(proxy.vertices).max() < 0.01 * mesh.diagonal

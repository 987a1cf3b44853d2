"""TriMesh and the mesh suite against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from tests import meshes, soups
from tests.meshes import CLOSED, EVERY, OPEN, Case
from tests.soups import SOUPS
from vhquad.errors import MeshError
from vhquad.mesh.triangle import TriMesh, next_halfedge, prev_halfedge


@pytest.mark.parametrize("case", EVERY, ids=str)
def test_suite_is_what_it_says(case: Case) -> None:
    m = case.mesh
    assert m.euler_characteristic == case.euler
    assert len(m.boundary_loops) == case.loops
    assert m.n_components == case.components
    assert m.has_manifold_vertices
    assert m.is_closed == (case.loops == 0)
    assert m.face_areas.min() > 0
    assert np.unique(m.faces).size == m.n_vertices


@pytest.mark.parametrize("case", EVERY, ids=str)
def test_halfedge_identities(case: Case) -> None:
    m = case.mesh
    h = np.arange(3 * m.n_faces)
    inner = m.twin >= 0
    assert (m.twin[m.twin[inner]] == h[inner]).all()
    assert (m.tail[m.twin[inner]] == m.head[inner]).all()
    assert (m.head[h] == m.tail[next_halfedge(h)]).all()
    assert (prev_halfedge(next_halfedge(h)) == h).all()
    assert (m.tail[m.outgoing] == np.arange(m.n_vertices)).all()
    border = m.is_boundary_vertex
    assert (m.twin[m.outgoing[border]] < 0).all()
    # Ranks about a vertex are 0 .. degree - 1, each once.
    degree = np.bincount(m.tail)
    assert (np.bincount(m.tail, weights=m.fan_rank) == degree * (degree - 1) / 2).all()
    loops = np.concatenate(m.boundary_loops) if m.boundary_loops else np.zeros(0, dtype=int)
    assert np.array_equal(np.sort(loops), np.flatnonzero(m.twin < 0))
    for loop in m.boundary_loops:
        assert (m.head[loop] == m.tail[np.roll(loop, -1)]).all()


@pytest.mark.parametrize("case", EVERY, ids=str)
def test_gauss_bonnet(case: Case) -> None:
    m = case.mesh
    angle = np.bincount(m.faces.reshape(-1), weights=m.corner_angles.reshape(-1))
    defect = np.where(m.is_boundary_vertex, np.pi, 2 * np.pi) - angle
    assert defect.sum() == pytest.approx(2 * np.pi * case.euler, abs=1e-10)


@pytest.mark.parametrize("case", CLOSED, ids=str)
def test_closed_meshes_face_outward(case: Case) -> None:
    m = case.mesh
    p = m.vertices[m.faces]
    assert np.einsum("mi,mi->m", p[:, 0], np.cross(p[:, 1], p[:, 2])).sum() > 0
    assert np.abs((m.face_areas[:, None] * m.face_normals).sum(axis=0)).max() < 1e-12 * m.area


def test_right_triangle_by_hand() -> None:
    m = meshes.one_triangle()
    assert m.area == 0.5
    np.testing.assert_allclose(m.corner_angles, [[np.pi / 2, np.pi / 4, np.pi / 4]], atol=1e-15)
    np.testing.assert_allclose(m.edge_lengths, [[1, np.sqrt(2), 1]])
    np.testing.assert_allclose(m.face_altitudes, [[np.sqrt(0.5), 1, 1]])
    np.testing.assert_allclose(m.vertex_areas, np.full(3, 1 / 6))
    np.testing.assert_array_equal(m.vertex_normals, [[0, 0, 1]] * 3)
    assert m.diagonal == pytest.approx(np.sqrt(2))


def test_areas_converge_at_second_order() -> None:
    exact = [4 * np.pi, 4 * np.pi**2 * 0.4, 4 * np.pi]
    series = [
        [meshes.icosphere(s).area for s in (2, 3, 4)],
        [meshes.torus(16 * k, 8 * k).area for k in (1, 2, 4)],
        [meshes.open_cylinder(8 * k).area for k in (1, 2, 4)],
    ]
    for truth, areas in zip(exact, series, strict=True):
        error = np.abs(np.array(areas) - truth) / truth
        assert (np.log2(error[:-1] / error[1:]) > 1.8).all()
    assert meshes.cube(5).area == pytest.approx(6.0)
    assert meshes.cone(96).area == pytest.approx(np.pi * np.sqrt(2), rel=2e-3)


def test_cone_apex_angle() -> None:
    m = meshes.cone(200, 2, 1.0, 1.0)
    apex = m.corner_angles[m.faces == m.n_vertices - 1].sum()
    assert apex == pytest.approx(2 * np.pi / np.sqrt(2), rel=1e-3)


def test_rolling_a_sheet_keeps_every_length() -> None:
    flat, rolled = meshes.sheet(), meshes.sheet(turn=5.0)
    np.testing.assert_allclose(flat.edge_lengths, rolled.edge_lengths, rtol=1e-12)
    assert np.ptp(flat.vertices[:, 2]) == 0
    assert np.ptp(rolled.vertices[:, 2]) > 0.2


def test_relabel_and_rigid_keep_the_surface(rng: np.random.Generator) -> None:
    m = meshes.blob(2)
    r = meshes.relabel(m, rng)
    for k in range(3):
        corner = (k + r.shift) % 3
        assert (r.mesh.faces[r.face, corner] == r.vertex[m.faces[:, k]]).all()
    np.testing.assert_array_equal(r.mesh.vertices[r.vertex], m.vertices)
    assert r.mesh.twin.min() >= 0
    g = meshes.random_rigid(rng)
    assert np.linalg.det(g.rotation) == pytest.approx(1.0)
    np.testing.assert_allclose(g.mesh(m).face_normals, g.vectors(m.face_normals), atol=1e-12)


@pytest.mark.parametrize("name", ["three_fins", "two_cubes_on_an_edge", "mixed_winding"])
def test_topology_errors_name_the_place(name: str) -> None:
    with pytest.raises(MeshError, match=r"first joins vertices .*; run repair first"):
        _ = TriMesh(*SOUPS[name]()).twin


def test_bowtie_is_seen() -> None:
    assert not TriMesh(*soups.bowtie()).has_manifold_vertices


@pytest.mark.parametrize(
    ("v", "f", "say"),
    [
        (np.zeros((3, 2)), [[0, 1, 2]], "shape"),
        (np.zeros((3, 3)), np.zeros((0, 3), int), "m > 0"),
        (np.zeros((3, 3)), [[0.0, 1.0, 2.0]], "integers"),
        (np.zeros((3, 3)), [[0, 1, 3]], "outside 0..2, the first is 0"),
        (np.zeros((3, 3)), [[0, -1, 2]], "outside"),
        ([[0, 0, 0], [1, np.nan, 0], [0, 1, 0]], [[0, 1, 2]], "the first is 1"),
    ],
)
def test_bad_arrays_are_refused(v: object, f: object, say: str) -> None:
    with pytest.raises(MeshError, match=say):
        TriMesh(v, f)  # type: ignore[arg-type]


def test_arrays_are_copies_and_read_only() -> None:
    v = np.eye(3)
    m = TriMesh(v, [[0, 1, 2]])
    v[:] = 7
    assert m.vertices.max() == 1
    with pytest.raises(ValueError, match="read-only"):
        m.vertices[0, 0] = 3


@pytest.mark.parametrize("case", OPEN, ids=str)
def test_submesh_of_everything_is_the_mesh(case: Case) -> None:
    part, used = case.mesh.submesh(np.ones(case.mesh.n_faces, dtype=bool))
    np.testing.assert_array_equal(used[part.faces], case.mesh.faces)
    assert part is case.mesh
    # An index list may be in any order, and vertices that no face uses are left out.
    backwards = np.arange(case.mesh.n_faces)[::-1]
    part, used = case.mesh.submesh(backwards)
    np.testing.assert_array_equal(used[part.faces], case.mesh.faces[::-1])
    more = TriMesh(np.vstack([case.mesh.vertices, [[9.0, 9.0, 9.0]]]), case.mesh.faces)
    part, used = more.submesh(np.ones(more.n_faces, dtype=bool))
    assert part.n_vertices == case.mesh.n_vertices

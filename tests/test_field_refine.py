"""Splitting edges and faces: the same surface, the same field, everything carried along."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.meshes import EVERY, Case, cube, grid, one_triangle, torus
from vhquad.field.dual import face_angles
from vhquad.field.features import crease_halfedges, find_creases
from vhquad.field.matching import match_field
from vhquad.field.refine import Refinement, no_refinement, split_edges, split_faces
from vhquad.field.separate import separate_features, separate_singularities
from vhquad.geometry.frames import face_axes, to_3d
from vhquad.mesh.triangle import TriMesh, next_halfedge


def check_refinement(mesh: TriMesh, step: Refinement) -> None:
    """Parents, turns and sources, each against the geometry."""
    fine = step.mesh
    # 1. old vertices stay, topology stays, area stays, face by face
    np.testing.assert_array_equal(fine.vertices[: mesh.n_vertices], mesh.vertices)
    assert fine.euler_characteristic == mesh.euler_characteristic
    share = np.bincount(step.parent, fine.face_areas, mesh.n_faces)
    np.testing.assert_allclose(share, mesh.face_areas, rtol=1e-9)
    # 2. a child's axis seen from its parent has the angle `turn`
    axis = to_3d(
        np.exp(1j * step.turn), type(face_axes(mesh))(*(e[step.parent] for e in face_axes(mesh)))
    )
    np.testing.assert_allclose(axis, face_axes(fine).e1, atol=1e-9)
    # 3. halfedges lie on their sources and run the same way
    h = np.flatnonzero(step.source >= 0)
    old = step.source[h]
    side = fine.vertices[fine.head[h]] - fine.vertices[fine.tail[h]]
    whole = mesh.vertices[mesh.head[old]] - mesh.vertices[mesh.tail[old]]
    assert (np.einsum("hi,hi->h", side, whole) > 0).all()
    np.testing.assert_allclose(np.cross(side, whole), 0.0, atol=1e-12)
    length = np.bincount(old, np.linalg.norm(side, axis=1), 3 * mesh.n_faces)
    np.testing.assert_allclose(length, mesh.edge_lengths.reshape(-1), rtol=1e-9)
    # 4. the others lie inside a parent
    inside = np.flatnonzero(step.source < 0)
    assert (fine.twin[inside] >= 0).all()
    np.testing.assert_array_equal(step.parent[inside // 3], step.parent[fine.twin[inside] // 3])


@given(case=st.sampled_from(EVERY), seed=st.integers(0, 2**32 - 1))
def test_random_splits_keep_surface_and_field(case: Case, seed: int) -> None:
    rng = np.random.default_rng(seed)
    mesh = case.mesh
    total = no_refinement(mesh)
    border = np.zeros(3 * mesh.n_faces)
    field = match_field(mesh, rng.uniform(-3, 3, mesh.n_faces), mesh.twin < 0, border)
    before = dict(zip(field.sector_vertex, field.sector_quads, strict=True))
    for _ in range(3):
        if rng.random() < 0.3:
            step = split_faces(total.mesh, rng.random(total.mesh.n_faces) < 0.2)
        else:
            inner = (total.mesh.edge_halfedges >= 0).all(axis=1)
            step = split_edges(total.mesh, inner & (rng.random(total.mesh.n_edges) < 0.3))
        field, total = field.refined(step), total.then(step)
    check_refinement(mesh, total)
    # 5. no index moves, new vertices are flat, and all are integers still
    assert np.abs(field.sector_turns - field.sector_quads).max() < 1e-9
    for vertex, quads in zip(field.sector_vertex, field.sector_quads, strict=True):
        assert quads == before.get(vertex, 4)


def test_one_split_by_hand() -> None:
    mesh = grid(1, 1, 1.0, 1.0)
    assert split_edges(mesh, np.zeros(5, dtype=bool)).mesh is mesh
    diagonal = (mesh.edge_halfedges >= 0).all(axis=1)
    step = split_edges(mesh, diagonal)
    assert (step.mesh.n_vertices, step.mesh.n_faces) == (5, 4)
    np.testing.assert_allclose(step.mesh.vertices[4], [0.5, 0.5, 0.0])
    assert sorted(step.parent) == [0, 0, 1, 1]
    three = split_faces(one_triangle(), np.array([True])).mesh
    np.testing.assert_allclose(three.vertices[3], [1 / 3, 1 / 3, 0.0])
    assert np.allclose(three.face_areas, 1 / 6)


@pytest.mark.parametrize("case", EVERY, ids=str)
def test_features_are_separated_with_creases_too(case: Case) -> None:
    mesh = case.mesh
    feature = (mesh.twin < 0) | crease_halfedges(mesh, find_creases(mesh, 20.0))
    step = separate_features(mesh, feature)
    check_refinement(mesh, step)
    on, fine = step.carry(feature, False), step.mesh
    # 1. features were not split, and no face has two
    assert on.sum() == feature.sum()
    assert on.reshape(-1, 3).sum(axis=1).max() <= 1
    # 2. no other edge joins two of their vertices
    special = np.zeros(fine.n_vertices, dtype=bool)
    special[fine.tail[on]] = special[fine.head[on]] = True
    assert not (special[fine.tail] & special[fine.head])[~on].any()


@pytest.mark.parametrize("mesh", [torus(), cube(3), grid()], ids=["torus", "cube", "grid"])
def test_singularities_are_separated(mesh: TriMesh) -> None:
    rng = np.random.default_rng(7)
    angle = rng.uniform(-3, 3, mesh.n_faces)
    field = match_field(mesh, angle, mesh.twin < 0, np.zeros(3 * mesh.n_faces))
    apart, step = separate_singularities(field)
    check_refinement(mesh, step)
    h = np.flatnonzero(~apart.feature)
    s, singular = apart.corner_sector, apart.sector_is_singular
    assert not (singular[s[h]] & singular[s[next_halfedge(h)]]).any()
    assert singular.sum() == field.sector_is_singular.sum()


def test_face_angles_are_the_directions_of_the_edges() -> None:
    mesh = torus()
    side = mesh.vertices[mesh.head] - mesh.vertices[mesh.tail]
    face = np.arange(3 * mesh.n_faces) // 3
    axes = face_axes(mesh)
    u = (side * axes.e1[face]).sum(axis=1) + 1j * (side * axes.e2[face]).sum(axis=1)
    np.testing.assert_allclose(np.exp(1j * face_angles(mesh)), u / np.abs(u), atol=1e-12)

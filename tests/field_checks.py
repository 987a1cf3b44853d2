"""What must hold of every AlignedField, asserted by one function."""

from __future__ import annotations

import numpy as np

from vhquad.field.align import AlignedField
from vhquad.mesh.triangle import TriMesh, next_halfedge


def flat_quads(aligned: AlignedField) -> np.ndarray:
    """Quads around a sector where nothing is singular."""
    return np.where(aligned.sector_is_feature, 2, 4)


def check_aligned(source: TriMesh, aligned: AlignedField) -> None:
    """Assert the guarantees of the class, the index theorem and the consistency of its integers."""
    mesh, feature, s = aligned.mesh, aligned.feature, aligned.sector.reshape(-1)
    inner = mesh.twin >= 0
    h = np.flatnonzero(~feature)
    on = np.flatnonzero(feature)

    # 1. the refined mesh is the same surface, old vertices in their places
    np.testing.assert_array_equal(mesh.vertices[: source.n_vertices], source.vertices)
    parent_normals = source.face_normals[aligned.parent_face]
    facing = np.einsum("fi,fi->f", mesh.face_normals, parent_normals)
    assert facing.min() > 1.0 - 1e-6
    shares = np.bincount(aligned.parent_face, mesh.face_areas, source.n_faces)
    np.testing.assert_allclose(shares, source.face_areas, rtol=1e-6, atol=1e-12 * source.area)
    assert mesh.euler_characteristic == source.euler_characteristic

    # 2. features: boundaries all, creases on both halfedges, one edge a face, no bridges
    assert feature[~inner].all()
    np.testing.assert_array_equal(feature[mesh.twin[inner]], feature[inner])
    assert feature.reshape(-1, 3).sum(axis=1).max() <= 1
    special = np.zeros(mesh.n_vertices, dtype=bool)
    special[mesh.tail[on]] = special[mesh.head[on]] = True
    assert not (special[mesh.tail[h]] & special[mesh.head[h]]).any()

    # 3. singular sectors are never neighbours, and none is too narrow
    singular = aligned.sector_quads != flat_quads(aligned)
    assert not (singular[s[h]] & singular[s[next_halfedge(h)]]).any()
    assert (aligned.sector_quads >= 1).all()
    around = np.bincount(aligned.sector_vertex, aligned.sector_quads, mesh.n_vertices)
    assert (around[~mesh.is_boundary_vertex & (mesh.outgoing >= 0)] >= 3).all()
    angle = np.bincount(s, mesh.corner_angles.reshape(-1))
    widest = (angle / aligned.sector_quads)[aligned.sector_is_feature]
    assert widest.max(initial=0.0) < np.radians(150.1)

    # 4. the index theorem on the mesh cut open along its creases
    cut_edges = mesh.n_edges + int((feature & inner).sum()) // 2
    chi = len(aligned.sector_quads) - cut_edges + mesh.n_faces
    assert int((flat_quads(aligned) - aligned.sector_quads).sum()) == 4 * chi

    # 5. rotations are antisymmetric and, with the axes, turn by sector_quads around each sector
    rotation, axis = aligned.rotation, aligned.axis
    assert ((rotation[h] + rotation[mesh.twin[h]]) % 4 == 0).all()
    assert (rotation[~inner] == 0).all()
    np.testing.assert_array_equal(axis >= 0, feature)
    np.testing.assert_array_equal(aligned.sector_vertex[s], mesh.tail)
    turn = np.zeros(len(aligned.sector_quads), dtype=np.int64)
    np.add.at(turn, s[next_halfedge(h)], -rotation[h])
    np.add.at(turn, s[on], -axis[on])
    np.add.at(turn, s[next_halfedge(on)], axis[on] + 2)
    assert ((turn - aligned.sector_quads) % 4 == 0).all()
    flags = np.zeros(len(turn), dtype=bool)
    flags[s[on]] = flags[s[next_halfedge(on)]] = True
    np.testing.assert_array_equal(flags, aligned.sector_is_feature)

"""PolygonMesh: twins, counts, and the midpoint split."""

from __future__ import annotations

import numpy as np
import pytest

from tests.meshes import EVERY, Case
from tests.quad_meshes import quad_grid
from vhquad.errors import MeshError
from vhquad.mesh.triangle import TriMesh
from vhquad.quad.ragged import PolygonMesh, midpoint_split


def polygons_of(mesh: TriMesh) -> PolygonMesh:
    return PolygonMesh.from_lists(mesh.vertices, mesh.faces.tolist())


def test_pentagon_by_hand() -> None:
    angle = 2 * np.pi * np.arange(5) / 5
    v = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    mesh = PolygonMesh.from_lists(v, [[0, 1, 2, 3, 4]])
    assert mesh.next.tolist() == [1, 2, 3, 4, 0]
    assert mesh.twin.tolist() == [-1] * 5
    split = midpoint_split(mesh)
    # 5 corners, 5 edges, 1 centre; 5 quads of a disk.
    assert split.vertices.shape == (11, 3)
    assert split.n_polygons == 5
    assert split.euler_characteristic == 1
    assert np.abs(split.vertices[10]).max() < 1e-15
    assert np.allclose(split.vertices[5], 0.5 * (v[0] + v[1]))
    # Quad 0 is corner, middle of the side ahead, centre, middle of the side behind.
    assert split.corners[:4].tolist() == [0, 5, 10, 9]


@pytest.mark.parametrize("case", EVERY, ids=str)
def test_split_keeps_topology(case: Case) -> None:
    mesh = polygons_of(case.mesh)
    assert np.array_equal(mesh.twin, case.mesh.twin)
    assert mesh.euler_characteristic == case.euler
    twice = midpoint_split(midpoint_split(mesh))
    quads = twice.quads()
    assert quads.n_quads == 12 * case.mesh.n_faces
    assert quads.is_manifold
    assert quads.euler_characteristic == case.euler
    assert quads.n_boundary_loops == case.loops
    assert quads.n_components == case.components
    # The twins it made itself are those of the vertex pairs.
    assert np.array_equal(quads.twin, twice.twin)


def test_edges_between_the_same_vertices_stay_apart() -> None:
    """One square bent to a tube, and to a torus: its edges are told apart by their twins."""
    start = np.array([0, 4])
    v = np.array([[0, 0, 0], [0, 0, 1.0]])
    tube = PolygonMesh(v, np.array([0, 0, 1, 1]), start, np.array([-1, 3, -1, 1]))
    torus = PolygonMesh(v[:1], np.zeros(4, dtype=np.int64), start, np.array([2, 3, 0, 1]))
    assert (tube.n_edges, torus.n_edges) == (3, 2)
    # The first split still has both halves of a loop between the same vertices.
    for mesh, loops in ((tube, 2), (torus, 0)):
        quads = midpoint_split(midpoint_split(mesh)).quads()
        assert quads.is_manifold
        assert quads.euler_characteristic == 0
        assert quads.n_boundary_loops == loops


def test_ambiguous_edges_and_other_polygons_are_refused() -> None:
    with pytest.raises(MeshError, match="twins"):
        PolygonMesh.from_lists(np.eye(3), [[0, 1, 2], [0, 1, 2]])
    with pytest.raises(MeshError, match="no quads"):
        PolygonMesh.from_lists(np.eye(3), [[0, 1, 2]]).quads()
    v, q = quad_grid(2, 2)
    assert PolygonMesh.from_lists(v, q.tolist()).quads().n_quads == 4

"""Planes refined for a map: the same surface, no long edge and no sliver left in them."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from tests import exports, meshes
from vhquad.field.baseline import curvature_field
from vhquad.field.cross import CrossField
from vhquad.field.features import find_creases
from vhquad.mesh.closest import ClosestPoints
from vhquad.mesh.triangle import TriMesh
from vhquad.quad.counts import stand_in_quads
from vhquad.quad.pipeline import RemeshSettings
from vhquad.quad.refined_planes import LONGEST, refine_planes
from vhquad.quad.remeshing import remesh_predicted

BLOCK = exports.bored_block(24, 8.0, 4.0)
SHAPES = {
    "cube": meshes.cube(1),
    "block": BLOCK,
    "square": meshes.grid(1, 1, 5.0, 3.0),
    "two": meshes.merge(BLOCK, meshes.moved(meshes.cube(1), (40.0, 0.0, 0.0), 12.0)),
}


def refined(mesh: TriMesh, n_quads: int) -> TriMesh:
    found = refine_planes(mesh, n_quads)
    assert found is not None
    assert found.original is mesh
    assert found.creases is None
    return found.mesh


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("n_quads", [100, 2000])
def test_the_surface_stays(name: str, n_quads: int) -> None:
    """1. Area, topology, old vertices; new faces lie on old ones and face the same way."""
    mesh = SHAPES[name]
    copy = refined(mesh, n_quads)
    assert copy.area == pytest.approx(mesh.area, rel=1e-12)
    assert copy.euler_characteristic == mesh.euler_characteristic
    assert copy.n_components == mesh.n_components
    assert len(copy.boundary_loops) == len(mesh.boundary_loops)
    assert copy.has_manifold_vertices
    np.testing.assert_array_equal(copy.vertices[: mesh.n_vertices], mesh.vertices)
    middle = copy.vertices[copy.faces].mean(axis=1)
    hits = ClosestPoints(mesh).query(middle)
    assert np.linalg.norm(hits.point - middle, axis=1).max() < 1e-12 * mesh.diagonal
    facing = np.einsum("fi,fi->f", mesh.face_normals[hits.face], copy.face_normals)
    assert facing.min() > 1 - 1e-9


@pytest.mark.parametrize("name", SHAPES)
def test_triangles_suit_a_map(name: str) -> None:
    """2. No longer than two quads, and all but a few near borders are shapely."""
    mesh = SHAPES[name]
    copy = refined(mesh, 2000)
    longest = LONGEST * np.sqrt(mesh.area / stand_in_quads(2000))
    assert copy.edge_lengths.max() <= longest
    assert copy.edge_lengths.max() > 0.5 * longest
    assert np.degrees(np.quantile(copy.corner_angles.min(axis=1), 0.1)) > 15


def test_creases_go_on() -> None:
    """3. Those of the copy are those of the mesh; given ones are carried, piece by piece."""
    copy = refined(BLOCK, 2000)
    own, given = find_creases(copy, 40.0), find_creases(BLOCK, 40.0)
    assert length(copy, own) == pytest.approx(length(BLOCK, given), rel=1e-9)
    within = BLOCK.edges[np.abs(BLOCK.dihedral_angles[BLOCK.edge_halfedges[:, 0]]) < 1e-9][:5]
    found = refine_planes(BLOCK, 2000, within)
    assert found is not None
    assert found.creases is not None
    assert len(found.creases) > 2 * len(within)
    assert length(found.mesh, found.creases) == pytest.approx(length(BLOCK, within), rel=1e-12)


def length(mesh: TriMesh, pairs: NDArray[np.int64]) -> float:
    return float(np.linalg.norm(np.diff(mesh.vertices[pairs], axis=1), axis=2).sum())


@pytest.mark.parametrize(
    "mesh", [meshes.icosphere(1), meshes.cube(20), meshes.blob(2), meshes.grid(30, 20)]
)
def test_others_are_left_alone(mesh: TriMesh) -> None:
    """4. Curved surfaces, however coarse, and planes in small triangles."""
    assert refine_planes(mesh, 500) is None


def test_quads_of_an_export() -> None:
    """5. A block of few triangles: quads along its creases, squarer than without the copy."""
    said: list[tuple[int, TriMesh | None]] = []

    def field(mesh: TriMesh, of: TriMesh | None) -> CrossField:
        said.append((mesh.n_faces, of))
        return curvature_field(mesh)

    settings = RemeshSettings(target_quads=1000)
    made = remesh_predicted(BLOCK, field, settings, cache=False)
    plain = remesh_predicted(BLOCK, field, settings, stand_in=False, cache=False).result.report
    report = made.result.report
    assert said == [(made.mesh.n_faces, None), (BLOCK.n_faces, None)]
    assert report.stand_in == made.mesh.n_faces > 4 * BLOCK.n_faces
    assert report.input == plain.input
    assert plain.stand_in is None
    assert report.fallbacks == ()
    assert report.quality.folded_quads == 0
    assert report.quality.scaled_jacobian_mean > max(0.97, plain.quality.scaled_jacobian_mean)
    edges = BLOCK.vertices[find_creases(BLOCK, 40.0)]
    share = np.linspace(0, 1, 20)[:, None, None]
    points = ((1 - share) * edges[:, 0] + share * edges[:, 1]).reshape(-1, 3)
    quads = made.result.quads
    ends = quads.vertices[quads.edges]
    along = ends[:, None, 0] + np.linspace(0, 1, 40)[:, None] * (ends[:, 1] - ends[:, 0])[:, None]
    off = cKDTree(along.reshape(-1, 3)).query(points)[0]
    assert off.mean() < 2e-3 * BLOCK.diagonal

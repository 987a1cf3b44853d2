"""Curved surfaces refined for a map: short edges, smooth shape, creases and borders kept."""

from __future__ import annotations

import numpy as np
import pytest

from tests import meshes
from vhquad.field.cross import CrossField
from vhquad.field.features import find_creases
from vhquad.field.refine import lengths_of_edges
from vhquad.geometry.frames import from_3d, vertex_axes
from vhquad.mesh.closest import ClosestPoints
from vhquad.mesh.triangle import TriMesh
from vhquad.quad import refined_curves
from vhquad.quad.pipeline import RemeshSettings
from vhquad.quad.refined_curves import LEAST, MOST, refine_curves
from vhquad.quad.remeshing import remesh_predicted
from vhquad.quad.sizing import WantedSizes


@pytest.fixture(autouse=True)
def small(monkeypatch: pytest.MonkeyPatch) -> None:
    """Meshes of these tests count as fine enough to have detail."""
    monkeypatch.setattr(refined_curves, "LEAST", 3)


def most(monkeypatch: pytest.MonkeyPatch, n_vertices: int) -> None:
    monkeypatch.setattr(refined_curves, "MOST", n_vertices)


def sure(mesh: TriMesh, confidence: float | np.ndarray = 1.0) -> CrossField:
    """A field on the faces that is so sure of itself."""
    ones = np.ones(mesh.n_faces)
    return CrossField("faces", ones, None, confidence * ones)


def even(mesh: TriMesh, quads: float) -> WantedSizes:
    """So many quads, all of one size."""
    return WantedSizes(np.ones(mesh.n_faces), float(np.sqrt(mesh.area / quads)), round(quads))


def refined(mesh: TriMesh, quads: float, angle: float | None = 40.0) -> TriMesh | None:
    """Where everything is sure and of one size."""
    found = refine_curves(mesh, even(mesh, quads), sure(mesh), angle=angle)
    return None if found is None else found.mesh


@pytest.mark.parametrize("case", meshes.EVERY, ids=str)
def test_topology_and_vertices_stay(case: meshes.Case, monkeypatch: pytest.MonkeyPatch) -> None:
    mesh = case.mesh
    most(monkeypatch, 3 * mesh.n_vertices)
    copy = refined(mesh, 2.0 * mesh.n_faces)
    assert copy is not None
    assert copy.n_components == mesh.n_components
    assert copy.euler_characteristic == mesh.euler_characteristic
    assert len(copy.boundary_loops) == len(mesh.boundary_loops)
    assert copy.has_manifold_vertices
    np.testing.assert_array_equal(copy.face_component[: mesh.n_faces], mesh.face_component)
    np.testing.assert_allclose(copy.vertices[: mesh.n_vertices], mesh.vertices, atol=1e-12)


def test_a_ball_is_round_and_its_triangles_alike(monkeypatch: pytest.MonkeyPatch) -> None:
    mesh = meshes.icosphere(2)
    most(monkeypatch, 2562)  # as the sphere of two more subdivisions
    copy = refined(mesh, 2000)
    assert copy is not None
    longest, mean = lengths_of_edges(copy).max(), lengths_of_edges(meshes.icosphere(4)).mean()
    assert mean < longest < 2.0 * mean  # a round of bisections apart, at most
    # Flat triangles lack 3 % of the area, these a tenth of that.
    assert abs(copy.area - 4 * np.pi) < 0.1 * abs(mesh.area - 4 * np.pi)
    facing = np.einsum("fi,fi->f", copy.face_normals, copy.vertices[copy.faces].mean(axis=1))
    assert facing.min() > 0.95


def test_triangles_are_small_where_quads_are(monkeypatch: pytest.MonkeyPatch) -> None:
    mesh = meshes.icosphere(3)
    most(monkeypatch, 4000)
    z = mesh.vertices[mesh.faces].mean(axis=1)[:, 2]
    length = np.where(z > 0.0, 0.02, 0.08)
    wanted = WantedSizes(length, 1.0, round((mesh.face_areas / length**2).sum()))
    found = refine_curves(mesh, wanted, sure(mesh))
    assert found is not None
    place = found.mesh.vertices[found.mesh.edges].mean(axis=1)[:, 2]
    edges = lengths_of_edges(found.mesh)
    assert edges[place > 0.2].mean() < 0.6 * edges[place < -0.2].mean()


@pytest.mark.parametrize("mesh", [meshes.icosphere(3), meshes.cube(6)], ids=["ball", "cube"])
def test_one_copy_serves_all_numbers_of_quads(mesh: TriMesh) -> None:
    one, two = refined(mesh, 1000), refined(mesh, 4000)
    assert one is not None
    assert two is not None
    np.testing.assert_array_equal(one.vertices, two.vertices)
    np.testing.assert_array_equal(one.faces, two.faces)


def test_only_parts_of_which_the_field_is_sure() -> None:
    mesh = meshes.merge(
        meshes.icosphere(2), meshes.moved(meshes.icosphere(2), (5.0, 0.0, 0.0), 2.0)
    )
    wanted = even(mesh, 2.0 * mesh.n_faces)
    known = (mesh.face_component == 1).astype(np.float64)
    assert refine_curves(mesh, wanted, sure(mesh, 0.0)) is None
    found = refine_curves(mesh, wanted, sure(mesh, known))
    assert found is not None
    copy = found.mesh
    assert copy.n_vertices == MOST
    count, was = np.bincount(copy.face_component), np.bincount(mesh.face_component)
    assert count[0] == was[0]
    assert count[1] > 2 * was[1]
    known[np.flatnonzero(known)[::3]] = 0.0  # two thirds are not enough
    assert refine_curves(mesh, wanted, sure(mesh, known)) is None


def test_where_it_is_not_worth_while_there_is_no_copy(monkeypatch: pytest.MonkeyPatch) -> None:
    assert refined(meshes.icosphere(4), 500) is None  # triangles are fine
    assert refined(meshes.icosphere(3), 50_000) is not None
    assert refined(meshes.icosphere(5), 500_000) is None  # 10,242 vertices: hardly fewer than it
    monkeypatch.setattr(refined_curves, "LEAST", LEAST)
    assert refined(meshes.icosphere(3), 50_000) is None  # no detail


def test_creases_stay(monkeypatch: pytest.MonkeyPatch) -> None:
    """A cube with sharp edges stays one; given edges are carried, all of their length."""
    mesh = meshes.cube(3)
    most(monkeypatch, 1000)
    copy = refined(mesh, 1000)
    assert copy is not None
    assert np.abs(np.abs(copy.vertices).max(axis=1) - 0.5).max() < 1e-12
    assert copy.area == pytest.approx(mesh.area, rel=1e-12)
    pairs = find_creases(mesh, 40.0)
    found = refine_curves(mesh, even(mesh, 1000), sure(mesh), pairs)
    assert found is not None
    assert found.creases is not None
    assert len(found.creases) > 2 * len(pairs)
    ends = found.mesh.vertices[found.creases]
    assert np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).sum() == pytest.approx(12.0)


def test_a_triangle_that_is_a_line(monkeypatch: pytest.MonkeyPatch) -> None:
    most(monkeypatch, 500)
    flat = meshes.grid(4, 3)
    ends = [[0.0, 0.0, 0.0], [0.25, 0.0, 0.0]]
    first, second = (int(np.abs(flat.vertices - end).sum(axis=1).argmin()) for end in ends)
    v = np.concatenate([flat.vertices, [[0.125, 0.0, 0.0]]])
    mesh = TriMesh(v, np.concatenate([flat.faces, [[second, first, len(v) - 1]]]))
    assert mesh.face_areas.min() == 0.0
    copy = refined(mesh, 500)
    assert copy is not None
    assert copy.area == pytest.approx(flat.area, rel=1e-9)
    assert np.abs(copy.vertices[:, 2]).max() == 0.0


def test_quads_follow_a_field_better_on_a_finer_copy() -> None:
    """A coarse torus, circles told by a field that is sure: quads run along them, on the mesh."""
    mesh = skewed_torus()
    said: list[int] = []

    def field(surface: TriMesh, of: TriMesh | None) -> CrossField:
        said.append(surface.n_vertices)
        assert of is None
        return circles(surface)

    settings = RemeshSettings(target_quads=2500, crease=None)
    made = remesh_predicted(mesh, field, settings, cache=False)
    assert said == [mesh.n_vertices, made.mesh.n_vertices]
    assert made.mesh.n_vertices > 4 * mesh.n_vertices
    plain = remesh_predicted(mesh, field, settings, stand_in=False, cache=False).result
    report, quads = made.result.report, made.result.quads
    assert report.stand_in == made.mesh.n_faces
    assert report.input == plain.report.input
    assert report.settings == plain.report.settings
    assert report.quality.folded_quads == 0
    assert abs(quads.n_quads - 2500) < 100
    # The quads lie on the given triangles, not on the copy.
    surface = ClosestPoints(mesh)
    assert surface.distance(quads.vertices).max() < 1e-6 * mesh.diagonal
    finer = off_the_circles(quads.vertices[quads.edges])
    coarse = off_the_circles(plain.quads.vertices[plain.quads.edges])
    assert finer < 0.75 * coarse


def skewed_torus() -> TriMesh:
    """Of 24 by 12 vertices, parallels turned against each other: no two triangles in a plane."""
    mesh = meshes.torus(24, 12, 1.0, 0.4)
    x, y, z = mesh.vertices.T
    turn = np.exp(0.3j * z / 0.4) * (x + 1j * y)
    return TriMesh(np.stack([turn.real, turn.imag, z], axis=1), mesh.faces)


def circles(mesh: TriMesh) -> CrossField:
    """Along the meridians and parallels of a torus about the z axis."""
    x, y, _ = mesh.vertices.T
    around = np.stack([-y, x, np.zeros_like(x)], axis=1)
    u = from_3d(around / np.linalg.norm(around, axis=1, keepdims=True), vertex_axes(mesh))
    return CrossField("vertices", u**4, None, np.ones(mesh.n_vertices))


def off_the_circles(ends: np.ndarray) -> float:
    """Mean angle of edges to the nearer of the two families of circles, degrees."""
    middle, side = ends.mean(axis=1), ends[:, 1] - ends[:, 0]
    x, y, _ = middle.T
    around = np.stack([-y, x, np.zeros_like(x)], axis=1)
    around /= np.linalg.norm(around, axis=1, keepdims=True)
    share = np.abs(np.einsum("ei,ei->e", side, around)) / np.linalg.norm(side, axis=1)
    angle = np.degrees(np.arccos(np.clip(share, 0.0, 1.0)))
    return float(np.minimum(angle, 90.0 - angle).mean())

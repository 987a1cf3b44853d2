"""Stand-ins: the same topology, borders and creases edge for edge, no triangle out of size."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests import meshes
from vhquad import api
from vhquad.field.cross import CrossField
from vhquad.field.features import find_creases
from vhquad.geometry.frames import face_axes, from_3d
from vhquad.mesh.closest import ClosestPoints
from vhquad.mesh.triangle import TriMesh
from vhquad.quad import place, stand_in
from vhquad.quad.pipeline import RemeshSettings
from vhquad.quad.remeshing import remesh_predicted
from vhquad.quad.stand_in import StandIn, make_stand_in
from vhquad.watch import Watch


@pytest.fixture(autouse=True)
def _small(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(stand_in, "FEWEST_FACES", 3000)
    monkeypatch.setenv("VHQUAD_CACHE", str(tmp_path))


def made(mesh: TriMesh, n_quads: int = 200, angle: float | None = 40.0) -> StandIn:
    found = make_stand_in(mesh, n_quads, angle=angle)
    assert found is not None
    assert found.mesh.n_faces < 0.5 * mesh.n_faces
    return found


def border(mesh: TriMesh) -> set[tuple[bytes, bytes]]:
    """Boundary edges as pairs of positions, to the bit."""
    h = np.flatnonzero(mesh.twin < 0)
    ends = zip(mesh.vertices[mesh.tail[h]], mesh.vertices[mesh.head[h]], strict=True)
    return {(a.tobytes(), b.tobytes()) for a, b in ends}


def test_a_ball_keeps_topology_and_place() -> None:
    ball = meshes.icosphere(6)
    copy = made(ball).mesh
    assert copy.n_faces == pytest.approx(3000, rel=0.1)
    assert copy.has_manifold_vertices
    assert copy.euler_characteristic == 2
    assert ClosestPoints(ball).distance(copy.vertices).max() < 1e-3
    assert np.median(copy.corner_angles.min(axis=1)) > np.radians(35)


@pytest.mark.parametrize("genus", [1, 3])
def test_handles_and_borders_are_kept_to_the_bit(genus: int) -> None:
    mesh = meshes.grid(90, 70) if genus == 1 else meshes.plate_with_holes(genus, 14)
    copy = made(mesh, 100).mesh
    assert copy.euler_characteristic == mesh.euler_characteristic
    assert len(copy.boundary_loops) == len(mesh.boundary_loops)
    assert border(copy) == border(mesh)


def test_flat_parts_have_no_giant_triangles() -> None:
    sheet = meshes.grid(100, 80)
    copy = made(sheet, 400).mesh
    quad = np.sqrt(sheet.area / 400)
    assert copy.edge_lengths.max() < 3.0 * quad
    assert copy.area == pytest.approx(sheet.area, rel=1e-9)


def test_creases_are_kept_edge_for_edge() -> None:
    cube = meshes.cube(40)
    found = made(cube, 300)
    ends = found.mesh.vertices[found.creases]
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    assert length.sum() == pytest.approx(12.0, rel=1e-9)
    pairs = {tuple(sorted(pair)) for pair in found.creases.tolist()}
    assert pairs <= set(map(tuple, found.mesh.edges.tolist()))
    assert found.mesh.area == pytest.approx(cube.area, rel=1e-9)


def test_given_creases_take_the_place_of_found_ones() -> None:
    cube = meshes.cube(40)
    edge = cube.edges[:1]
    found = make_stand_in(cube, 300, edge, 40.0)
    assert found is not None
    assert np.isin(np.arange(found.mesh.n_vertices), found.mesh.faces).all()
    there = found.mesh.vertices[found.creases]
    assert np.array_equal(np.sort(there, axis=1), np.sort(cube.vertices[edge], axis=1))


def test_components_keep_their_order() -> None:
    both = meshes.merge(meshes.moved(meshes.icosphere(5), (5, 0, 0), 0.5), meshes.icosphere(6))
    copy = made(both).mesh
    assert copy.n_components == 2
    first, _ = copy.submesh(copy.face_component == 0)
    assert first.vertices[:, 0].min() > 4.0


def test_coarse_meshes_serve_themselves() -> None:
    assert make_stand_in(meshes.icosphere(4), 200, angle=40.0) is None
    assert make_stand_in(meshes.icosphere(6), 8000, angle=40.0) is None


def test_kept_ones_serve_other_counts_and_are_never_trusted_if_damaged(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    cube = meshes.cube(40)
    first = make_stand_in(cube, 300, angle=40.0, cache=True)
    assert first is not None
    (entry,) = tmp_path.glob("stand-in-*.npz")
    whole = entry.read_bytes()

    def never(*args: object) -> None:
        raise AssertionError("made again")

    with monkeypatch.context() as patch:
        patch.setattr(stand_in, "thin_out", never)
        second = make_stand_in(cube, 250, angle=40.0, cache=True)
        assert second is not None
        assert np.array_equal(first.mesh.vertices, second.mesh.vertices)
        assert np.array_equal(first.creases, second.creases)
        with pytest.raises(AssertionError, match="made again"):
            make_stand_in(cube, 250, angle=50.0, cache=True)
    for damaged in (whole[: len(whole) // 2], b"", whole[:1000] + b"x" * 64 + whole[1064:]):
        entry.write_bytes(damaged)
        again = make_stand_in(cube, 300, angle=40.0, cache=True)
        assert again is not None
        assert np.array_equal(first.mesh.faces, again.mesh.faces)
        assert entry.read_bytes() == whole


def test_values_are_carried() -> None:
    ball = meshes.icosphere(6)
    found = made(ball)
    carried = found.carry(ball.vertices[:, 2])
    assert np.abs(carried - found.mesh.vertices[:, 2]).max() < 0.02


# ---- remeshing on a stand-in -----------------------------------------------------------------


def test_quads_lie_on_the_original_and_end_at_its_border() -> None:
    mesh = meshes.half_sphere(6)
    result = api.remesh(mesh.vertices, mesh.faces, target_quads=300, method="curvature")
    assert result.report.stand_in is not None
    assert result.report.input.faces == mesh.n_faces
    assert result.report.topology_kept
    assert result.report.made == pytest.approx(300, rel=0.1)
    assert np.abs(np.linalg.norm(result.quads.vertices, axis=1) - 1).max() < 1e-3
    at = result.quads.vertices[result.quads.is_boundary_vertex]
    h = np.flatnonzero(mesh.twin < 0)
    rim = np.stack([mesh.vertices[mesh.tail[h]], mesh.vertices[mesh.head[h]]], axis=1)
    along = rim[:, 1] - rim[:, 0]
    t = np.einsum("qri,ri->qr", at[:, None] - rim[:, 0], along) / (along**2).sum(axis=1)
    gap = at[:, None] - rim[:, 0] - t.clip(0, 1)[:, :, None] * along
    assert np.linalg.norm(gap, axis=2).min(axis=1).max() < 1e-9


@pytest.mark.parametrize("why", ["full", "symmetry", "map"])
def test_no_stand_in_where_the_mesh_itself_is_wanted(
    why: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    mesh = meshes.icosphere(4)
    monkeypatch.setattr(stand_in, "FEWEST_FACES", 1000)
    made = remesh_predicted(
        mesh,
        lambda surface, of: api.predict(surface, method="curvature"),
        RemeshSettings(target_quads=100, symmetry="x" if why == "symmetry" else "off"),
        stand_in=why != "full",
        with_uv=why == "map",
    )
    assert made.result.report.stand_in is None
    assert made.mesh is mesh


def test_what_cannot_be_mapped_on_a_stand_in_is_done_again(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    mesh = meshes.icosphere(4)
    monkeypatch.setattr(stand_in, "FEWEST_FACES", 1000)
    monkeypatch.setattr(place, "GUESSED_QUADS", 20)  # the field asks for far more
    asked = []

    def field_of(surface: TriMesh, of: TriMesh | None) -> CrossField:
        asked.append((surface is mesh, of is mesh))
        field = api.predict(surface, method="curvature")
        return type(field)(field.domain, field.z, np.full(len(field), 0.2), field.confidence)

    made = remesh_predicted(mesh, field_of, RemeshSettings())
    assert asked == [(False, True), (True, False)]
    assert made.mesh is mesh
    assert made.result.report.stand_in is None


@pytest.mark.parametrize("sure", [False, True])
def test_creases_found_give_way_on_a_stand_in_too(
    monkeypatch: pytest.MonkeyPatch, sure: bool
) -> None:
    mesh = meshes.folded_sheet()
    monkeypatch.setattr(stand_in, "FEWEST_FACES", 600)

    def field_of(copy: TriMesh, of: TriMesh | None) -> CrossField:
        assert of is mesh
        n = copy.n_faces  # across the fold at an angle
        axes = face_axes(copy)
        slanted = np.full((n, 3), [0.0, 1.0, 0.5]) + np.array([0.5, 0.0, 0.0])
        z = from_3d(slanted, axes) ** 4
        return CrossField("faces", z / np.abs(z), None, np.full(n, float(sure)))

    itself = place.Place(mesh, None, None)
    settings = RemeshSettings(target_quads=100)
    chosen = place.choose_place(itself, field_of, settings, True, False, Watch())
    assert chosen.place.onto is mesh
    assert chosen.place.creases is not None
    assert (len(chosen.place.creases) == 0) == sure
    given = place.Place(mesh, find_creases(mesh), None)
    chosen = place.choose_place(given, field_of, settings, True, False, Watch())
    assert chosen.place.creases is not None
    assert len(chosen.place.creases) > 0

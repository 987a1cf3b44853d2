"""Repair: sound meshes stay as they are, broken ones become sound, nothing is lost."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests import meshes, soups
from tests.meshes import EVERY, Case, voxels
from tests.soups import SOUPS
from vhquad.errors import MeshError
from vhquad.mesh.degenerate import is_degenerate
from vhquad.mesh.repair import RepairResult, repair
from vhquad.mesh.triangle import TriMesh


def assert_sound(result: RepairResult) -> None:
    """Everything that repair promises, and that a second repair has nothing to do."""
    m, r = result.mesh, result.report
    assert m.twin.size == 3 * m.n_faces
    assert m.has_manifold_vertices
    assert m.is_used_vertex.all()
    assert not is_degenerate(m.vertices[m.faces])[0].any()
    assert (r.vertices_out, r.faces_out, r.components) == (m.n_vertices, m.n_faces, m.n_components)
    assert result.vertex_source.shape == (m.n_vertices,)
    assert result.face_source.shape == (m.n_faces,)
    assert (np.diff(result.face_source) >= 0).all()
    again = repair(m.vertices, m.faces)
    assert again.report.lines() == []
    assert not again.report.changed
    np.testing.assert_array_equal(again.mesh.faces, m.faces)
    np.testing.assert_array_equal(again.mesh.vertices, m.vertices)


def volume(mesh: TriMesh) -> float:
    p = mesh.vertices[mesh.faces]
    return float(np.einsum("mi,mi->", p[:, 0], np.cross(p[:, 1], p[:, 2])) / 6.0)


def same_shape(a: TriMesh, b: TriMesh) -> bool:
    return (
        a.euler_characteristic == b.euler_characteristic
        and len(a.boundary_loops) == len(b.boundary_loops)
        and a.n_components == b.n_components
        and bool(np.isclose(a.area, b.area))
    )


# ---- sound meshes -----------------------------------------------------------------------------


@pytest.mark.parametrize("case", EVERY, ids=str)
def test_a_sound_mesh_comes_back_as_it_was(case: Case) -> None:
    result = repair(case.mesh.vertices, case.mesh.faces)
    np.testing.assert_array_equal(result.mesh.vertices, case.mesh.vertices)
    np.testing.assert_array_equal(result.mesh.faces, case.mesh.faces)
    np.testing.assert_array_equal(result.vertex_source, np.arange(case.mesh.n_vertices))
    assert_sound(result)


@pytest.mark.parametrize("case", EVERY, ids=str)
def test_a_triangle_soup_in_any_order_is_put_together_again(
    case: Case, rng: np.random.Generator
) -> None:
    v, f = soups.unwelded(meshes.relabel(case.mesh, rng).mesh)
    f = f.copy()
    turned = rng.random(len(f)) < 0.4
    f[turned] = f[turned][:, ::-1]
    result = repair(v, f)
    assert same_shape(result.mesh, case.mesh)
    assert result.mesh.n_vertices == case.mesh.n_vertices
    assert result.report.welded_vertices == 3 * case.mesh.n_faces - case.mesh.n_vertices
    assert_sound(result)
    if case.loops == 0:
        assert volume(result.mesh) == pytest.approx(volume(case.mesh))


def test_scale_and_place_do_not_matter() -> None:
    v, f = soups.several_broken_parts()
    plain = repair(v, f)
    for factor in (1e-60, 1e-9, 1e12, 1e90):
        scaled = repair(v * factor, f)
        np.testing.assert_array_equal(scaled.mesh.faces, plain.mesh.faces)
        assert scaled.report == plain.report


# ---- one kind of trouble at a time -----------------------------------------------------------


@pytest.mark.parametrize("name", SOUPS)
def test_soups_become_sound(name: str) -> None:
    result = repair(*SOUPS[name]())
    assert result.report.changed
    assert len(result.report.lines()) >= 1
    assert_sound(result)


def test_counts_of_each_soup() -> None:
    def figures(name: str) -> tuple[dict[str, int], int, int, int]:
        result = repair(*SOUPS[name]())
        fixed = {"vertices_in", "faces_in", "vertices_out", "faces_out", "components"}
        counts = {k: v for k, v in result.report.to_dict().items() if v and k not in fixed}
        m = result.mesh
        return counts, m.euler_characteristic, len(m.boundary_loops), m.n_components

    assert figures("with_cap") == ({"degenerate_faces": 1, "cut_faces": 1}, 2, 0, 1)
    assert figures("with_needle") == ({"welded_vertices": 1, "degenerate_faces": 2}, 2, 0, 1)
    assert figures("with_duplicate_faces")[0] == {"duplicate_faces": 1, "folded_faces": 1}
    assert figures("bowtie") == ({"split_vertices": 1}, 4, 0, 2)
    assert figures("two_cubes_on_an_edge") == (
        {"nonmanifold_edges": 1, "split_vertices": 2},
        4,
        0,
        2,
    )
    assert figures("inside_out") == ({"turned_faces": 576}, 0, 0, 1)
    assert figures("mixed_winding") == ({"turned_faces": 27}, 2, 0, 1)
    assert figures("unused_vertices") == ({"unused_vertices": 3}, 1, 1, 1)
    # Two of three fins make one sheet, the third is a sheet of its own.
    assert figures("three_fins")[1:] == (2, 2, 2)
    # A Moebius strip cut once across is a plain strip.
    counts, *shape = figures("moebius")
    assert (counts["cut_edges"], counts["split_vertices"]) == (1, 2)
    assert shape == [1, 1, 1]


def test_maps_lead_back_to_the_input(rng: np.random.Generator) -> None:
    v, f = soups.several_broken_parts()
    result = repair(v, f)
    assert (result.vertex_source >= 0).all()
    np.testing.assert_array_equal(v[result.vertex_source], result.mesh.vertices)
    old = np.sort(v[f[result.face_source]], axis=1)
    new = np.sort(result.mesh.vertices[result.mesh.faces], axis=1)
    np.testing.assert_array_equal(old, new)


def test_two_sided_sheet_keeps_one_side() -> None:
    sheet = meshes.grid()
    double = np.vstack([sheet.faces, sheet.faces[:, ::-1]])
    result = repair(sheet.vertices, double)
    assert same_shape(result.mesh, sheet)
    assert result.report.folded_faces == sheet.n_faces
    # The same with vertices of its own for each side, as normals make them.
    apart = np.vstack([sheet.faces, sheet.faces[:, ::-1] + sheet.n_vertices])
    result = repair(np.vstack([sheet.vertices, sheet.vertices]), apart)
    assert same_shape(result.mesh, sheet)
    assert_sound(result)


def test_a_wall_between_two_rooms_goes() -> None:
    left = meshes.moved(meshes.cube(1), (-0.5, 0.0, 0.0))
    right = TriMesh(left.vertices * np.array([-1.0, 1.0, 1.0]), left.faces[:, ::-1])
    result = repair(*soups.unwelded(meshes.merge(left, right)))
    assert result.report.folded_faces == 4
    assert (result.mesh.n_vertices, result.mesh.euler_characteristic) == (12, 2)
    assert result.mesh.is_closed
    assert volume(result.mesh) == pytest.approx(2.0)
    assert result.mesh.area == pytest.approx(10.0)
    assert_sound(result)


def test_closed_parts_that_touch_stay_apart() -> None:
    a, b = meshes.cube(1), meshes.moved(meshes.cube(1), (1.0, 0.0, 0.0))
    result = repair(*_arrays(meshes.merge(a, b)))
    assert not result.report.changed
    assert result.mesh.n_components == 2


def test_a_copy_of_a_closed_part_goes() -> None:
    a = meshes.icosphere(1)
    for other in (a, TriMesh(a.vertices, a.faces[:, ::-1])):
        result = repair(*_arrays(meshes.merge(a, other)))
        np.testing.assert_array_equal(result.mesh.faces, a.faces)
        assert result.report.duplicate_faces == a.n_faces


def test_a_flap_goes_and_a_fin_stays() -> None:
    sphere = meshes.icosphere(1)
    i, j = sphere.edges[0]
    top = 2 * sphere.vertices[[i]]
    n = sphere.n_vertices
    flap = np.vstack([sphere.faces, [[i, j, n], [j, i, n]]])
    result = repair(np.vstack([sphere.vertices, top]), flap)
    assert same_shape(result.mesh, sphere)
    assert result.report.folded_faces == 2
    fin = repair(np.vstack([sphere.vertices, top]), flap[:-1])
    assert fin.mesh.n_components == 2
    assert fin.report.nonmanifold_edges == 1
    assert fin.mesh.submesh(fin.mesh.face_component == 0)[0].is_closed
    assert_sound(fin)


def test_cavities_and_eyeballs_keep_their_winding() -> None:
    outer, inner = meshes.icosphere(2), meshes.icosphere(1, 0.5)
    for faces in (inner.faces, inner.faces[:, ::-1]):
        both = meshes.merge(outer, TriMesh(inner.vertices, faces))
        assert not repair(*_arrays(both)).report.changed
    beside = meshes.merge(
        outer, meshes.moved(TriMesh(inner.vertices, inner.faces[:, ::-1]), (2, 0, 0))
    )
    assert repair(*_arrays(beside)).report.turned_faces == inner.n_faces


def test_open_parts_look_outward_when_nearly_closed() -> None:
    ball = meshes.icosphere(3)
    keep = ball.vertices[ball.faces].mean(axis=1)[:, 2] > -0.9
    pot = ball.submesh(keep)[0]
    result = repair(pot.vertices, pot.faces[:, ::-1])
    assert result.report.turned_faces == pot.n_faces
    # A bowl may be meant either way: it stays.
    bowl = meshes.half_sphere()
    assert not repair(bowl.vertices, bowl.faces[:, ::-1]).report.changed


def test_most_of_the_area_decides_for_a_flat_sheet() -> None:
    sheet = meshes.grid()
    f = sheet.faces.copy()
    f[:20] = f[:20, ::-1]
    result = repair(sheet.vertices, f)
    assert result.report.turned_faces == 20
    assert (result.mesh.face_normals[:, 2] > 0).all()


def test_an_edge_between_the_same_two_vertices_twice() -> None:
    v, f = soups.doubled_edge()
    result = repair(v, f)
    kept = np.sort(np.delete(f, [1, 2], axis=0), axis=1)
    _, count = np.unique(
        kept[:, [[0, 1], [0, 2], [1, 2]]].reshape(-1, 2), axis=0, return_counts=True
    )
    assert result.report.nonmanifold_edges == (count > 2).sum() == 4
    assert result.report.added_vertices == 1
    (new,) = np.flatnonzero(result.vertex_source < 0)
    # It lies in the middle of an old edge, and both halves of the face come from one face.
    middle = 0.5 * (v[:, None] + v[None])
    assert (np.abs(middle - result.mesh.vertices[new]).max(axis=2) < 1e-15).any()
    source = result.face_source[(result.mesh.faces == new).any(axis=1)]
    assert len(np.unique(source)) < len(source)
    assert result.report.folded_faces == 2
    assert result.mesh.area == pytest.approx(TriMesh(v, np.delete(f, [1, 2], axis=0)).area)


def test_nothing_with_area_is_lost_and_the_rest_is_reported() -> None:
    result = repair(*soups.several_broken_parts())
    assert result.report.lost_components == 1
    assert result.mesh.n_components == 4


@pytest.mark.parametrize(
    ("v", "f", "say"),
    [
        (np.zeros((3, 2)), [[0, 1, 2]], "shape"),
        (np.eye(3), np.zeros((0, 3), int), "no faces"),
        (np.eye(3), [[0, 1]], "shape"),
        (np.eye(3), [[0.0, 1.0, 2.0]], "integers"),
        (np.eye(3), [[0, 1, 2], [0, 1, 3]], "1 faces name vertices outside 0..2, the first is 1"),
        (np.array([[0, 0, 0], [np.nan, 0, 0], [0, 1, 0]]), [[0, 1, 2]], "vertex 1 of face 0"),
        (np.zeros((3, 3)), [[0, 1, 2]], "none of the 1 faces has any area"),
        (np.eye(3) * 1e200, [[0, 1, 2]], "rescale"),
        (np.eye(3) * 1e-200, [[0, 1, 2]], "rescale"),
    ],
)
def test_what_cannot_be_repaired(v: object, f: object, say: str) -> None:
    with pytest.raises(MeshError, match=say):
        repair(v, f)  # type: ignore[arg-type]


# ---- anything at all --------------------------------------------------------------------------


@given(
    st.integers(3, 10),
    st.lists(st.integers(0, 10**9), min_size=3, max_size=90),
    st.sampled_from([2, 3, 0]),
    st.booleans(),
    st.integers(0, 10**6),
)
def test_any_triangles_at_all(n: int, raw: list[int], lattice: int, split: bool, seed: int) -> None:
    rng = np.random.default_rng(seed)
    v = rng.integers(0, lattice, (n, 3)).astype(float) if lattice else rng.normal(size=(n, 3))
    f = np.array(raw[: len(raw) // 3 * 3]).reshape(-1, 3) % n
    if split:
        v, f = v[f].reshape(-1, 3), np.arange(f.size).reshape(-1, 3)
    try:
        result = repair(v, f)
    except MeshError as error:
        assert "area" in str(error)  # noqa: PT017
        return
    assert_sound(result)


@given(st.integers(0, 10**6), st.booleans(), st.booleans())
def test_any_voxels_stay_closed(seed: int, split: bool, turn: bool) -> None:
    rng = np.random.default_rng(seed)
    solid = rng.random((3, 3, 2)) < 0.5
    solid[0, 0, 0] = True
    v, f = _arrays(voxels(solid))
    area = 0.5 * len(f)
    if split:
        v, f = v[f].reshape(-1, 3), np.arange(f.size).reshape(-1, 3)
    if turn:
        f = np.where(rng.random(len(f))[:, None] < 0.3, f[:, ::-1], f)
    result = repair(v, f)
    assert result.mesh.is_closed
    assert result.mesh.area == pytest.approx(area)
    if not turn:
        assert volume(result.mesh) == pytest.approx(solid.sum())
    assert_sound(result)


@given(st.integers(0, 10**6), st.booleans())
def test_faces_without_area_leave_no_crack(seed: int, split: bool) -> None:
    rng = np.random.default_rng(seed)
    kinds = (meshes.cube(2), meshes.torus(8, 6), meshes.icosphere(1), meshes.grid(4, 4))
    m = kinds[rng.integers(4)]
    v, f = m.vertices.tolist(), m.faces.tolist()
    for _ in range(rng.integers(1, 16)):
        # A vertex anywhere on a side of a face, at its ends too, and a face without area there.
        i, k = rng.integers(len(f)), rng.integers(3)
        a, b, c = (f[i][(k + j) % 3] for j in range(3))
        w = rng.choice([0.0, 0.25, 1 / 3, 0.5, 1.0])
        v.append(((1 - w) * np.array(v[a]) + w * np.array(v[b])).tolist())
        f[i] = [a, len(v) - 1, c]
        f += [[len(v) - 1, b, c], [a, b, len(v) - 1]]
    points, faces = np.array(v), rng.permutation(np.array(f))
    if split:
        points, faces = points[faces].reshape(-1, 3), np.arange(faces.size).reshape(-1, 3)
    result = repair(points, faces)
    assert same_shape(result.mesh, m)
    assert result.report.degenerate_faces > 0
    assert_sound(result)


def _arrays(mesh: TriMesh) -> meshes.Soup:
    return mesh.vertices, mesh.faces

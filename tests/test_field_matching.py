"""Matchings and indices: integers always, their sum the Euler characteristic, known ones known."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.meshes import CLOSED, EVERY, OPEN, Case, cone, grid, icosphere, random_rigid, relabel
from vhquad.errors import FieldError
from vhquad.field.cross import CrossField
from vhquad.field.matching import MatchedField, match_field
from vhquad.field.singular import find_singularities
from vhquad.field.smooth import smoothest
from vhquad.geometry.frames import face_axes, from_3d
from vhquad.mesh.triangle import TriMesh

cases = st.sampled_from(EVERY)
seeds = st.integers(0, 2**32 - 1)


def matched(mesh: TriMesh, angle: np.ndarray) -> MatchedField:
    return match_field(mesh, angle, mesh.twin < 0, np.zeros(3 * mesh.n_faces))


def turning_field(mesh: TriMesh, quarters: int, phase: float = 0.1) -> CrossField:
    """In the plane: direction = quarters / 4 of the polar angle, an index of quarters / 4 at 0."""
    middle = mesh.vertices[mesh.faces].mean(axis=1)
    angle = quarters / 4.0 * np.arctan2(middle[:, 1], middle[:, 0]) + phase
    vectors = np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=1)
    return CrossField("faces", from_3d(vectors, face_axes(mesh)) ** 4)


@given(case=cases, seed=seeds)
def test_any_field_has_integer_indices_of_the_right_sum(case: Case, seed: int) -> None:
    mesh = case.mesh
    rng = np.random.default_rng(seed)
    field = matched(mesh, rng.uniform(-10, 10, mesh.n_faces))
    # 1. integers: only angles of the same face are ever subtracted
    assert np.abs(field.sector_turns - field.sector_quads).max() < 1e-9
    # 2. Poincare-Hopf, with the boundary's share
    flat = np.where(field.sector_is_feature, 2, 4)
    assert (flat - field.sector_quads).sum() == 4 * case.euler
    # 3. the least turn was taken, and both sides agree on it
    inner = np.flatnonzero(mesh.twin >= 0)
    assert np.abs(field.jump).max(initial=0.0) <= np.pi / 4 + 1e-12
    np.testing.assert_allclose(field.jump[inner], -field.jump[mesh.twin[inner]])
    assert ((field.rotation[inner] + field.rotation[mesh.twin[inner]]) % 4 == 0).all()


@given(case=cases, seed=seeds)
def test_the_choice_among_the_four_directions_does_not_matter(case: Case, seed: int) -> None:
    mesh = case.mesh
    rng = np.random.default_rng(seed)
    angle = rng.uniform(-1, 1, mesh.n_faces)
    quarters = rng.integers(-3, 4, mesh.n_faces)
    a, b = matched(mesh, angle), matched(mesh, angle + quarters * np.pi / 2)
    np.testing.assert_array_equal(a.sector_quads, b.sector_quads)
    # A chart turned by q sees its neighbours' matchings turned: z' = i^-q z.
    h = np.flatnonzero(mesh.twin >= 0)
    f, g = h // 3, mesh.twin[h] // 3
    expected = (a.rotation[h] - quarters[g] + quarters[f]) % 4
    np.testing.assert_array_equal(b.rotation[h], expected)


@given(quarters=st.integers(-6, 3), phase=st.floats(-1.0, 1.0))
def test_a_field_that_turns_around_a_vertex_has_that_index(quarters: int, phase: float) -> None:
    # 24 triangles meet at the tip of a flat cone: the angle between neighbours stays below 45.
    mesh = cone(24, 6, height=0.0)
    found = find_singularities(mesh, turning_field(mesh, quarters, phase))
    if quarters == 0:
        assert len(found) == 0
    else:
        assert found.vertex.tolist() == [mesh.n_vertices - 1]
        assert found.quarters.tolist() == [quarters]
        assert found.by_quads == {4 - quarters: 1}
    assert found.total + found.boundary_quarters / 4.0 == mesh.euler_characteristic


def test_a_constant_field_in_the_plane_by_hand() -> None:
    mesh = grid(4, 4, 1.0, 1.0)
    vectors = np.tile([1.0, 0.0, 0.0], (mesh.n_faces, 1))
    field = matched(mesh, np.angle(from_3d(vectors, face_axes(mesh))))
    # 1. nothing turns, and no edge jumps
    np.testing.assert_allclose(field.jump, 0.0, atol=1e-12)
    # 2. all charts agree with the plane, so no matching rotates
    assert not field.rotation.any()
    # 3. the boundary runs along +x, +y, -x, -y in turn: axes 0, 1, 2, 3, four of each
    axes = field.axis[field.feature]
    assert np.bincount(axes).tolist() == [4, 4, 4, 4]
    h = np.flatnonzero(field.feature)
    side = mesh.vertices[mesh.head[h]] - mesh.vertices[mesh.tail[h]]
    direction = np.array([[1, 0], [0, 1], [-1, 0], [0, -1]])[field.axis[h]]
    np.testing.assert_allclose(4 * side[:, :2], direction, atol=1e-12)
    # 4. one quad at each corner, two along the sides, four inside
    corner = (mesh.vertices[:, :2] % 1.0 == 0.0).all(axis=1)
    expected = np.where(corner, 1, np.where(mesh.is_boundary_vertex, 2, 4))
    np.testing.assert_array_equal(field.sector_quads, expected[field.sector_vertex])


@pytest.mark.parametrize(
    ("name", "total"), [("icosphere", 8), ("torus", 0), ("pretzel", -8), ("two_spheres", 16)]
)
def test_the_smoothest_field_of_known_surfaces(name: str, total: int) -> None:
    mesh = next(c.mesh for c in CLOSED if c.name == name)
    found = find_singularities(mesh, CrossField("faces", smoothest(mesh)))
    assert found.quarters.sum() == total
    assert found.total == total / 4.0 == found.euler_characteristic


def test_the_tip_of_a_cone_takes_the_index_its_angle_suggests() -> None:
    # Flat but for the tip: a field parallel elsewhere has index (2 pi - angle) / 2 pi there.
    for quads in (1, 2, 3):
        share = quads / 4.0  # of the full angle: height from share = r / sqrt(r^2 + h^2)
        mesh = cone(48, 6, height=np.sqrt(1 / share**2 - 1))
        # Along the rulings: parallel on the unrolled cone after a quarter of its turns.
        middle = mesh.vertices[mesh.faces].mean(axis=1)
        ruling = mesh.vertices[-1] - middle
        turn = -share * np.arctan2(middle[:, 1], middle[:, 0])
        u = from_3d(ruling, face_axes(mesh)) * np.exp(1j * turn)
        found = find_singularities(mesh, CrossField("faces", u**4))
        assert (
            dict(zip(found.vertex, found.quarters, strict=True))[mesh.n_vertices - 1] == 4 - quads
        )


@pytest.mark.parametrize("case", CLOSED[:4] + OPEN[:4], ids=str)
def test_indices_do_not_depend_on_numbers_or_place(case: Case) -> None:
    mesh = case.mesh
    rng = np.random.default_rng(3)
    vectors = rng.normal(size=(mesh.n_faces, 3))
    field = CrossField("faces", from_3d(vectors, face_axes(mesh)) ** 4)
    found = find_singularities(mesh, field)
    other, move = relabel(mesh, rng), random_rigid(rng)
    moved = TriMesh(move.points(other.mesh.vertices), other.mesh.faces)
    turned = np.zeros_like(vectors)
    turned[other.face] = move.vectors(vectors)
    again = find_singularities(moved, CrossField("faces", from_3d(turned, face_axes(moved)) ** 4))
    before = sorted(zip(other.vertex[found.vertex], found.quarters, strict=True))
    assert before == sorted(zip(again.vertex, again.quarters, strict=True))


def test_fields_of_other_meshes_are_refused() -> None:
    with pytest.raises(FieldError, match="80 faces"):
        find_singularities(icosphere(1), CrossField("faces", np.ones(3)))

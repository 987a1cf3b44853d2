"""Moving indices: pairs vanish, impossible vertices are cured, nothing else changes."""

from __future__ import annotations

import numpy as np
import pytest

from tests.field_checks import check_aligned
from tests.meshes import blob, cone, grid, icosphere, torus
from vhquad.field.align import AlignSettings, align_field
from vhquad.field.cancel import (
    absorb_at_features,
    cancel_pairs,
    cure_low_sectors,
    low_sectors,
)
from vhquad.field.cross import CrossField
from vhquad.field.indices import move_indices, relax
from vhquad.field.matching import MatchedField, match_field
from vhquad.field.smooth import smoothest
from vhquad.geometry.frames import face_axes, from_3d
from vhquad.mesh.triangle import TriMesh


def parallel(mesh: TriMesh) -> MatchedField:
    """The constant field along x of a flat mesh."""
    vectors = np.tile([1.0, 0.0, 0.0], (mesh.n_faces, 1))
    angle = np.angle(from_3d(vectors, face_axes(mesh)))
    return match_field(mesh, angle, mesh.twin < 0, np.zeros(3 * mesh.n_faces))


def sector_of(field: MatchedField, vertex: int) -> int:
    return int(np.flatnonzero(field.sector_vertex == vertex)[0])


def inner_path(field: MatchedField, length: int) -> np.ndarray:
    """Sectors of a straight row of inner vertices of grid(12, 9)."""
    return np.array([sector_of(field, (3 + k) * 10 + 4) for k in range(length + 1)])


def test_a_path_changes_its_two_ends_only() -> None:
    field = parallel(grid(12, 9))
    path = inner_path(field, 4)
    moved = move_indices(field, [path])
    change = moved.sector_quads - field.sector_quads
    assert change[path[0]] == 1
    assert change[path[-1]] == -1
    assert np.count_nonzero(change) == 2
    # The crosses stay; rotations change by a quarter on the path's four edges, from both sides.
    np.testing.assert_array_equal(moved.angle, field.angle)
    assert np.count_nonzero(moved.rotation != field.rotation) == 8


def test_relaxing_keeps_indices_and_features_and_lowers_the_jumps() -> None:
    field = parallel(grid(12, 9))
    moved = move_indices(field, [inner_path(field, 4)])
    calm = relax(moved, np.ones(field.mesh.n_faces, dtype=bool))
    np.testing.assert_array_equal(calm.sector_quads, moved.sector_quads)
    assert (calm.jump**2).sum() < 0.5 * (moved.jump**2).sum()
    assert np.abs(calm.jump).max() < np.pi / 2
    rim = moved.feature.reshape(-1, 3).any(axis=1)
    np.testing.assert_array_equal(calm.angle[rim], moved.angle[rim])
    # Jumps and angles still tell the same story.
    again = match_field(calm.mesh, calm.angle, calm.feature, calm.lean)
    turns = (again.jump - calm.jump) / (np.pi / 2)
    np.testing.assert_allclose(turns, np.rint(turns), atol=1e-9)


def test_a_pair_made_by_hand_is_cancelled_again() -> None:
    field = parallel(grid(12, 9))
    moved = move_indices(field, [inner_path(field, 3)])
    none = np.zeros(field.n_sectors, dtype=bool)
    apart = 3.0 / 12.0  # the spacing of the grid's columns is 1/12
    # 1. farther than the distance asked for: nothing happens
    same, count = cancel_pairs(moved, 0.99 * apart, none)
    assert count == 0
    assert same is moved
    # 2. near enough: the constant field is back, indices and crosses
    back, count = cancel_pairs(moved, 1.01 * apart, none)
    assert count == 1
    np.testing.assert_array_equal(back.sector_quads, field.sector_quads)
    np.testing.assert_allclose(back.angle, field.angle, atol=1e-6)
    # 3. unless the vertex is to be kept
    kept = none.copy()
    kept[inner_path(field, 3)[0]] = True
    assert cancel_pairs(moved, 1.01 * apart, kept)[1] == 0


def test_an_index_of_one_falls_apart_into_quarters() -> None:
    mesh = cone(24, 6, height=0.0)  # a flat disk with its hub in the middle
    middle = mesh.vertices[mesh.faces].mean(axis=1)
    angle = np.angle(from_3d(middle, face_axes(mesh)))
    field = match_field(mesh, angle, mesh.twin < 0, np.zeros(3 * mesh.n_faces))
    hub = sector_of(field, mesh.n_vertices - 1)
    assert field.sector_quads[hub] == 0
    cured, moved = cure_low_sectors(field, 0.4)
    assert moved == 3
    assert not low_sectors(cured).any()
    plain = ~cured.sector_is_feature
    assert np.bincount(cured.sector_quads[plain])[3] == 4
    assert cured.sector_quads.sum() == field.sector_quads.sum()


@pytest.mark.parametrize("strength", [0.5, 1.0])
def test_noisy_fields_lose_most_of_their_spurious_pairs(strength: float) -> None:
    for mesh, least in ((torus(48, 24), 0), (icosphere(4), 8)):
        rng = np.random.default_rng(11)
        if least:
            z = smoothest(mesh)
        else:
            about = np.cross([0.0, 0.0, 1.0], mesh.vertices[mesh.faces].mean(axis=1))
            z = CrossField("faces", from_3d(about, face_axes(mesh)) ** 4).z
        noisy = CrossField("faces", z * np.exp(1j * strength * rng.normal(size=len(z))))
        raw = align_field(mesh, noisy, None, AlignSettings(smoothing=0.0, cancel=0.0))
        aligned = align_field(mesh, noisy, None, AlignSettings(0.2))
        check_aligned(mesh, aligned)
        made = sum(aligned.report.singularities.values())
        if strength > 0.5:
            assert sum(raw.report.singularities.values()) > 20 + 4 * least
        assert made == least


def test_cancelling_is_reported_and_can_be_turned_off() -> None:
    mesh = blob(4)
    rng = np.random.default_rng(4)
    z = smoothest(mesh) * np.exp(2j * rng.normal(size=mesh.n_faces))
    off = align_field(mesh, CrossField("faces", z), None, AlignSettings(None, 0.1, 0.0))
    on = align_field(mesh, CrossField("faces", z), None, AlignSettings(None, 0.1, 1.0))
    check_aligned(mesh, on)
    # Each pair takes a quarter from two vertices.
    totals = [sum(n * abs(4 - q) for q, n in a.report.singularities.items()) for a in (off, on)]
    assert off.report.pairs_cancelled == 0
    assert on.report.pairs_cancelled > 100
    assert abs(totals[0] - totals[1] - 2 * on.report.pairs_cancelled) <= 2 * (
        on.report.indices_moved + off.report.indices_moved
    )


def test_a_singularity_beside_the_boundary_moves_on_to_it() -> None:
    mesh = grid(12, 9)
    field = parallel(mesh)
    # A valence-5 vertex one row inside the straight lower side, its partner far away.
    row_by_row = (61, 62, 63, 53, 43, 33, 34, 35, 36, 37)
    path = np.array([sector_of(field, v) for v in row_by_row])
    made = move_indices(field, [path])
    assert made.sector_quads[path[0]] == 5
    row = 0.75 / 9.0
    # 1. out of reach: stays
    assert absorb_at_features(made, 0.9 * row)[1] == 0
    # 2. in reach: the boundary vertex below has three quads, the inner one is flat
    moved, count = absorb_at_features(made, 1.1 * row)
    assert count == 1
    assert moved.sector_quads[path[0]] == 4
    assert moved.sector_quads[sector_of(field, 60)] == 3
    assert moved.sector_quads.sum() == made.sector_quads.sum()


def test_no_quad_gets_a_straight_corner_by_absorbing() -> None:
    field = parallel(grid(12, 9))
    # A valence-3 vertex beside a straight side would leave one quad for 180 degrees there.
    path = np.array([sector_of(field, v) for v in (61, 62, 63, 64, 65, 66)])
    made = move_indices(field, [path[::-1]])
    assert made.sector_quads[path[0]] == 3
    assert absorb_at_features(made, 0.09)[1] == 0


def test_near_is_near_in_quads_of_the_place() -> None:
    field = parallel(grid(12, 9))
    moved = move_indices(field, [inner_path(field, 3)])  # 0.25 apart, at x from 0.25 to 0.5
    none = np.zeros(field.n_sectors, dtype=bool)
    for quad, expected in ((0.4, 0), (0.6, 1)):
        size = np.full(field.mesh.n_faces, quad)
        assert cancel_pairs(moved, 0.5, none, size)[1] == expected
    # Small quads where the pair is, large ones elsewhere: the pair is far apart.
    x = field.mesh.vertices[field.mesh.faces].mean(axis=1)[:, 0]
    assert cancel_pairs(moved, 0.5, none, np.where(x < 0.6, 0.2, 2.0))[1] == 0


def test_sizes_of_a_field_decide_which_pairs_stay() -> None:
    mesh = blob(4)
    rng = np.random.default_rng(4)
    z = smoothest(mesh) * np.exp(2j * rng.normal(size=mesh.n_faces))
    left = mesh.vertices[mesh.faces].mean(axis=1)[:, 0] < 0
    size = np.where(left, 0.02, 0.3)
    aligned = align_field(mesh, CrossField("faces", z, size))
    check_aligned(mesh, aligned)
    plain = ~aligned.sector_is_feature & (aligned.sector_quads != 4)
    x = aligned.mesh.vertices[aligned.sector_vertex[plain], 0]
    assert (x > 0.05).sum() < 20 < 100 < (x < -0.05).sum()

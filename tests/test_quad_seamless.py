"""The space of seamless maps: its dimension in closed form, and every combination exact."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.map_stages import CLOSED_PLAIN, NAMES, made, noisy, stages
from tests.meshes import blob, merge, moved, torus
from vhquad.field.align import AlignedField
from vhquad.mesh.triangle import next_halfedge
from vhquad.quad.elimination import eliminate
from vhquad.quad.seamless import (
    SeamlessSpace,
    irregular_vertices,
    seamless_space,
    special_vertices,
)
from vhquad.quad.seamless_map import rotate

IRREGULAR = {  # vertices where something other than a regular grid is needed, from the shape alone
    "sphere": 8,
    "torus": 0,
    "plain_cube": 8,
    "cube": 8,
    "grid": 4,
    "hole": 8,
    "cylinder": 0,
    "plate": 24,
}
SPECIAL = {**IRREGULAR, "torus": 1, "cylinder": 2}  # with the seeds


def check_seamless(aligned: AlignedField, space: SeamlessSpace, x: np.ndarray) -> None:
    """Every combination: rigid transitions by the rotation, features along axes; all in integers.

    The basis is over a denominator; coordinates times the denominator are whole.
    """
    mesh = aligned.mesh
    flat = space.basis @ x
    corner = flat.reshape(-1, 2)[space.wedge.reshape(-1)]
    h = np.flatnonzero(mesh.twin >= 0)
    there = rotate(corner, space.rotation)  # of every corner by the halfedge that leaves it
    near = corner[next_halfedge(mesh.twin[h])] - there[h]
    far = corner[mesh.twin[h]] - rotate(corner[next_halfedge(h)], space.rotation[h])
    np.testing.assert_array_equal(near, far)
    on = np.flatnonzero(aligned.feature)
    step = corner[next_halfedge(on)] - corner[on]
    assert (step == 0).any(axis=1).all()


@pytest.mark.parametrize("name", NAMES)
def test_every_combination_is_seamless(name: str, rng: np.random.Generator) -> None:
    s = stages(name)
    for _ in range(3):
        x = rng.integers(-(1 << 40), 1 << 40, s.space.basis.shape[1])
        check_seamless(s.aligned, s.space, x)


@given(seed=st.integers(0, 2**32 - 1))
def test_one_unknown_at_a_time(seed: int) -> None:
    s = stages("open_torus")
    x = np.zeros(s.space.basis.shape[1], dtype=np.int64)
    x[seed % len(x)] = seed + 1
    check_seamless(s.aligned, s.space, x)
    assert (s.space.basis @ x).any()  # no unknown is idle


@pytest.mark.parametrize("name", NAMES)
def test_rotations_are_the_fields(name: str) -> None:
    s = stages(name)
    mesh, space = s.aligned.mesh, s.space
    inner = np.flatnonzero(mesh.twin >= 0)
    # 1. antisymmetric, none on the boundary
    total = space.rotation[inner] + space.rotation[mesh.twin[inner]]
    assert (total % 4 == 0).all()
    assert (space.rotation[mesh.twin < 0] == 0).all()
    # 2. combing turns charts by whole quarters, and the rotations with them
    turns = (s.aligned.angle - space.angle) / (np.pi / 2)
    np.testing.assert_allclose(turns, np.round(turns), atol=1e-12)
    q = np.round(turns).astype(np.int64)
    change = q[mesh.twin[inner] // 3] - q[inner // 3]
    assert ((s.aligned.rotation[inner] + change - space.rotation[inner]) % 4 == 0).all()
    # 3. all but a cut is combed: faces hang together over edges without a turn
    plain = inner[
        space.wedge.reshape(-1)[inner] == space.wedge.reshape(-1)[next_halfedge(mesh.twin[inner])]
    ]
    assert len(plain) > len(inner) / 2
    both = plain[
        space.wedge.reshape(-1)[next_halfedge(plain)] == space.wedge.reshape(-1)[mesh.twin[plain]]
    ]
    singular_end = special_vertices(s.aligned)
    quiet = both[~singular_end[mesh.tail[both]] & ~singular_end[mesh.head[both]]]
    assert (space.rotation[quiet] == 0).all()


@pytest.mark.parametrize(("name", "genus"), CLOSED_PLAIN.items())
def test_dimension_of_closed_surfaces(name: str, genus: int) -> None:
    # Singular vertices S, ordinary ones move freely; 2 (S - 2) + 4 g + 2 (Bommes et al. 2009), the
    # last two a shift of everything.
    s = stages(name)
    singular = int(irregular_vertices(s.aligned).sum())
    ordinary = s.aligned.mesh.n_vertices - singular
    assert s.space.basis.shape[1] == 2 * ordinary + 2 * (singular - 2) + 4 * genus + 2
    assert s.space.even.sum() == 2 * (singular - 2) + 4 * genus + 2


@pytest.mark.parametrize(
    ("name", "even"),
    [
        ("torus", 2 + 4),  # a seed to place, two periods
        ("grid", 4),  # two sides, a shift
        ("cylinder", 5),  # height, girth, the turn of the upper seed, a shift
        ("cube", 3 + 2),  # three sides, a shift of the one chart net
    ],
)
def test_dimension_of_simple_shapes(name: str, even: int) -> None:
    assert stages(name).space.even.sum() == even


@pytest.mark.parametrize(("name", "count"), IRREGULAR.items())
def test_irregular_vertices(name: str, count: int) -> None:
    assert irregular_vertices(stages(name).aligned).sum() == count


@pytest.mark.parametrize(("name", "count"), SPECIAL.items())
def test_special_vertices(name: str, count: int) -> None:
    s = stages(name)
    special = special_vertices(s.aligned)
    assert special.sum() == count
    assert special[irregular_vertices(s.aligned)].all()
    # every boundary loop has one
    for loop in s.aligned.mesh.boundary_loops:
        assert special[s.aligned.mesh.tail[loop]].any()


def test_noise_changes_nothing_about_exactness(rng: np.random.Generator) -> None:
    mesh = torus()
    s = made(mesh, z=noisy(mesh, 1.0, rng))
    assert irregular_vertices(s.aligned).sum() > 0
    check_seamless(s.aligned, s.space, rng.integers(-1000, 1000, s.space.basis.shape[1]))


def test_two_components_have_two_shifts() -> None:
    one = stages("blob")
    two = made(merge(blob(3), moved(blob(3), (5.0, 0.0, 0.0))), quads=400)
    space = seamless_space(two.aligned)
    assert space.basis.shape[1] == 2 * one.space.basis.shape[1]


class TestElimination:
    """Small systems of links solved by hand."""

    def test_a_chain(self) -> None:
        # x1 = x0 + t0, x2 = -x1: one free scalar, one free shift.
        basis, denominator, plain, shifts = eliminate(3, [(0, 1, 1, 0), (1, 2, -1, -1)])
        assert (basis.shape, denominator) == ((3, 2), 1)
        assert plain.tolist() == [False, True, True]
        assert sorted(shifts.tolist()) == [False, True]
        x = np.array([5, 7])
        a, b, c = basis @ x
        assert b - a == x[shifts][0]
        assert c == -b

    def test_a_cycle_of_equal_sign_ties_the_shifts(self) -> None:
        # x1 = x0 + t0 and x0 = x1 + t1: t1 = -t0.
        basis, denominator, _, shifts = eliminate(2, [(0, 1, 1, 0), (1, 0, 1, 1)])
        assert (basis.shape[1], int(shifts.sum()), denominator) == (2, 1, 1)

    def test_a_cycle_of_opposite_sign_fixes_the_scalar(self) -> None:
        # x0 = -x0 + t: x0 stays free and whole, t is twice as much.
        basis, denominator, _, _ = eliminate(1, [(0, 0, -1, 0)])
        assert basis.shape == (1, 1)
        assert basis.toarray().ravel().tolist() in ([denominator], [denominator // 2])

    def test_untied_scalars_stay_free(self) -> None:
        basis, denominator, plain, shifts = eliminate(4, [])
        np.testing.assert_array_equal(basis.toarray(), denominator * np.eye(4))
        assert not plain.any()
        assert not shifts.any()

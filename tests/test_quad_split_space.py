"""Splits under a seamless space: old maps stay what they are, new vertices are free."""

from __future__ import annotations

import numpy as np
import pytest

from tests.field_checks import check_aligned
from tests.map_stages import NAMES, stages
from tests.test_quad_seamless import check_seamless
from vhquad.quad.split_space import split_space


@pytest.mark.parametrize("name", NAMES)
def test_old_maps_stay(name: str, rng: np.random.Generator) -> None:
    s = stages(name)
    mesh, space = s.aligned.mesh, s.space
    faces = rng.choice(mesh.n_faces, mesh.n_faces // 3, replace=False)
    made = split_space(s.aligned, space, faces)
    fine = made.aligned.mesh
    k = fine.n_vertices - mesh.n_vertices
    assert k > 0
    assert made.space.basis.shape[1] == space.basis.shape[1] + 2 * k
    # 1. the field is as sound as before, on the same surface
    check_aligned(s.mesh, made.aligned)
    assert fine.area == pytest.approx(mesh.area, rel=1e-12)
    # 2. with new vertices half way the map is the same: areas add up, in parents and in all
    x = rng.integers(-(1 << 30), 1 << 30, space.basis.shape[1]) * 4
    half = made.middle @ x
    whole = np.append(x, half).astype(np.int64)
    np.testing.assert_array_equal(whole[len(x) :], half)  # multiples of 4 have integer middles

    def twice_area(basis: np.ndarray, wedge: np.ndarray) -> np.ndarray:
        z = basis.reshape(-1, 2)[wedge].astype(float)
        a, b = z[:, 1] - z[:, 0], z[:, 2] - z[:, 0]
        return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]

    before = twice_area(space.basis @ x, space.wedge)
    after = twice_area(made.space.basis @ whole, made.space.wedge)
    parent = made.aligned.parent_face
    np.testing.assert_allclose(
        np.bincount(parent, after, s.mesh.n_faces),
        np.bincount(s.aligned.parent_face, before, s.mesh.n_faces),
        rtol=1e-9,
        atol=1e-9 * np.abs(before).max(),
    )
    # 3. every combination of old and new unknowns is seamless
    y = rng.integers(-1000, 1000, made.space.basis.shape[1])
    check_seamless(made.aligned, made.space, y)


def test_features_are_not_split() -> None:
    s = stages("plate")
    made = split_space(s.aligned, s.space, np.arange(s.aligned.mesh.n_faces))
    assert made.aligned.feature.sum() == s.aligned.feature.sum()
    assert made.aligned.mesh.n_vertices > s.aligned.mesh.n_vertices


def test_nothing_to_split() -> None:
    s = stages("blob")
    made = split_space(s.aligned, s.space, np.zeros(0, dtype=np.int64))
    assert made.aligned.mesh.n_faces == s.aligned.mesh.n_faces
    np.testing.assert_array_equal(made.space.wedge, s.space.wedge)

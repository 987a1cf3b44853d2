"""Unfolding a map: planted folds go, nothing far away moves, and a good map stays as it is."""

from __future__ import annotations

import numpy as np
import pytest

from tests.map_stages import stages
from vhquad.quad.map_energy import MapEnergy, determinants
from vhquad.quad.seamless import SeamlessSpace
from vhquad.quad.seamless_map import _Problem
from vhquad.quad.untangle import untangled


def prepared(name: str) -> tuple[MapEnergy, np.ndarray, SeamlessSpace]:
    """The energy of a stage's maps, and the unknowns of its least-squares map, free of folds."""
    s = stages(name)
    problem = _Problem(s.aligned, s.space, 0.1)
    x = problem.solve(np.ones(s.aligned.mesh.n_faces))
    assert (determinants(problem.energy.frames(x)) > 0).all()
    return problem.energy, x, s.space


@pytest.mark.parametrize("name", ["blob", "sphere", "pretzel", "open_torus", "hole"])
def test_planted_folds_are_undone(name: str, rng: np.random.Generator) -> None:
    energy, x, _ = prepared(name)
    single = np.flatnonzero(np.diff(energy.jacobian.tocsc().indptr) < 60)  # moves one vertex
    shaken = x.copy()
    for column in rng.choice(single, 3, replace=False):
        # Far enough to fold the triangles around.
        reach = np.abs(energy.jacobian[:, [column]].toarray()).max()
        shaken[column] += 4.0 / reach
    folded = determinants(energy.frames(shaken)) <= 0
    assert folded.any()
    out = untangled(energy, shaken, 4)
    assert (determinants(energy.frames(out)) > 0).all()
    # What lies beyond the rings has not moved.
    near = folded
    for _ in range(6):
        touched = np.zeros(energy.mesh.n_vertices, dtype=bool)
        touched[energy.mesh.faces[near]] = True
        near = touched[energy.mesh.faces].any(axis=1)
    np.testing.assert_array_equal(energy.frames(out)[~near], energy.frames(shaken)[~near])


def test_a_map_without_folds_stays() -> None:
    energy, x, _ = prepared("torus")
    np.testing.assert_array_equal(untangled(energy, x, 4), x)

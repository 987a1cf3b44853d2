"""Creases by angle give way to a field that is sure, but for parts that were designed with them."""

from __future__ import annotations

import numpy as np
import pytest

from tests import meshes
from vhquad.field.creases import creases_for_quads, without_known
from vhquad.field.features import find_creases, sharp_edges
from vhquad.mesh.triangle import TriMesh


def folded_sheet() -> TriMesh:
    """A sheet with one fold of 90 degrees across, and many small sharp bumps behind it."""
    mesh = meshes.grid(40, 20, 4.0, 2.0)
    x, y, _ = mesh.vertices.T
    bump = 0.08 * np.random.default_rng(0).standard_normal(len(x))
    bump[(x < 2.3) | (x > 3.9)] = 0.0
    v = np.stack([np.minimum(x, 2.0) + bump, y, np.maximum(x - 2.0, 0.0)], axis=1)
    return TriMesh(v, mesh.faces)


def test_a_sure_field_needs_no_creases_on_a_shape_that_was_not_designed() -> None:
    mesh = folded_sheet()
    pairs, sharp = find_creases(mesh, 40.0), sharp_edges(mesh, 40.0)
    assert 20 <= len(pairs) < 0.5 * len(sharp)
    none, all_sure = np.zeros(mesh.n_faces), np.ones(mesh.n_faces)
    kept = without_known(mesh, pairs, sharp, none)
    assert as_set(kept) == as_set(pairs)
    assert len(without_known(mesh, pairs, sharp, all_sure)) == 0
    half = (mesh.vertices[mesh.faces].mean(axis=1)[:, 1] > 1.0).astype(np.float64)
    kept = without_known(mesh, pairs, sharp, half)
    assert 0.4 * len(pairs) < len(kept) < 0.6 * len(pairs)
    assert mesh.vertices[kept][..., 1].max() <= 1.0 + 1e-9
    # The same in what looks for them.
    assert len(creases_for_quads(mesh, 40.0, 0.1)) >= 20
    assert len(creases_for_quads(mesh, 40.0, 0.1, trust=none)) >= 20
    assert len(creases_for_quads(mesh, 40.0, 0.1, trust=all_sure)) == 0


@pytest.mark.parametrize("trust", [0.0, 1.0])
def test_designed_parts_keep_their_creases(trust: float) -> None:
    mesh = meshes.cube(6)
    sure = np.full(mesh.n_faces, trust)
    pairs, sharp = find_creases(mesh, 40.0), sharp_edges(mesh, 40.0)
    assert as_set(without_known(mesh, pairs, sharp, sure)) == as_set(pairs)
    assert len(creases_for_quads(mesh, 40.0, 0.2, trust=sure)) == 12 * 6


def as_set(pairs: np.ndarray) -> set[tuple[int, ...]]:
    return {tuple(sorted(pair)) for pair in pairs.tolist()}

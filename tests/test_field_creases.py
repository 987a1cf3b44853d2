"""Creases by angle give way to a field that is sure, but for parts that were designed with them."""

from __future__ import annotations

import numpy as np
import pytest

from tests import meshes
from vhquad.field.creases import creases_for_quads, without_known
from vhquad.field.cross import CrossField
from vhquad.field.features import find_creases, sharp_edges
from vhquad.geometry.frames import face_axes, from_3d
from vhquad.mesh.triangle import TriMesh


def fold(mesh: TriMesh) -> np.ndarray:
    """Its 20 edges, all of which are found as creases."""
    pairs = find_creases(mesh, 40.0)
    return pairs[(np.abs(mesh.vertices[pairs] - [2.0, 1.0, 0.0]) < [1e-9, 1.1, 1e-9]).all((1, 2))]


def field(mesh: TriMesh, degrees: float, trust: float | np.ndarray) -> CrossField:
    """On the faces, turned by so much from the axes of x and y or z."""
    axes = face_axes(mesh)
    along = np.where(np.abs(mesh.face_normals[:, 1:2]) < 0.9, [[0.0, 1.0, 0.0]], [[1.0, 0.0, 0.0]])
    u = from_3d(along, axes) * np.exp(1j * np.radians(degrees))
    return CrossField("faces", u**4, None, np.broadcast_to(trust, mesh.n_faces))


@pytest.mark.parametrize("degrees", [0.0, 10.0, 30.0, 45.0])
@pytest.mark.parametrize("trust", [0.0, 1.0])
def test_a_sure_field_goes_across_sharp_edges(degrees: float, trust: float) -> None:
    """On a shape that was not designed with creases; along them it keeps them."""
    mesh = meshes.folded_sheet()
    pairs, sharp = fold(mesh), sharp_edges(mesh, 40.0)
    assert len(pairs) == 20 < 0.5 * len(sharp)
    cross = field(mesh, degrees, trust)
    kept = without_known(mesh, pairs, sharp, cross)
    if trust == 1.0 and degrees > 0.0:
        assert len(kept) == 0
    else:
        assert as_set(kept) == as_set(pairs)
    found = creases_for_quads(mesh, 40.0, 0.1, field=cross)
    assert (as_set(pairs) <= as_set(found)) == (len(kept) == 20)


def test_chains_are_judged_as_a_whole() -> None:
    mesh = meshes.folded_sheet()
    pairs, sharp = fold(mesh), sharp_edges(mesh, 40.0)
    y = mesh.vertices[mesh.faces].mean(axis=1)[:, 1]
    for share, left in ((0.3, len(pairs)), (0.7, 0)):
        cross = field(mesh, 30.0, (y < 2.0 * share).astype(np.float64))
        assert len(without_known(mesh, pairs, sharp, cross)) == left


@pytest.mark.parametrize("trust", [0.0, 1.0])
def test_designed_parts_keep_their_creases(trust: float) -> None:
    mesh = meshes.cube(6)
    pairs, sharp = find_creases(mesh, 40.0), sharp_edges(mesh, 40.0)
    cross = field(mesh, 30.0, trust)
    assert as_set(without_known(mesh, pairs, sharp, cross)) == as_set(pairs)
    assert len(creases_for_quads(mesh, 40.0, 0.2, field=cross)) == 12 * 6


def as_set(pairs: np.ndarray) -> set[tuple[int, ...]]:
    return {tuple(sorted(pair)) for pair in pairs.tolist()}

"""Gaps in creases: what is closed, along which edges, and what is left open."""

from __future__ import annotations

import numpy as np

from tests.meshes import cube, grid
from vhquad.field.bridge import bridge_gaps
from vhquad.field.features import find_creases
from vhquad.mesh.triangle import TriMesh


def edges_of(pairs: np.ndarray) -> set[tuple[int, int]]:
    return {(int(min(p)), int(max(p))) for p in pairs}


def line(mesh: TriMesh, y: float, x: list[float]) -> np.ndarray:
    """Grid edges along a row, between consecutive abscissae."""
    at = [int(np.linalg.norm(mesh.vertices[:, :2] - [a, y], axis=1).argmin()) for a in x]
    return np.stack([at[:-1], at[1:]], axis=1)


def test_a_missing_crease_edge_comes_back() -> None:
    """Every edge of a cube's creases, taken away, is the bridge: it is the shortest and sharp."""
    mesh = cube(4)
    creases = find_creases(mesh, 40.0)
    for missing in range(0, len(creases), 7):
        rest = np.delete(creases, missing, axis=0)
        assert edges_of(bridge_gaps(mesh, rest, 0.3)) == edges_of(creases)


def test_two_missing_edges_come_back_along_the_sharp_way() -> None:
    mesh = cube(6)
    creases = find_creases(mesh, 40.0)
    degree = np.bincount(creases.ravel(), minlength=mesh.n_vertices)
    middle = int(np.flatnonzero(degree == 2)[0])
    rest = creases[~(creases == middle).any(axis=1)]
    assert len(rest) == len(creases) - 2
    assert edges_of(bridge_gaps(mesh, rest, 0.5)) == edges_of(creases)


def test_a_gap_longer_than_the_reach_stays() -> None:
    mesh = cube(4)
    creases = find_creases(mesh, 40.0)
    rest = np.delete(creases, 0, axis=0)
    assert edges_of(bridge_gaps(mesh, rest, 0.2)) == edges_of(rest)


def test_whole_networks_and_none_stay() -> None:
    mesh = cube(3)
    creases = find_creases(mesh, 40.0)
    np.testing.assert_array_equal(bridge_gaps(mesh, creases, 1.0), creases)
    assert bridge_gaps(mesh, np.zeros((0, 2), np.int64), 1.0).shape == (0, 2)


def test_an_end_goes_on_to_a_crease_across() -> None:
    """A chain that ends one edge short of another crease meets it; its far end has nothing near."""
    mesh = grid(8, 8, height=1.0)
    step = 1 / 8
    wall = [int(np.linalg.norm(mesh.vertices[:, :2] - [0.75, k * step], axis=1).argmin())
            for k in range(9)]  # fmt: skip
    across = np.stack([wall[:-1], wall[1:]], axis=1)
    chain = line(mesh, 0.5, [0.25, 0.375, 0.5, 0.625])
    made = bridge_gaps(mesh, np.concatenate([across, chain]), 1.5 * step)
    new = edges_of(made) - edges_of(across) - edges_of(chain)
    assert new == edges_of(line(mesh, 0.5, [0.625, 0.75]))


def test_no_bridge_backwards() -> None:
    """Two parallel chains that end side by side do not turn into each other."""
    mesh = grid(8, 8, height=1.0)
    one = line(mesh, 0.5, [0.0, 0.125, 0.25, 0.375])
    two = line(mesh, 0.625, [0.0, 0.125, 0.25, 0.375])
    pairs = np.concatenate([one, two])
    np.testing.assert_array_equal(bridge_gaps(mesh, pairs, 0.13), pairs)

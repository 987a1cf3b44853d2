"""Loose short crease branches go, closed curves and long branches stay."""

from __future__ import annotations

import itertools

import numpy as np

from tests.meshes import grid
from vhquad.field.prune import prune_branches
from vhquad.mesh.triangle import TriMesh


def _sheet() -> TriMesh:
    return grid(10, 10)


def _vertex(mesh: TriMesh, x: float, y: float) -> int:
    """The vertex at a place of the sheet, in shares of its extent."""
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    wanted = low[:2] + np.array([x, y]) * (high - low)[:2]
    return int(np.argmin(np.linalg.norm(mesh.vertices[:, :2] - wanted, axis=1)))


def _path(mesh: TriMesh, *places: tuple[float, float]) -> list[tuple[int, int]]:
    v = [_vertex(mesh, x, y) for x, y in places]
    return list(itertools.pairwise(v))


def test_branch_of_a_long_crease_goes() -> None:
    mesh = _sheet()
    line = _path(mesh, *[(0.1 * i, 0.5) for i in range(11)])
    branch = _path(mesh, (0.5, 0.5), (0.5, 0.6))
    step = np.linalg.norm(np.diff(mesh.vertices[list(line[0])], axis=0))
    kept = prune_branches(mesh, np.array(line + branch), 2.5 * step)
    # 1: the branch of one edge goes; 2: the line, loose at both ends but long, stays whole.
    assert {tuple(sorted(p)) for p in kept.tolist()} == {tuple(sorted(p)) for p in line}


def test_what_a_drop_loosens_is_judged_again() -> None:
    mesh = _sheet()
    fork = _path(mesh, (0.5, 0.5), (0.6, 0.5)) + _path(mesh, (0.5, 0.5), (0.5, 0.6))
    stem = _path(mesh, (0.4, 0.5), (0.5, 0.5))
    step = np.linalg.norm(np.diff(mesh.vertices[list(stem[0])], axis=0))
    assert len(prune_branches(mesh, np.array(fork + stem), 1.5 * step)) == 0


def test_closed_curve_stays() -> None:
    mesh = _sheet()
    ring = _path(mesh, (0.4, 0.4), (0.5, 0.4), (0.5, 0.5), (0.4, 0.5), (0.4, 0.4))
    assert len(prune_branches(mesh, np.array(ring), 100.0)) == 4


def test_only_where_asked() -> None:
    mesh = _sheet()
    one, two = _path(mesh, (0.2, 0.2), (0.3, 0.2)), _path(mesh, (0.7, 0.7), (0.8, 0.7))
    at = np.zeros(mesh.n_vertices, dtype=bool)
    at[one[0][0]] = True
    kept = prune_branches(mesh, np.array(one + two), 100.0, at)
    assert kept.tolist() == [list(two[0])]

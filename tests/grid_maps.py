"""Integer-grid maps with known answers: planes, tubes, tori, cones; folds, charts turned at random.

Every maker returns a `GridCase`: the map, and the numbers of grid points, edges and cells that it
must give while it has no folds, counted by hand from the lattice that it covers.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import Delaunay

from vhquad.mesh.triangle import TriMesh, next_halfedge, prev_halfedge
from vhquad.quad.grid import GRID, rotate_quarter

Ints = NDArray[np.int64]


@dataclass(frozen=True)
class GridCase:
    """A map and its counts."""

    mesh: TriMesh
    uv: Ints
    rotation: Ints
    translation: Ints
    n_points: int
    n_edges: int
    n_cells: int

    @property
    def args(self) -> tuple[TriMesh, Ints, Ints, Ints]:
        return self.mesh, self.uv, self.rotation, self.translation


def case_of(mesh: TriMesh, uv: Ints, counts: tuple[int, int, int]) -> GridCase:
    """Find the transitions that carry the corners of each edge from face to face."""
    z = uv.reshape(-1, 2)
    h = np.flatnonzero(mesh.twin >= 0)
    t = mesh.twin[h]
    here = z[next_halfedge(h)] - z[h]
    there = z[t] - z[next_halfedge(t)]
    rotation = np.zeros(len(z), dtype=np.int64)
    found = np.zeros(len(h), dtype=bool)
    for r in (3, 2, 1, 0):
        fits = (rotate_quarter(here, np.full(len(h), r)) == there).all(axis=1)
        rotation[h[fits]] = r
        found |= fits
    assert found.all()
    translation = np.zeros((len(z), 2), dtype=np.int64)
    translation[h] = z[next_halfedge(t)] - rotate_quarter(z[h], rotation[h])
    return GridCase(mesh, uv, rotation, translation, *counts)


def plane(width: int, height: int, n: int, rng: np.random.Generator, odd: bool = False) -> GridCase:
    """A rectangle of cells under a random Delaunay triangulation of about n points.

    With ``odd`` no free coordinate lies on an isoline; else many do, and points on grid points.
    """
    size = np.array([width, height]) * GRID
    if odd:
        points = 2 * rng.integers(0, size // 2, (n, 2)) + 1
    else:
        points = rng.integers(1, 4 * size // GRID, (n, 2)) * (GRID // 4)
    sides = [
        np.stack([rng.integers(1, size[0], 4), np.zeros(4)], 1),
        np.stack([rng.integers(1, size[0], 4), np.full(4, size[1])], 1),
        np.stack([np.zeros(4), rng.integers(1, size[1], 4)], 1),
        np.stack([np.full(4, size[0]), rng.integers(1, size[1], 4)], 1),
        np.array([[0, 0], [size[0], 0], [0, size[1]], size]),
    ]
    points = np.unique(np.concatenate([points, *sides]).astype(np.int64), axis=0)
    faces = Delaunay(points / GRID).simplices.astype(np.int64)
    a, b, c = (points[faces[:, k]] for k in range(3))
    area = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    faces[area < 0] = faces[area < 0][:, ::-1]
    faces = faces[area != 0]
    mesh = TriMesh(np.column_stack([points / GRID, np.zeros(len(points))]), faces)
    edges = width * (height + 1) + height * (width + 1)
    counts = ((width + 1) * (height + 1), edges, width * height)
    return case_of(mesh, points[faces], counts)


def _jitter(shape: tuple[int, ...], amount: float, pitch: float, rng: np.random.Generator) -> Ints:
    """Random moves up to a share of the lattice's pitch (grid cells), in map units."""
    return np.rint(rng.uniform(-1, 1, shape) * amount * pitch * GRID).astype(np.int64)


def _diagonals(a: Ints, b: Ints, c: Ints, d: Ints, rng: np.random.Generator) -> Ints:
    """Squares cut along random diagonals, the first from a to c; points may have a last axis."""
    first = np.stack([a, b, c, a, c, d], axis=1)
    second = np.stack([a, b, d, b, c, d], axis=1)
    pick = rng.integers(0, 2, len(a)).astype(bool)
    pick[0] = True
    pick = pick.reshape(-1, *[1] * (first.ndim - 1))
    chosen = np.where(pick, first, second)
    return chosen.reshape(-1, 3, *first.shape[2:])


def torus(
    width: int, height: int, shear: int, nu: int, nv: int, rng: np.random.Generator
) -> GridCase:
    """A torus of width x height cells, glued with a shear, on a jittered nu x nv lattice."""
    i, j = np.meshgrid(np.arange(nu), np.arange(nv), indexing="ij")
    base = np.stack([i * width * GRID // nu + j * shear * GRID // nv, j * height * GRID // nv], -1)
    base = base + _jitter(base.shape, 0.2, min(width / nu, height / nv), rng)
    i, j = i.reshape(-1), j.reshape(-1)
    corner = [np.stack([i + a, j + b], axis=1) for a, b in ((0, 0), (1, 0), (1, 1), (0, 1))]
    lattice = _diagonals(*corner, rng)
    ii, jj = lattice[..., 0], lattice[..., 1]
    uv = base[ii % nu, jj % nv]
    uv = uv + (ii // nu)[..., None] * np.array([width * GRID, 0])
    uv = uv + (jj // nv)[..., None] * np.array([shear * GRID, height * GRID])
    a, b = 2 * np.pi * np.arange(nu) / nu, 2 * np.pi * np.arange(nv) / nv
    ring = 2 + np.cos(b)[None, :]
    points = np.stack(
        [ring * np.cos(a)[:, None], ring * np.sin(a)[:, None], np.tile(np.sin(b), (nu, 1))], -1
    )
    mesh = TriMesh(points.reshape(-1, 3), (ii % nu) * nv + jj % nv)
    n = width * height
    return case_of(mesh, uv, (n, 2 * n, n))


def tube(width: int, height: int, nu: int, nv: int, rng: np.random.Generator) -> GridCase:
    """An open cylinder, width cells around and height up; no corner, no cone."""
    i, j = np.meshgrid(np.arange(nu), np.arange(nv + 1), indexing="ij")
    base = np.stack([i * width * GRID // nu, j * height * GRID // nv], axis=-1)
    move = _jitter(base.shape, 0.2, min(width / nu, height / nv), rng)
    move[:, [0, -1], 1] = 0
    base = base + move
    angle = 2 * np.pi * np.arange(nu) / nu
    points = np.stack([np.cos(angle)[i], np.sin(angle)[i], j * 1.0], axis=-1)
    i, j = i[:, :-1].reshape(-1), j[:, :-1].reshape(-1)
    corner = [np.stack([i + a, j + b], axis=1) for a, b in ((0, 0), (1, 0), (1, 1), (0, 1))]
    lattice = _diagonals(*corner, rng)
    ii, jj = lattice[..., 0], lattice[..., 1]
    uv = base[ii % nu, jj] + (ii // nu)[..., None] * np.array([width * GRID, 0])
    mesh = TriMesh(points.reshape(-1, 3), (ii % nu) * (nv + 1) + jj)
    counts = (width * (height + 1), width * (2 * height + 1), width * height)
    return case_of(mesh, uv, counts)


def cone(quadrants: int, size: int, n: int, rng: np.random.Generator) -> GridCase:
    """Two or more squares of size x size cells around a point: index 1 - quadrants / 4."""
    i, j = np.meshgrid(np.arange(n + 1), np.arange(n + 1), indexing="ij")
    base = np.stack([i * size * GRID // n, j * size * GRID // n], axis=-1)
    number = np.zeros((quadrants, n + 1, n + 1), dtype=np.int64)
    uv = np.zeros((quadrants, n + 1, n + 1, 2), dtype=np.int64)
    count = 1
    for q in range(quadrants):
        move = _jitter(base.shape, 0.2, size / n, rng)
        move[-1, :, 0] = move[:, -1, 1] = 0
        move[0, 0] = move[-1, -1] = 0
        uv[q] = base + move
        number[q, 1:, :] = count + np.arange(n * (n + 1)).reshape(n, n + 1)
        count += n * (n + 1)
    for q in range(quadrants):  # the v axis of a quadrant is the u axis of the next
        ahead = (q + 1) % quadrants
        number[q, 0, 1:] = number[ahead, 1:, 0]
        uv[q, 0, 1:] = rotate_quarter(uv[ahead, 1:, 0], np.ones(n, dtype=np.int64))
    angle = np.arctan2(j, np.maximum(i, 1e-9) * 1.0)
    points = np.zeros((count, 3))
    for q in range(quadrants):
        turn = (angle + q * np.pi / 2) * 4 / quadrants
        radius = np.hypot(i, j)
        points[number[q]] = np.stack([radius * np.cos(turn), radius * np.sin(turn), 0 * turn], -1)
    faces, corners = [], []
    a, b = i[:-1, :-1].reshape(-1), j[:-1, :-1].reshape(-1)
    corner = [np.stack([a + x, b + y], axis=1) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))]
    for q in range(quadrants):
        lattice = _diagonals(*corner, rng)
        faces.append(number[q][lattice[..., 0], lattice[..., 1]])
        corners.append(uv[q][lattice[..., 0], lattice[..., 1]])
    cells = quadrants * size**2
    # Each cell has four edges; all but the rim's belong to two.
    counts = (1 + quadrants * size * (size + 1), 2 * cells + quadrants * size, cells)
    return case_of(TriMesh(points, np.concatenate(faces)), np.concatenate(corners), counts)


def turned_charts(case: GridCase, rng: np.random.Generator) -> GridCase:
    """The same map with the chart of each face turned and shifted at random."""
    m = case.mesh.n_faces
    turn = rng.integers(0, 4, m)
    shift = GRID * rng.integers(-5, 6, (m, 2))
    uv = rotate_quarter(case.uv, turn[:, None]) + shift[:, None, :]
    h = np.flatnonzero(case.mesh.twin >= 0)
    f, g = h // 3, case.mesh.twin[h] // 3
    rotation, translation = case.rotation.copy(), case.translation.copy()
    rotation[h] = (turn[g] + case.rotation[h] - turn[f]) % 4
    translation[h] = (
        rotate_quarter(case.translation[h], turn[g])
        + shift[g]
        - rotate_quarter(shift[f], rotation[h])
    )
    return replace(case, uv=uv, rotation=rotation, translation=translation)


def moved_vertex(case: GridCase, vertex: int, move: Ints) -> GridCase:
    """The map with one inside vertex moved, in the chart of its first corner."""
    mesh = case.mesh
    uv = case.uv.copy().reshape(-1, 2)
    h, turn = int(mesh.outgoing[vertex]), 0
    while True:
        uv[h] += rotate_quarter(np.asarray(move), np.array(turn))
        back = int(prev_halfedge(np.array(h)))
        turn += int(case.rotation[back])
        h = int(mesh.twin[back])
        if h in (-1, int(mesh.outgoing[vertex])):
            return replace(case, uv=uv.reshape(-1, 3, 2))


def n_flipped(case: GridCase) -> int:
    """Number of faces that are turned over or have no area in the map."""
    e, f = case.uv[:, 1] - case.uv[:, 0], case.uv[:, 2] - case.uv[:, 0]
    return int((e[:, 0] * f[:, 1] - e[:, 1] * f[:, 0] <= 0).sum())

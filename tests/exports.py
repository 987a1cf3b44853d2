"""Parts in as few triangles as CAD programs export, planes in long and thin ones."""

from __future__ import annotations

import numpy as np

from tests.meshes import Soup
from vhquad.mesh.triangle import TriMesh


def square_with_hole(n: int, at: tuple[float, float], radius: float) -> Soup:
    """A square of side 20 less an n-gon.

    (4 + n, 2) points, corners first, and triangles.
    """
    corners = np.array([[0.0, 0.0], [20.0, 0.0], [20.0, 20.0], [0.0, 20.0]])
    turn = 2 * np.pi * np.arange(n) / n
    hole = np.array(at) + radius * np.stack([np.cos(turn), np.sin(turn)], axis=1)
    towards = np.arctan2(*(corners - at).T[::-1])
    away = np.exp(1j * (turn[:, None] + np.pi / n - towards))
    nearest = np.abs(np.angle(away)).argmin(axis=1)
    faces = []
    for i in range(n):  # a fan from the corner that a side faces, and one more where that changes
        here, there, j = nearest[i], nearest[(i + 1) % n], 4 + (i + 1) % n
        faces.append([here, j, 4 + i])
        if here != there:
            faces.append([here, there, j])
    return np.concatenate([corners, hole]), np.array(faces)


def bored_block(n: int, height: float, lean: float) -> TriMesh:
    """A block of 20 x 20 with a hole of n sides.

    The hole leans by so much on its way through.
    """
    flat, upper = square_with_hole(n, (12.0, 11.0), 3.0)
    m, ring = len(flat), 4 + np.arange(n)
    tail = np.concatenate([np.arange(4), np.roll(ring, -1)])
    head = np.concatenate([np.roll(np.arange(4), -1), ring])
    sides = [np.stack([tail + m, head + m, head], 1), np.stack([tail + m, head, tail], 1)]
    v = np.concatenate([np.column_stack([flat, np.full(m, z)]) for z in (height, 0.0)])
    v[m + 4 :, 0] -= lean
    return TriMesh(v, np.concatenate([upper, upper[:, ::-1] + m, *sides]))


def dome_on_square(n: int = 48, at: tuple[float, float] = (14.0, 13.0)) -> TriMesh:
    """A half sphere of radius 3 and n / 4 rings on a flat square of few long triangles; open."""
    flat, faces = square_with_hole(n, at, 3.0)
    rise = 0.5 * np.pi * np.arange(n // 4) / (n // 4)
    rim = flat[4:] - at
    rings = [np.column_stack([at + np.cos(a) * rim, np.full(n, 3 * np.sin(a))]) for a in rise]
    v = np.concatenate([np.column_stack([flat[:4], np.zeros(4)]), *rings, [[*at, 3.0]]])
    lattice = 4 + np.arange(n * (n // 4)).reshape(-1, n)
    a, b = lattice[:-1], np.roll(lattice[:-1], -1, axis=1)
    c, d = np.roll(lattice[1:], -1, axis=1), lattice[1:]
    dome = [np.stack([a, b, c], axis=2).reshape(-1, 3), np.stack([a, c, d], axis=2).reshape(-1, 3)]
    last = lattice[-1]
    cap = np.stack([last, np.roll(last, -1), np.full(n, len(v) - 1)], axis=1)
    return TriMesh(v, np.concatenate([faces, *dome, cap]))

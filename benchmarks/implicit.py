"""Smooth shapes from distance functions: where a function is negative, meshed by marching cubes.

Distances are those of I. Quilez's well-known list, rounded where shapes meet.
"""

from __future__ import annotations

from collections.abc import Callable

import igl
import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["bust", "capsule", "genus", "level_set", "octopus", "smooth_union", "torus"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Distance = Callable[[Floats], Floats]
"""From points (n, 3) to (n,), negative inside."""


def level_set(distance: Distance, low: ArrayLike, high: ArrayLike, cells: int = 90) -> Soup:
    """Vertices and outward faces of the surface where a function is 0, inside a box.

    Parameters
    ----------
    distance : callable
    low, high : (3,) array_like
        The box; the surface must lie in it.
    cells : int
        Along the longest side of the box.
    """
    low, high = np.asarray(low, dtype=float), np.asarray(high, dtype=float)
    counts = np.maximum(np.rint(cells * (high - low) / (high - low).max()), 4).astype(int)
    axes = [np.linspace(a, b, n) for a, b, n in zip(low, high, counts, strict=True)]
    z, y, x = np.meshgrid(axes[2], axes[1], axes[0], indexing="ij")
    points = np.stack([x, y, z], axis=-1).reshape(-1, 3)
    vertices, faces = igl.marching_cubes(distance(points), points, *(int(n) for n in counts), 0.0)[
        :2
    ]
    faces = np.asarray(faces, dtype=np.int64)
    p = vertices[faces]
    if np.einsum("mi,mi->", np.cross(p[:, 0], p[:, 1]), p[:, 2]) < 0:
        faces = faces[:, ::-1]
    return vertices, faces


Soup = tuple[Floats, Ints]


def smooth_union(parts: list[Floats], radius: float) -> Floats:
    """Least of some distances, rounded within a radius."""
    stack = np.stack(parts)
    least = stack.min(axis=0)
    return np.asarray(least - radius * np.log(np.exp((least - stack) / radius).sum(axis=0)))


def capsule(points: Floats, a: ArrayLike, b: ArrayLike, start: float, end: float) -> Floats:
    """Distance to a segment, less a radius that runs from start to end."""
    a, b = np.asarray(a, dtype=float), np.asarray(b, dtype=float)
    t = np.clip((points - a) @ (b - a) / ((b - a) @ (b - a)), 0.0, 1.0)
    near = a + t[:, None] * (b - a)
    return np.asarray(np.linalg.norm(points - near, axis=1) - (start + t * (end - start)))


def torus(points: Floats, major: float, minor: float) -> Floats:
    """Distance to a torus about z."""
    ring = np.hypot(points[:, 0], points[:, 1]) - major
    return np.asarray(np.hypot(ring, points[:, 2]) - minor)


def genus(handles: int) -> Soup:
    """A row of rings grown together: closed, with so many handles."""
    centres = 1.5 * (np.arange(handles) - (handles - 1) / 2)

    def distance(p: Floats) -> Floats:
        return smooth_union([torus(p - [c, 0, 0], 0.8, 0.28) for c in centres], 0.05)

    side = centres[-1] + 1.3
    return level_set(distance, [-side, -1.3, -0.6], [side, 1.3, 0.6], 60 + 25 * handles)


def octopus() -> Soup:
    """A head and eight long, thin, curved arms."""
    s = np.linspace(0.0, 1.0, 9)

    def distance(p: Floats) -> Floats:
        parts = [np.linalg.norm((p - [0, 0, 0.35]) / [1, 1, 1.3], axis=1) - 0.5]
        for k in range(8):
            turn = 2 * np.pi * (k + 0.5) / 8 + 0.9 * s * (-1) ** k
            reach = 0.35 + 1.55 * s
            height = -0.1 - 0.35 * s + 0.30 * s * np.sin(5 * s + k)
            line = np.column_stack([reach * np.cos(turn), reach * np.sin(turn), height])
            width = 0.14 - 0.10 * s
            parts += [capsule(p, line[i], line[i + 1], width[i], width[i + 1]) for i in range(8)]
        return smooth_union(parts, 0.025)

    return level_set(distance, [-2.1, -2.1, -0.9], [2.1, 2.1, 1.2], 150)


def bust() -> Soup:
    """A head with nose, ears and shoulders, closed; cut it to open the neck."""

    def distance(p: Floats) -> Floats:
        q = p * [-1, 1, 1]
        ears = [capsule(s, [0.52, 0.05, 0.95], [0.56, 0.12, 1.15], 0.08, 0.12) for s in (p, q)]
        sockets = [np.linalg.norm(s - [0.2, -0.62, 1.18], axis=1) - 0.13 for s in (p, q)]
        head = smooth_union(
            [
                np.linalg.norm((p - [0, 0, 1.1]) / [0.8, 1, 1.15], axis=1) - 0.6,
                capsule(p, [0, 0.05, 0.7], [0, 0.1, -0.2], 0.3, 0.3),
                capsule(p, [-0.75, 0.15, -0.3], [0.75, 0.15, -0.3], 0.28, 0.28),
                capsule(p, [0, -0.6, 1.15], [0, -0.72, 0.98], 0.06, 0.10),
                *ears,
            ],
            0.04,
        )
        return np.asarray(-smooth_union([-head, *sockets], 0.03))

    return level_set(distance, [-1.2, -1.0, -0.8], [1.2, 1.0, 2.0], 110)

"""Shapes with sharp edges: extruded outlines, cut and joined by booleans."""

from __future__ import annotations

import numpy as np
import pymeshlab
from numpy.typing import ArrayLike, NDArray

__all__ = ["block", "bracket", "cone", "cube", "gear", "hexagon", "prism", "stepped_block"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Soup = tuple[Floats, Ints]


def prism(outline: ArrayLike, low: float, high: float) -> Soup:
    """An outline (k, 2), counter-clockwise and seen whole from 0, between two heights."""
    ring = np.asarray(outline, dtype=float)
    k = len(ring)
    i = np.arange(k)
    j = (i + 1) % k
    vertices = np.vstack(
        [np.column_stack([ring, np.full(k, z)]) for z in (low, high)]
        + [[[0.0, 0.0, low], [0.0, 0.0, high]]]
    )
    faces = [
        np.stack(corners, axis=1)
        for corners in (
            (i, j, j + k),
            (i, j + k, i + k),
            (j, i, np.full(k, 2 * k)),
            (i + k, j + k, np.full(k, 2 * k + 1)),
        )
    ]
    return vertices, np.concatenate(faces)


def block(low: ArrayLike, high: ArrayLike) -> Soup:
    """A box between two corners."""
    low, high = np.asarray(low, dtype=float), np.asarray(high, dtype=float)
    middle, half = (low + high) / 2, (high - low) / 2
    square = half[:2] * [[-1, -1], [1, -1], [1, 1], [-1, 1]]
    vertices, faces = prism(square, -half[2], half[2])
    return vertices + middle, faces


def rod(middle: ArrayLike, radius: float, length: float, axis: int, sides: int = 48) -> Soup:
    """A cylinder about one of the axes."""
    vertices, faces = prism(radius * circle(sides), -length / 2, length / 2)
    return np.roll(vertices, axis - 2, axis=1) + np.asarray(middle, dtype=float), faces


def circle(sides: int) -> Floats:
    """Points of the unit circle, (sides, 2)."""
    angle = 2 * np.pi * np.arange(sides) / sides
    return np.column_stack([np.cos(angle), np.sin(angle)])


def combined(solid: Soup, others: list[Soup], how: str) -> Soup:
    """A solid "union" or "difference" others, one after another."""
    for other in others:
        meshes = pymeshlab.MeshSet(verbose=False)
        for vertices, faces in (solid, other):
            meshes.add_mesh(pymeshlab.Mesh(vertices, faces.astype(np.int32)))
        getattr(meshes, f"generate_boolean_{how}")(first_mesh=0, second_mesh=1)
        made = meshes.current_mesh()
        solid = made.vertex_matrix(), made.face_matrix().astype(np.int64)
    return solid


def cube() -> Soup:
    """Eight corners, twelve edges."""
    return block([-0.5, -0.5, -0.5], [0.5, 0.5, 0.5])


def bracket() -> Soup:
    """Two plates at a right angle with a rib and four holes."""
    solid = combined(
        block([0, 0, 0], [2, 1.2, 0.25]), [block([0, 0, 0], [0.25, 1.2, 1.5])], "union"
    )
    solid = combined(solid, [block([0.2, 0.5, 0.2], [1.1, 0.7, 0.8])], "union")
    holes = [rod([1.6, y, 0], 0.14, 2, 2) for y in (0.3, 0.9)]
    holes += [rod([0, y, 1.15], 0.14, 2, 0) for y in (0.3, 0.9)]
    return combined(solid, holes, "difference")


def stepped_block() -> Soup:
    """Three steps, a hole down and one across that do not meet."""
    steps = [block([0, 0, 0.2], [1.3, 1, 0.7]), block([0, 0, 0.6], [0.6, 1, 1.1])]
    solid = combined(block([0, 0, 0], [2, 1, 0.35]), steps, "union")
    holes = [rod([1.65, 0.5, 0.2], 0.2, 2, 2), rod([0.3, 0.5, 0.8], 0.15, 3, 1)]
    return combined(solid, holes, "difference")


def cone() -> Soup:
    """A closed cone: a sharp rim and a tip."""
    k = 64
    ring = np.column_stack([circle(k), np.zeros(k)])
    i = np.arange(k)
    j = (i + 1) % k
    faces = [(i, j, np.full(k, k)), (j, i, np.full(k, k + 1))]
    vertices = np.vstack([ring, [[0, 0, 1.5], [0, 0, 0]]])
    return vertices, np.concatenate([np.stack(f, axis=1) for f in faces])


def hexagon() -> Soup:
    """A prism of six sides."""
    return prism(circle(6), -0.6, 0.6)


def gear() -> Soup:
    """Twelve teeth, thin, with a bore."""
    turn = 2 * np.pi / 12
    angle = (turn * np.arange(12)[:, None] + turn * np.array([0.0, 0.3, 0.5, 0.8])).reshape(-1)
    radius = np.tile([0.8, 1.0, 1.0, 0.8], 12)
    outline = radius[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    return combined(prism(outline, -0.15, 0.15), [rod([0, 0, 0], 0.3, 1, 2)], "difference")

"""Variations of a training shape: deformation, mirroring, crops, rough triangles.

The target stays exact. Deformations move the quads themselves, before any target is computed from
them; crops cut the fine triangles and roughness moves the remeshed ones, while targets still come
from the whole smooth surface.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vhquad.mesh.triangle import TriMesh

__all__ = ["clip_triangles", "crop_height", "deform", "mirror", "roughen"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


def deform(vertices: Floats, rng: np.random.Generator, strength: float = 1.0) -> Floats:
    """Stretch along three random axes and bend by a few long waves.

    Parameters
    ----------
    vertices : (n, 3) float64
    rng : Generator
    strength : float
        1: lengths change by up to about a quarter.

    Returns
    -------
    (n, 3) float64
    """
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    reach = float(np.linalg.norm(high - low))
    x = (vertices - 0.5 * (low + high)) / reach
    turn, _ = np.linalg.qr(rng.standard_normal((3, 3)))
    stretch = np.exp(0.15 * strength * rng.standard_normal(3))
    x = ((x @ turn) * stretch) @ turn.T
    for _ in range(4):
        direction = rng.standard_normal(3)
        direction /= np.linalg.norm(direction)
        wave = 2.0 * np.pi * rng.uniform(0.4, 1.5)  # radians over the diagonal
        push = 0.12 * strength / wave * rng.standard_normal(3)
        x = x + push * np.sin(x @ direction * wave + rng.uniform(0.0, 2.0 * np.pi))[:, None]
    return np.asarray(x * reach + 0.5 * (low + high))


def mirror(vertices: Floats, quads: Ints) -> tuple[Floats, Ints]:
    """The mirror image (x turned), faces turned round so that outside stays outside."""
    return vertices * np.array([-1.0, 1.0, 1.0]), quads[:, ::-1].copy()


def roughen(mesh: TriMesh, rng: np.random.Generator) -> TriMesh:
    """The noise of a scan: each vertex moved along its normal by a random share of an edge.

    The standard deviation is drawn between 1 and 10 % of the mean edge; triangles of ten degrees
    to their neighbours are then common.
    """
    edge = np.linalg.norm(mesh.vertices[mesh.head] - mesh.vertices[mesh.tail], axis=1).mean()
    push = edge * rng.uniform(0.01, 0.1) * rng.standard_normal(mesh.n_vertices)
    return TriMesh(mesh.vertices + push[:, None] * mesh.vertex_normals, mesh.faces)


def crop_height(vertices: Floats, areas: Floats, rng: np.random.Generator) -> Floats:
    """A random crop as a function on the vertices: what is below 0 is to be cut off.

    Three of four crops are planes, near a coordinate axis in two of three cases, as where a bust
    or a body is cut or a mask taken off, that leave 35 to 95 % of the area. The others keep a ball
    of 25 to 85 % of the area about a random point of the surface. Every fourth crop is cut by a
    second plane that alone would leave 60 to 95 %.

    Parameters
    ----------
    vertices : (n, 3) float64
    areas : (n,) float64
        Area of each vertex.
    rng : Generator

    Returns
    -------
    (n,) float64
    """
    if rng.random() < 0.75:
        height, keep = _plane(vertices, rng), rng.uniform(0.35, 0.95)
    else:
        centre = vertices[rng.choice(len(vertices), p=areas / areas.sum())]
        height, keep = -np.linalg.norm(vertices - centre, axis=1), rng.uniform(0.25, 0.85)
    height = _above(height, areas, keep)
    if rng.random() < 0.25:
        second = _above(_plane(vertices, rng), areas, rng.uniform(0.6, 0.95))
        height = np.minimum(height, second)
    return height


def _plane(vertices: Floats, rng: np.random.Generator) -> Floats:
    direction = rng.standard_normal(3)
    direction /= np.linalg.norm(direction)
    if rng.random() < 2.0 / 3.0:
        axis = np.zeros(3)
        axis[rng.integers(3)] = rng.choice([-1.0, 1.0])
        direction = axis + 0.25 * rng.standard_normal(3)
    return np.asarray(vertices @ direction)


def _above(height: Floats, areas: Floats, keep: float) -> Floats:
    """The height over the level that leaves a share ``keep`` of the area above it."""
    order = np.argsort(-height)
    share = np.cumsum(areas[order]) / areas.sum()
    level = height[order[min(int(np.searchsorted(share, keep)), len(order) - 1)]]
    return np.asarray(height - level)


def clip_triangles(vertices: Floats, faces: Ints, height: Floats) -> tuple[Floats, Ints]:
    """The part of a triangle mesh where a piecewise linear function is positive.

    Parameters
    ----------
    vertices : (n, 3) float64
    faces : (m, 3) int64
    height : (n,) float64
        The function at the vertices.

    Returns
    -------
    vertices : (n', 3) float64
        The old ones that are used, then one on each cut edge.
    faces : (m', 3) int64
        Oriented as before.
    """
    inside = height > 0
    count = inside[faces].sum(axis=1)
    whole = faces[count == 3]
    # Turn each cut face until its odd corner comes first.
    one, two = faces[count == 1], faces[count == 2]
    one = _turn(one, inside[one].argmax(axis=1))
    two = _turn(two, (~inside[two]).argmax(axis=1))
    pairs = np.concatenate([one[:, [0, 1]], one[:, [0, 2]], two[:, [0, 1]], two[:, [0, 2]]])
    pairs = np.sort(pairs, axis=1)
    unique, where = np.unique(pairs, axis=0, return_inverse=True)
    a, b = unique[:, 0], unique[:, 1]
    t = np.divide(
        height[a], height[a] - height[b], out=np.full(len(a), 0.5), where=height[a] != height[b]
    )
    t = t.clip(0.02, 0.98)[:, None]  # no needles
    cut = (1.0 - t) * vertices[a] + t * vertices[b]
    ids = len(vertices) + where.reshape(-1)
    p, q, r, s = np.split(ids, np.cumsum([len(one), len(one), len(two)]))
    clipped = np.concatenate(
        [
            whole,
            np.stack([one[:, 0], p, q], axis=1),
            np.stack([r, two[:, 1], two[:, 2]], axis=1),
            np.stack([r, two[:, 2], s], axis=1),
        ]
    )
    used, local = np.unique(clipped, return_inverse=True)
    return np.concatenate([vertices, cut])[used], local.reshape(-1, 3).astype(np.int64)


def _turn(faces: Ints, first: Ints) -> Ints:
    """Each row rotated so that its entry ``first`` comes first."""
    columns = (np.arange(3) + first[:, None]) % 3
    return np.take_along_axis(faces, columns, axis=1)

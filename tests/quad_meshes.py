"""Quad meshes made in code, their triangulations, and ways to spoil them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vhquad.mesh.triangle import TriMesh
from vhquad.quad.curves import CurveConstraints

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Quads = tuple[Floats, Ints]


def _cells(nu: int, nv: int, wrap_u: bool, wrap_v: bool) -> Ints:
    """Quads of a lattice whose point (i, j) has index i * nv + j."""
    i, j = np.meshgrid(np.arange(nu - (not wrap_u)), np.arange(nv - (not wrap_v)), indexing="ij")
    i, j = i.reshape(-1), j.reshape(-1)
    a, b = (i + 1) % nu, (j + 1) % nv
    return np.stack([i * nv + j, a * nv + j, a * nv + b, i * nv + b], axis=1)


def quad_grid(nx: int = 12, ny: int = 10) -> Quads:
    """Flat unit squares, facing +z."""
    x, y = np.meshgrid(np.arange(nx + 1.0), np.arange(ny + 1.0), indexing="ij")
    v = np.stack([x, y, np.zeros_like(x)], axis=-1).reshape(-1, 3)
    return v, _cells(nx + 1, ny + 1, False, False)


def quad_torus(nu: int = 36, nv: int = 14, major: float = 1.0, minor: float = 0.4) -> Quads:
    """Torus about z."""
    u, v = np.meshgrid(
        2 * np.pi * np.arange(nu) / nu, 2 * np.pi * np.arange(nv) / nv, indexing="ij"
    )
    r = major + minor * np.cos(v)
    p = np.stack([r * np.cos(u), r * np.sin(u), minor * np.sin(v)], axis=-1)
    return p.reshape(-1, 3), _cells(nu, nv, True, True)


def quad_tube(nu: int = 12, nv: int = 8) -> Quads:
    """Open tube of unit squares about z, facing outward."""
    u, z = np.meshgrid(2 * np.pi * np.arange(nu) / nu, np.arange(nv + 1.0), indexing="ij")
    radius = 0.5 / np.sin(np.pi / nu)
    v = np.stack([radius * np.cos(u), radius * np.sin(u), z], axis=-1).reshape(-1, 3)
    return v, _cells(nu, nv + 1, True, False)


def cube_sphere(n: int = 8) -> Quads:
    """Unit sphere from a cube with n x n quads a side: 8 vertices of valence 3."""
    t = np.linspace(-1.0, 1.0, n + 1)
    a, b = np.meshgrid(t, t, indexing="ij")
    cells = _cells(n + 1, n + 1, False, False)
    points, quads = [], []
    for axis in range(3):
        for sign in (1.0, -1.0):
            side = np.stack([np.full_like(a, sign), a, b], axis=-1).reshape(-1, 3)
            points.append(np.roll(side, axis, axis=1))
            quads.append((cells if sign > 0 else cells[:, ::-1]) + len(quads) * len(side))
    v, q = weld(np.concatenate(points), np.concatenate(quads))
    v = np.tan(v * np.pi / 4)
    return v / np.linalg.norm(v, axis=1, keepdims=True), q


def quad_disk(rings: int = 6, core: int = 4) -> Quads:
    """Flat unit disk: a square core whose rim is carried out to the circle in rings."""
    v, q = quad_grid(core, core)
    v = (v - [core / 2, core / 2, 0]) / (core / 2)
    x, y = v[:, 0], v[:, 1]
    rim = np.flatnonzero(np.maximum(np.abs(x), np.abs(y)) > 1 - 1e-9)
    rim = rim[np.argsort(np.arctan2(y[rim], x[rim]))]
    circle = v[rim] / np.linalg.norm(v[rim], axis=1, keepdims=True)
    layers, cells, inner = [0.45 * v], [q], rim
    for k in range(1, rings + 1):
        share = k / rings
        layers.append((1 - share) * 0.45 * v[rim] + share * circle)
        outer = len(v) + (k - 1) * len(rim) + np.arange(len(rim))
        cells.append(np.stack([inner, outer, np.roll(outer, -1), np.roll(inner, -1)], axis=1))
        inner = outer
    return np.concatenate(layers), np.concatenate(cells)


def weld(v: Floats, q: Ints) -> Quads:
    """Vertices at the same place, to 1e-9, made one."""
    _, first, new = np.unique(
        np.round(v * 1e9).astype(np.int64), axis=0, return_index=True, return_inverse=True
    )
    return v[first], new.reshape(-1)[q]


def triangulated(quads: Quads) -> TriMesh:
    """Each quad cut in two."""
    v, q = quads
    return TriMesh(v, np.concatenate([q[:, [0, 1, 2]], q[:, [0, 2, 3]]]))


def shaken(quads: Quads, rng: np.random.Generator, amount: float, held: Ints) -> Floats:
    """Vertices moved tangentially by up to ``amount`` of their shortest edge, ``held`` apart."""
    v, q = quads
    normal = triangulated(quads).vertex_normals
    edge = np.linalg.norm(v[q] - v[np.roll(q, -1, axis=1)], axis=2)
    shortest = np.full(len(v), np.inf)
    np.minimum.at(shortest, q, np.minimum(edge, np.roll(edge, 1, axis=1)))
    move = rng.normal(size=v.shape)
    move -= np.einsum("vi,vi->v", move, normal)[:, None] * normal
    move /= np.linalg.norm(move, axis=1, keepdims=True)
    move *= (rng.uniform(0, amount, len(v)) * shortest)[:, None]
    move[held] = 0.0
    return v + move


def bound_to_rim(quads: Quads) -> tuple[TriMesh, Ints, CurveConstraints]:
    """A disk as triangles, the vertices of its rim in order, and the rim as their curve."""
    mesh = triangulated(quads)
    rim = mesh.tail[mesh.boundary_loops[0]]
    curve = np.full(mesh.n_vertices, -1)
    curve[rim] = 0
    return mesh, rim, CurveConstraints([mesh.vertices[rim]], [True], curve)

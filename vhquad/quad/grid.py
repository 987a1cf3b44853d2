"""Integer-grid maps in general position: no plain vertex on an isoline, cones on grid points.

A map gives each corner of each face integer coordinates, GRID units to a grid cell; isolines are
where a coordinate is a multiple of GRID. The isolines of a map whose vertices avoid them can be
read off by signs alone. So coordinates are doubled, and each that lies on an isoline is moved by
one unit, 2^-19 of a cell, except at *pinned* vertices: cones and corners of the boundary, which
stay on their grid points. Boundary edges lie on isolines themselves; their vertices are moved
inward, which leaves a thin collar that only the crossing isolines traverse (see
:mod:`vhquad.quad.isolines`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vhquad.errors import ParametrizationError
from vhquad.mesh.triangle import TriMesh, next_halfedge, prev_halfedge

__all__ = ["GRID", "STEP", "IntegerGridMap", "SettledMap", "rotate_quarter", "settle"]

Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

GRID = 1 << 18
STEP = 2 * GRID  # a grid cell in the doubled coordinates of a settled map


def rotate_quarter(z: Ints, turns: Ints) -> Ints:
    """i^turns times the complex integers z (..., 2); a turn takes (u, v) to (-v, u)."""
    u, v = z[..., 0], z[..., 1]
    r = np.mod(turns, 4)
    real = np.choose(r, [u, -v, -u, v])
    imaginary = np.choose(r, [v, u, -v, -u])
    return np.stack([real, imaginary], axis=-1)


@dataclass(frozen=True, eq=False)
class IntegerGridMap:
    """Coordinates per corner, and how charts follow each other.

    Attributes
    ----------
    mesh : TriMesh
        Manifold, also at vertices.
    uv : (m, 3, 2) int64
        Coordinates of corner k of face f, in units of 1/GRID of a grid cell.
    rotation : (3m,) int64
        r of each halfedge: z_g = i^r z_f + t for its face f and the face g across; unused on a
        boundary.
    translation : (3m, 2) int64
        t of each halfedge, a multiple of GRID.

    Raises
    ------
    ParametrizationError
        If shapes are wrong, or the coordinates do not fit the transitions exactly.
    """

    mesh: TriMesh
    uv: Ints
    rotation: Ints
    translation: Ints

    def __post_init__(self) -> None:
        mesh, m = self.mesh, self.mesh.n_faces
        shapes = (self.uv.shape, self.rotation.shape, self.translation.shape)
        if shapes != ((m, 3, 2), (3 * m,), (3 * m, 2)):
            raise ParametrizationError(f"uv, rotation, translation have shapes {shapes}")
        h = np.flatnonzero(mesh.twin >= 0)
        t, z = mesh.twin[h], self.uv.reshape(-1, 2)
        for mine, other in ((h, next_halfedge(t)), (next_halfedge(h), t)):
            there = rotate_quarter(z[mine], self.rotation[h]) + self.translation[h]
            wrong = h[(there != z[other]).any(axis=1)]
            if wrong.size:
                raise ParametrizationError(
                    f"{len(wrong)} halfedges do not carry the coordinates of one face to those of "
                    f"the next, the first is {wrong[0]} of face {wrong[0] // 3}"
                )
        wrong = h[(self.translation[h] % GRID != 0).any(axis=1)]
        if wrong.size:
            raise ParametrizationError(f"the translation of halfedge {wrong[0]} is no grid vector")


@dataclass(frozen=True, eq=False)
class SettledMap:
    """A map in general position.

    Attributes
    ----------
    x : (m, 3, 2) int64
        Doubled and moved coordinates; plain vertices have none that is a multiple of STEP.
    pinned : (n,) bool
        Vertices that stay, both coordinates multiples of STEP.
    fan_rank : (3m,) int64
        Place of each corner in the fan of its vertex, counter-clockwise; 0 where nothing asks.
    sense : (3m,) int64
        On boundary halfedges 1 where the surface lies to the left in the map too, -1 where the
        boundary runs backward; 0 elsewhere.
    """

    x: Ints
    pinned: Bools
    fan_rank: Ints
    sense: Ints


@dataclass(frozen=True, eq=False)
class _Fans:
    """The corners around some vertices: quarter turns from the first chart, and the whole angle."""

    turns: Ints  # (3m,) quarter turns from the chart of the vertex's first corner to the corner's
    rank: Ints  # (3m,)
    holonomy: Ints  # (n,) quarter turns once around, inside vertices
    quads: Ints  # (n,) angle in the map in quarter turns
    last: Ints  # (n,) last corner of the fan


def settle(grid_map: IntegerGridMap) -> SettledMap:
    """Bring a map into general position.

    Raises
    ------
    ParametrizationError
        If a boundary edge is not on an isoline, or a cone or a corner of the boundary lies on an
        isoline but not on a grid point.
    """
    mesh = grid_map.mesh
    n = mesh.n_vertices
    z = grid_map.uv.reshape(-1, 2)
    on = z % GRID == 0
    rim = mesh.is_boundary_vertex
    asked = rim.copy()
    asked[mesh.tail[on.any(axis=1)]] = True
    fans = _walk_fans(grid_map, np.flatnonzero(asked))
    first = np.maximum(mesh.outgoing, 0)
    on_point = asked & on[first].all(axis=1)
    inside = asked & ~rim
    cone = inside & (fans.holonomy != 0)
    stray = np.flatnonzero(cone & ~on_point)
    if stray.size:
        raise ParametrizationError(
            f"{len(stray)} cones lie on isolines but not on grid points, the first is vertex "
            f"{stray[0]}"
        )
    pinned = on_point & (cone | (inside & (fans.quads != 4)))
    move = np.zeros((n, 2), dtype=np.int64)
    move[inside] = on[first[inside]]
    sense = np.zeros(3 * mesh.n_faces, dtype=np.int64)
    if rim.any():
        sense = _settle_boundary(grid_map, fans, on, on_point, pinned, move)
    move[pinned] = 0
    x = 2 * z
    touched = np.flatnonzero(move[mesh.tail].any(axis=1))
    x[touched] += rotate_quarter(move[mesh.tail[touched]], fans.turns[touched])
    return SettledMap(x.reshape(-1, 3, 2), pinned, fans.rank, sense)


def _walk_fans(grid_map: IntegerGridMap, vertices: Ints) -> _Fans:
    mesh = grid_map.mesh
    z = grid_map.uv.reshape(-1, 2)
    turns, rank = np.zeros(3 * mesh.n_faces, np.int64), np.zeros(3 * mesh.n_faces, np.int64)
    holonomy, last = np.zeros(mesh.n_vertices, np.int64), np.zeros(mesh.n_vertices, np.int64)
    angle = np.zeros(mesh.n_vertices)
    v = vertices[mesh.outgoing[vertices] >= 0]
    h, turn, step = mesh.outgoing[v], np.zeros(len(v), dtype=np.int64), 0
    while h.size:
        back = prev_halfedge(h)
        ahead, behind = z[next_halfedge(h)] - z[h], z[back] - z[h]
        cross = ahead[:, 0] * behind[:, 1] - ahead[:, 1] * behind[:, 0]
        angle[v] += np.arctan2(cross.astype(float), (ahead * behind).sum(axis=1).astype(float))
        turns[h], rank[h], last[v] = turn, step, h
        turn = turn + grid_map.rotation[back]
        holonomy[v] = turn
        h, step = mesh.twin[back], step + 1
        go = (h >= 0) & (h != mesh.outgoing[v])
        v, h, turn = v[go], h[go], turn[go]
    # Angles add up to whole quarter turns exactly; the sum is off by rounding only.
    quads = np.rint(angle / (np.pi / 2)).astype(np.int64)
    return _Fans(turns % 4, rank, holonomy % 4, quads, last)


def _settle_boundary(
    grid_map: IntegerGridMap, fans: _Fans, on: Bools, on_point: Bools, pinned: Bools, move: Ints
) -> Ints:
    """Pin corners and move the other boundary vertices inward (in place); the boundary's sense."""
    mesh, z = grid_map.mesh, grid_map.uv.reshape(-1, 2)
    border = np.flatnonzero(mesh.twin < 0)
    ahead = z[next_halfedge(border)] - z[border]
    flat = (ahead == 0) & on[border]
    wrong = border[(flat.sum(axis=1) != 1) | (ahead != 0).all(axis=1)]
    if wrong.size:
        raise ParametrizationError(
            f"{len(wrong)} boundary edges do not run along isolines, the first is halfedge "
            f"{wrong[0]} of face {wrong[0] // 3}"
        )
    normal = np.zeros(3 * mesh.n_faces, dtype=np.int64)  # coordinate that is constant
    normal[border] = np.where(flat[:, 0], 0, 1)
    along = np.zeros(3 * mesh.n_faces, dtype=np.int64)
    along[border] = ahead.sum(axis=1)

    start = mesh.tail[border]  # each boundary vertex once
    incoming = prev_halfedge(fans.last[start])
    odd = (normal[incoming] + fans.turns[fans.last[start]]) % 2 != normal[border]
    wrong = start[odd & ~on_point[start]]
    if wrong.size:
        raise ParametrizationError(
            f"{len(wrong)} corners of the boundary are no grid points, the first is vertex "
            f"{wrong[0]}"
        )
    quads = fans.quads[start]
    pinned[start] = odd | (on_point[start] & (quads != 2) & (quads != 0))
    folds = np.zeros(mesh.n_vertices, dtype=bool)
    folds[start] = ~pinned[start] & (quads % 4 != 2)

    sense = np.zeros(3 * mesh.n_faces, dtype=np.int64)
    for loop in mesh.boundary_loops:  # loops are few
        corner = np.flatnonzero(pinned[mesh.tail[loop]])
        ordered = np.roll(loop, -corner[0]) if corner.size else loop
        tail = mesh.tail[ordered]
        side = np.cumsum(pinned[tail])
        turn = np.where(folds[tail], -1, 1)
        turn[0] = 1
        sign = np.cumprod(turn)
        net = np.bincount(side, sign * np.abs(along[ordered]).astype(float))
        sense[ordered] = sign * np.where(net[side] < 0, -1, 1)

    # Left of (d, 0) is (0, d), left of (0, d) is (-d, 0).
    c, d = normal[border], np.sign(along[border])
    move[start] = 0
    move[start, c] = np.where(c == 1, d, -d) * sense[border]
    move[start, 1 - c] = on[border, 1 - c]
    return sense

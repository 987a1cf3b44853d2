"""Meshes made in code, with their truth: closed, open, sharp, many-handled (broken: `soups`).

`CLOSED` and `OPEN` are lists of `Case` for ``@pytest.mark.parametrize("case", CLOSED, ids=str)``.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from vhquad.mesh.quad import QuadMesh
from vhquad.mesh.triangle import TriMesh

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Soup = tuple[Floats, Ints]


# ---- closed ---------------------------------------------------------------------------------


def tetrahedron() -> TriMesh:
    """Regular tetrahedron with vertices on the unit sphere."""
    v = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]) / np.sqrt(3.0)
    return TriMesh(v, [[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]])


def icosphere(subdivisions: int = 2, radius: float = 1.0) -> TriMesh:
    """Icosahedron split `subdivisions` times and pushed onto the sphere: 20 * 4^s faces."""
    g = (1.0 + np.sqrt(5.0)) / 2.0
    square = np.array([[-1, g, 0], [1, g, 0], [-1, -g, 0], [1, -g, 0]])
    v = np.vstack([np.roll(square, k, axis=1) for k in range(3)])
    # fmt: off
    f = np.array([
        [0, 11, 5], [0, 5, 1], [0, 1, 7], [0, 7, 10], [0, 10, 11], [1, 5, 9], [5, 11, 4],
        [11, 10, 2], [10, 7, 6], [7, 1, 8], [3, 9, 4], [3, 4, 2], [3, 2, 6], [3, 6, 8],
        [3, 8, 9], [4, 9, 5], [2, 4, 11], [6, 2, 10], [8, 6, 7], [9, 8, 1],
    ])
    # fmt: on
    for _ in range(subdivisions):
        v, f = midpoint_split(v, f)
        v = v / np.linalg.norm(v, axis=1, keepdims=True)
    return TriMesh(radius * v / np.linalg.norm(v, axis=1, keepdims=True), f)


def blob(subdivisions: int = 3, seed: int = 0, strength: float = 0.3) -> TriMesh:
    """A sphere with smooth random bumps: closed, genus 0, no symmetry, curvature everywhere."""
    rng = np.random.default_rng(seed)
    sphere = icosphere(subdivisions)
    x = sphere.vertices
    waves, phases = rng.normal(size=(6, 3)) * 2.0, rng.uniform(0, 2 * np.pi, 6)
    bump = np.sin(x @ waves.T + phases).mean(axis=1)
    return TriMesh(x * (1.0 + strength * bump)[:, None] * [1.0, 1.15, 0.9], sphere.faces)


def torus(nu: int = 24, nv: int = 12, major: float = 1.0, minor: float = 0.4) -> TriMesh:
    """Torus about z: nu vertices the long way round, nv about the tube; 2 nu nv faces."""
    u, v = np.meshgrid(circle_angles(nu), circle_angles(nv), indexing="ij")
    r = major + minor * np.cos(v)
    points = np.stack([r * np.cos(u), r * np.sin(u), minor * np.sin(v)], axis=-1)
    return TriMesh(points.reshape(-1, 3), _lattice(nu, nv, wrap_u=True, wrap_v=True))


def cube(n: int = 4, side: float = 1.0) -> TriMesh:
    """Cube centred at 0, n x n squares a side, each cut in two: 12 n^2 faces, 12 sharp edges."""
    return _voxel_surface(np.ones((n, n, n), dtype=bool), side / n)


def plate_with_holes(genus: int = 2, n: int = 2) -> TriMesh:
    """A flat block pierced `genus` times, sharp; each voxel is split n times."""
    solid = np.ones((2 * genus + 1, 3, 1), dtype=bool)
    solid[1::2, 1, 0] = False
    return _voxel_surface(np.kron(solid, np.ones((n, n, n), dtype=bool)), 1.0 / n)


def pretzel(genus: int = 2, n: int = 2, steps: int = 6) -> TriMesh:
    """The same block smoothed: a rounded closed surface with `genus` handles."""
    mesh = plate_with_holes(genus, n)
    i, j = mesh.edges.T
    v = mesh.vertices
    for _ in range(steps):
        total, count = np.zeros_like(v), np.zeros(len(v))
        np.add.at(total, i, v[j])
        np.add.at(total, j, v[i])
        np.add.at(count, i, 1.0)
        np.add.at(count, j, 1.0)
        v = 0.5 * v + 0.5 * total / count[:, None]
    return TriMesh(v, mesh.faces)


# ---- open -----------------------------------------------------------------------------------


def one_triangle() -> TriMesh:
    """The right triangle (0,0), (1,0), (0,1)."""
    return TriMesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])


def grid(
    nx: int = 8, ny: int = 6, width: float = 1.0, height: float = 0.75, hole: bool = False
) -> TriMesh:
    """Flat rectangle, nx x ny squares cut in two, facing +z; with `hole` without its middle."""
    x, y = np.meshgrid(np.linspace(0, width, nx + 1), np.linspace(0, height, ny + 1), indexing="ij")
    v = np.stack([x, y, np.zeros_like(x)], axis=-1).reshape(-1, 3)
    mesh = TriMesh(v, _lattice(nx + 1, ny + 1))
    if not hole:
        return mesh
    centre = v[mesh.faces].mean(axis=1)[:, :2] / [width, height]
    return mesh.submesh((np.abs(centre - 0.5) > 1.0 / 6.0).any(axis=1))[0]


def disk(rings: int = 6, radius: float = 1.0) -> TriMesh:
    """Flat disk facing +z: a centre and rings of 6, 12, 18... vertices."""
    v, f, first = [np.zeros((1, 2))], [], [0]
    for k in range(1, rings + 1):
        first.append(first[-1] + max(1, 6 * (k - 1)))
        a = circle_angles(6 * k)
        v.append(radius * k / rings * np.stack([np.cos(a), np.sin(a)], axis=1))
        for s in range(6):
            for j in range(k):
                a0, a1 = first[k] + s * k + j, first[k] + (s * k + j + 1) % (6 * k)
                b0 = first[k - 1] + (s * (k - 1) + j) % max(1, 6 * (k - 1))
                f.append([a0, a1, b0])
                if j < k - 1:
                    b1 = first[k - 1] + (s * (k - 1) + j + 1) % (6 * (k - 1))
                    f.append([b0, a1, b1])
    flat = np.concatenate(v)
    return TriMesh(np.column_stack([flat, np.zeros(len(flat))]), f)


def sheet(nx: int = 16, ny: int = 10, turn: float = 0.0, seed: int = 0) -> TriMesh:
    """A 2 x 1 sheet bent along its columns by `turn` radians in all: isometric for any turn.

    Bends lie on mesh edges only, so every triangle keeps its lengths to rounding. Vertices are
    jittered along the columns, which keeps the triangulation from being regular.
    """
    rng = np.random.default_rng(seed)
    y = np.tile(np.linspace(0.0, 1.0, ny + 1), (nx + 1, 1))
    y[:, 1:-1] += rng.uniform(-0.3, 0.3, (nx + 1, ny - 1)) / ny
    heading = (np.arange(nx) - (nx - 1) / 2.0) * (turn / nx)
    step = 2.0 / nx
    x = np.concatenate([[0.0], np.cumsum(step * np.cos(heading))])
    z = np.concatenate([[0.0], np.cumsum(step * np.sin(heading))])
    points = np.stack([np.broadcast_to(c[:, None], y.shape) for c in (x, z)] + [y], axis=-1)
    return TriMesh(points[:, :, [0, 2, 1]].reshape(-1, 3), _lattice(nx + 1, ny + 1))


def folded_sheet() -> TriMesh:
    """A sheet with one fold of 90 degrees across, and many small sharp bumps behind it."""
    mesh = grid(40, 20, 4.0, 2.0)
    x, y, _ = mesh.vertices.T
    bump = 0.08 * np.random.default_rng(0).standard_normal(len(x))
    bump[(x < 2.3) | (x > 3.9)] = 0.0
    v = np.stack([np.minimum(x, 2.0) + bump, y, np.maximum(x - 2.0, 0.0)], axis=1)
    return TriMesh(v, mesh.faces)


def open_cylinder(nu: int = 24, nv: int = 8, radius: float = 1.0, height: float = 2.0) -> TriMesh:
    """Tube about z without lids, facing outward; 2 nu nv faces, two boundary loops."""
    u, z = np.meshgrid(circle_angles(nu), np.linspace(0.0, height, nv + 1), indexing="ij")
    v = np.stack([radius * np.cos(u), radius * np.sin(u), z], axis=-1).reshape(-1, 3)
    return TriMesh(v, _lattice(nu, nv + 1, wrap_u=True))


def cone(nu: int = 24, nv: int = 8, radius: float = 1.0, height: float = 1.0) -> TriMesh:
    """Cone without base, apex at (0, 0, height), last vertex.

    The smooth cone's apex has the angle 2 pi radius / sqrt(radius^2 + height^2).
    """
    tube = open_cylinder(nu, nv)
    level = tube.vertices[:, 2] / 2.0
    ring = np.arange(nu) * (nv + 1) + nv
    v = np.column_stack([radius * (1 - level)[:, None] * tube.vertices[:, :2], height * level])
    keep = np.delete(np.arange(len(v)), ring)
    new = np.full(len(v), nu * nv, dtype=np.int64)
    new[keep] = np.arange(nu * nv)
    f = new[tube.faces]
    apart = (f != np.roll(f, 1, axis=1)).all(axis=1)
    return TriMesh(np.vstack([v[keep], [[0.0, 0.0, height]]]), f[apart])


def half_sphere(subdivisions: int = 2) -> TriMesh:
    """The faces of an icosphere whose centre has z > 0: ragged boundary, one loop."""
    sphere = icosphere(subdivisions)
    return sphere.submesh(sphere.vertices[sphere.faces].mean(axis=1)[:, 2] > 0)[0]


def punctured_torus() -> TriMesh:
    """A torus that lacks one vertex's ring: genus 1, one boundary loop."""
    mesh = torus()
    return mesh.submesh((mesh.faces != 5).all(axis=1))[0]


def ball_with_limb(length: float = 3.0, radius: float = 0.06, nu: int = 24) -> TriMesh:
    """Unit ball with a thin limb along +z, pointed at its end: a surface of revolution."""
    first = np.arcsin(radius)
    angle = np.linspace(np.pi, 0.0, 25)[1:-1]  # from the south pole, as far as the limb
    angle = angle[angle > first]
    along = np.cos(first) + np.linspace(0.0, length, 37)
    r = np.concatenate([np.sin(angle), np.full(len(along), radius)])
    z = np.concatenate([np.cos(angle), along])
    turn = circle_angles(nu)
    rings = np.stack(
        [np.outer(np.cos(turn), r), np.outer(np.sin(turn), r), np.tile(z, (nu, 1))], axis=-1
    )
    south, north = nu * len(r), nu * len(r) + 1
    a = np.arange(nu) * len(r)
    b = np.roll(a, -1)
    lid, tip = np.full(nu, south), np.full(nu, north)
    last = len(r) - 1
    faces = [
        _lattice(nu, len(r), wrap_u=True),
        np.stack([b, a, lid], axis=1),
        np.stack([a + last, b + last, tip], axis=1),
    ]
    poles = np.array([[0.0, 0.0, -1.0], [0.0, 0.0, z[-1] + radius]])
    return TriMesh(np.vstack([rings.reshape(-1, 3), poles]), np.concatenate(faces))


# ---- quads ----------------------------------------------------------------------------------


def quad_grid(nx: int = 4, ny: int = 3, width: float = 1.0, height: float = 0.75) -> QuadMesh:
    """Flat rectangle of nx x ny equal quads facing +z."""
    return QuadMesh(grid(nx, ny, width, height).vertices, _squares(nx + 1, ny + 1))


def quad_torus(nu: int = 24, nv: int = 12, major: float = 1.0, minor: float = 0.4) -> QuadMesh:
    """The torus above without diagonals: all vertices regular."""
    points = torus(nu, nv, major, minor).vertices
    return QuadMesh(points, _squares(nu, nv, wrap_u=True, wrap_v=True))


def quad_cube(n: int = 4, side: float = 1.0) -> QuadMesh:
    """Cube of 6 n^2 squares: eight vertices of valence 3, none other irregular."""
    v, q = _voxel_quads(np.ones((n, n, n), dtype=bool), side / n)
    return QuadMesh(v, q)


# ---- many parts, transforms -----------------------------------------------------------------


def merge(*meshes: TriMesh) -> TriMesh:
    """All meshes in one, vertices and faces in order."""
    start = np.cumsum([0] + [m.n_vertices for m in meshes])
    faces = [m.faces + s for m, s in zip(meshes, start, strict=False)]
    return TriMesh(np.vstack([m.vertices for m in meshes]), np.vstack(faces))


def moved(mesh: TriMesh, shift: tuple[float, float, float], scale: float = 1.0) -> TriMesh:
    """The mesh scaled, then shifted."""
    return TriMesh(scale * mesh.vertices + np.asarray(shift, dtype=np.float64), mesh.faces)


def two_spheres() -> TriMesh:
    """Two closed components of different size, side by side."""
    return merge(icosphere(2), moved(icosphere(1), (3.0, 0.0, 0.0), 0.5))


def sphere_and_sheet() -> TriMesh:
    """A closed and an open component."""
    return merge(icosphere(2), moved(grid(), (2.0, 0.0, 0.0)))


@dataclass(frozen=True)
class Rigid:
    """A proper rotation followed by a shift."""

    rotation: Floats
    shift: Floats

    def points(self, x: Floats) -> Floats:
        return np.asarray(x) @ self.rotation.T + self.shift

    def vectors(self, x: Floats) -> Floats:
        return np.asarray(x) @ self.rotation.T

    def mesh(self, mesh: TriMesh) -> TriMesh:
        return TriMesh(self.points(mesh.vertices), mesh.faces)


def random_rigid(rng: np.random.Generator) -> Rigid:
    """A uniformly random rotation and a shift of about unit length."""
    q, r = np.linalg.qr(rng.normal(size=(3, 3)))
    q = q * np.sign(np.diag(r))
    q[:, 0] *= np.sign(np.linalg.det(q))
    return Rigid(q, rng.normal(size=3))


@dataclass(frozen=True)
class Relabelled:
    """The same surface under other numbers.

    Vertex i of the old mesh is ``vertex[i]`` of the new one, face f is ``face[f]``, and its corner
    k is corner ``(k + shift[f]) % 3``.
    """

    mesh: TriMesh
    vertex: Ints
    face: Ints
    shift: Ints


def relabel(mesh: TriMesh, rng: np.random.Generator) -> Relabelled:
    """Vertices and faces in a random order, and the corners of each face turned at random."""
    vertex, face = rng.permutation(mesh.n_vertices), rng.permutation(mesh.n_faces)
    shift = rng.integers(0, 3, mesh.n_faces)
    v = np.zeros_like(mesh.vertices)
    v[vertex] = mesh.vertices
    turned = np.take_along_axis(mesh.faces, (np.arange(3) - shift[:, None]) % 3, axis=1)
    f = np.zeros_like(mesh.faces)
    f[face] = vertex[turned]
    return Relabelled(TriMesh(v, f), vertex, face, shift)


# ---- the suite ------------------------------------------------------------------------------


@dataclass(frozen=True)
class Case:
    """A mesh of the suite and what is true of it."""

    name: str
    build: Callable[[], TriMesh]
    euler: int
    loops: int = 0
    components: int = 1
    sharp: bool = False

    def __str__(self) -> str:
        return self.name

    @cached_property
    def mesh(self) -> TriMesh:
        return self.build()


CLOSED = [
    Case("tetrahedron", tetrahedron, 2, sharp=True),
    Case("icosphere", icosphere, 2),
    Case("blob", blob, 2),
    Case("torus", torus, 0),
    Case("cube", cube, 2, sharp=True),
    Case("plate_with_holes", plate_with_holes, -2, sharp=True),
    Case("pretzel", pretzel, -2),
    Case("two_spheres", two_spheres, 4, components=2),
]
OPEN = [
    Case("one_triangle", one_triangle, 1, loops=1),
    Case("grid", grid, 1, loops=1),
    Case("grid_with_hole", lambda: grid(9, 9, hole=True), 0, loops=2),
    Case("disk", disk, 1, loops=1),
    Case("sheet", sheet, 1, loops=1),
    Case("rolled_sheet", lambda: sheet(turn=5.0), 1, loops=1),
    Case("open_cylinder", open_cylinder, 0, loops=2),
    Case("cone", cone, 1, loops=1),
    Case("half_sphere", half_sphere, 1, loops=1),
    Case("punctured_torus", punctured_torus, -1, loops=1),
    Case("sphere_and_sheet", sphere_and_sheet, 3, loops=1, components=2),
]
EVERY = CLOSED + OPEN


# ---- building blocks ------------------------------------------------------------------------


def midpoint_split(v: Floats, f: Ints) -> Soup:
    """Each triangle in four, new vertices at the middle of the edges."""
    n = len(v)
    pair = np.sort(np.stack([f, np.roll(f, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1)
    key, inverse = np.unique(pair[:, 0] * np.int64(n) + pair[:, 1], return_inverse=True)
    middle = n + inverse.reshape(-1, 3)
    a, b, c = f.T
    ab, bc, ca = middle.T
    parts = [[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]
    new = 0.5 * (v[key // n] + v[key % n])
    return np.vstack([v, new]), np.concatenate([np.stack(p, axis=1) for p in parts])


def circle_angles(n: int) -> Floats:
    return 2.0 * np.pi * np.arange(n) / n


def _lattice(nu: int, nv: int, wrap_u: bool = False, wrap_v: bool = False) -> Ints:
    """Faces of an nu x nv lattice of vertices (index u * nv + v), counter-clockwise in (u, v)."""
    q = _squares(nu, nv, wrap_u, wrap_v)
    return np.stack([q[:, [0, 1, 2]], q[:, [0, 2, 3]]], axis=1).reshape(-1, 3)


def _squares(nu: int, nv: int, wrap_u: bool = False, wrap_v: bool = False) -> Ints:
    u, v = np.meshgrid(
        np.arange(nu if wrap_u else nu - 1), np.arange(nv if wrap_v else nv - 1), indexing="ij"
    )
    u, v = u.reshape(-1), v.reshape(-1)
    a, b = u * nv + v, (u + 1) % nu * nv + v
    c, d = (u + 1) % nu * nv + (v + 1) % nv, u * nv + (v + 1) % nv
    return np.stack([a, b, c, d], axis=1)


def _voxel_quads(solid: NDArray[np.bool_], size: float) -> Soup:
    """Outer squares of a set of voxels; centred at 0."""
    padded = np.pad(solid, 1)
    corners = []
    for axis in range(3):
        e1, e2 = np.eye(3, dtype=np.int64)[[(axis + 1) % 3, (axis + 2) % 3]]
        for outward in (0, 1):
            neighbour = np.roll(padded, 1 - 2 * outward, axis=axis)
            base = np.argwhere(padded & ~neighbour)
            base[:, axis] += outward
            square = np.stack([base, base + e1, base + e1 + e2, base + e2], axis=1)
            corners.append(square if outward else square[:, ::-1])
    quads = np.concatenate(corners)
    points, index = np.unique(quads.reshape(-1, 3), axis=0, return_inverse=True)
    return (points - np.array(padded.shape) / 2.0) * size, index.reshape(-1, 4)


def voxel_arrays(solid: NDArray[np.bool_], size: float) -> Soup:
    """The same squares, each cut in two."""
    v, q = _voxel_quads(solid, size)
    return v, np.stack([q[:, [0, 1, 2]], q[:, [0, 2, 3]]], axis=1).reshape(-1, 3)


def _voxel_surface(solid: NDArray[np.bool_], size: float) -> TriMesh:
    return TriMesh(*voxel_arrays(solid, size))


def voxels(solid: object) -> TriMesh:
    """Surface of unit voxels where `solid` is true; non-manifold where voxels meet at an edge."""
    return _voxel_surface(np.asarray(solid, dtype=bool), 1.0)

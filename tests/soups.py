"""Soups broken on purpose: `SOUPS` maps names to builders of (V, F) arrays.

No `TriMesh` should be made of these unrepaired.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from tests.meshes import Soup, circle_angles, icosphere, moved, tetrahedron, torus, voxel_arrays
from vhquad.mesh.triangle import TriMesh


def unwelded(mesh: TriMesh | None = None) -> Soup:
    """Each face with three vertices of its own, as in an STL file."""
    mesh = mesh or icosphere(1)
    return mesh.vertices[mesh.faces].reshape(-1, 3), np.arange(3 * mesh.n_faces).reshape(-1, 3)


def with_duplicate_faces() -> Soup:
    """Two faces of a sphere repeated, one as it is and one reversed."""
    mesh = icosphere(1)
    f = mesh.faces
    return mesh.vertices.copy(), np.vstack([f, f[3:4, [1, 2, 0]], f[7:8, ::-1]])


def with_cap() -> Soup:
    """A tetrahedron with a zero-area cap: vertex 4 is the middle of the edge (0, 1)."""
    t = tetrahedron()
    v = np.vstack([t.vertices, t.vertices[[0, 1]].mean(axis=0)])
    return v, np.vstack([t.faces[1:], [[0, 4, 2], [4, 1, 2], [0, 1, 4]]])


def with_needle() -> Soup:
    """A sphere with a vertex doubled: two zero-area needles stand in the slit."""
    mesh = icosphere(1)
    i = mesh.edges[20, 0]
    h = mesh.edge_halfedges[20]
    b, c = (mesh.faces.reshape(-1)[3 * (k // 3) + (k + 2) % 3] for k in h)
    new = mesh.n_vertices
    f = mesh.faces.copy()
    ring = np.flatnonzero((f == i).any(axis=1))
    side = [k for k in ring if k in (h[0] // 3, h[1] // 3)]
    f[side] = np.where(f[side] == i, new, f[side])
    needles = [[i, new, b], [new, i, c]]
    return np.vstack([mesh.vertices, mesh.vertices[i]]), np.vstack([f, needles])


def three_fins() -> Soup:
    """Three squares (six faces) on one edge: non-manifold."""
    a = 2 * np.pi * np.arange(3) / 3
    outer = np.stack([np.cos(a), np.sin(a), np.zeros(3)], axis=1)
    v = np.vstack([[[0, 0, 0], [0, 0, 1]], outer, outer + np.array([0, 0, 1.0])])
    f = [[0, 2 + k, 5 + k] for k in range(3)] + [[0, 5 + k, 1] for k in range(3)]
    return v, np.array(f)


def bowtie() -> Soup:
    """Two tetrahedra that share one vertex."""
    v = tetrahedron().vertices
    f = tetrahedron().faces
    other = 2 * v[0] - v
    return np.vstack([v, other[1:]]), np.vstack([f, np.where(f == 0, 0, f + 3)[:, ::-1]])


def two_cubes_on_an_edge() -> Soup:
    """Two closed cubes that share one edge (four faces on it)."""
    solid = np.zeros((2, 2, 1), dtype=bool)
    solid[0, 0, 0] = solid[1, 1, 0] = True
    return voxel_arrays(solid, 1.0)


def doubled_edge() -> Soup:
    """Faces that stay together about both ends of a crowded edge: it needs another vertex."""
    v = [[2, 2, 2], [0, 1, 1], [1, 1, 0], [2, 1, 1], [2, 0, 1], [0, 0, 2]]
    f = [[0, 3, 1], [1, 0, 2], [1, 2, 0], [3, 2, 0], [5, 4, 1], [4, 0, 1], [4, 1, 3], [5, 4, 0]]
    return np.array(v, dtype=np.float64), np.array([*f, [1, 5, 3], [4, 3, 0]])


def mixed_winding() -> Soup:
    """A sphere with every third face reversed."""
    mesh = icosphere(1)
    f = mesh.faces.copy()
    f[::3] = f[::3, ::-1]
    return mesh.vertices.copy(), f


def inside_out() -> Soup:
    """A torus with all faces reversed."""
    mesh = torus()
    return mesh.vertices.copy(), mesh.faces[:, ::-1].copy()


def moebius(n: int = 24) -> Soup:
    """A strip with a half twist: not orientable."""
    u = circle_angles(n)
    s = np.array([-0.3, 0.3])
    r = 1.0 + s * np.cos(u / 2)[:, None]
    v = np.stack([r * np.cos(u)[:, None], r * np.sin(u)[:, None], s * np.sin(u / 2)[:, None]], -1)
    i = np.arange(n)
    a, b = 2 * i, 2 * i + 1
    c, d = np.roll(a, -1), np.roll(b, -1)
    c[-1], d[-1] = d[-1], c[-1]
    return v.reshape(-1, 3), np.vstack([np.stack([a, c, b], 1), np.stack([b, c, d], 1)])


def unused_vertices() -> Soup:
    """A triangle among vertices that no face names, one of them NaN."""
    v = np.array([[9, 9, 9], [0, 0, 0], [np.nan, 0, 0], [1, 0, 0], [0, 1, 0], [5, 5, 5]], float)
    return v, np.array([[1, 3, 4]])


def several_broken_parts() -> Soup:
    """A reversed sphere, an unwelded sphere, a strip of slivers of zero area and two fins."""
    parts = [inside_out(), unwelded(moved(icosphere(1), (4.0, 0, 0))), three_fins()]
    line = np.array([[7.0, 0, 0], [7.5, 0, 0], [8, 0, 0], [8.5, 0, 0]])
    parts.append((line, np.array([[0, 1, 2], [1, 2, 3]])))
    v, f, start = [], [], 0
    for part_v, part_f in parts:
        v.append(part_v + np.array([0.0, 0.0, 5.0 * len(v)]))
        f.append(part_f + start)
        start += len(part_v)
    return np.vstack(v), np.vstack(f)


SOUPS: dict[str, Callable[[], Soup]] = {
    "unwelded": unwelded,
    "with_duplicate_faces": with_duplicate_faces,
    "with_cap": with_cap,
    "with_needle": with_needle,
    "three_fins": three_fins,
    "bowtie": bowtie,
    "doubled_edge": doubled_edge,
    "two_cubes_on_an_edge": two_cubes_on_an_edge,
    "mixed_winding": mixed_winding,
    "inside_out": inside_out,
    "moebius": moebius,
    "unused_vertices": unused_vertices,
    "several_broken_parts": several_broken_parts,
}

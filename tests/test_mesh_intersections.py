"""Self-intersections: by hand, against brute force, and none where surfaces only touch."""

from __future__ import annotations

import time

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from tests.quad_meshes import cube_sphere, quad_grid, quad_torus
from vhquad.mesh.intersections import self_intersections
from vhquad.mesh.quad import QuadMesh
from vhquad.mesh.quality import check_quads

Floats = np.ndarray


def join(*parts: tuple[Floats, np.ndarray]) -> QuadMesh:
    start = np.cumsum([0, *(len(v) for v, _ in parts)])
    return QuadMesh(
        np.concatenate([v for v, _ in parts]),
        np.concatenate([q + s for (_, q), s in zip(parts, start, strict=False)]),
    )


def brute_force(mesh: QuadMesh) -> set[tuple[int, int]]:
    """All pairs, edge against triangle by solving for the point; exact ties do not occur."""
    triangles = mesh.triangles()
    found = set()
    for i in range(len(triangles)):
        for j in range(len(triangles)):
            a, b = sorted((i // 2, j // 2))
            if a == b or set(mesh.quads[a]) & set(mesh.quads[b]) or (a, b) in found:
                continue
            p, q = mesh.vertices[triangles[i]], mesh.vertices[triangles[j]]
            for k in range(3):
                step = p[(k + 1) % 3] - p[k]
                matrix = np.stack([q[1] - q[0], q[2] - q[0], -step], axis=1)
                if abs(np.linalg.det(matrix)) > 1e-14:
                    u, v, t = np.linalg.solve(matrix, p[k] - q[0])
                    if u > 0 and v > 0 and u + v < 1 and 0 < t < 1:
                        found.add((a, b))
    return found


def test_two_crossing_squares() -> None:
    """Four squares, of which only the upright one and the lying one below it cross."""
    v = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    up = [[0.5, 0.2, -0.5], [0.5, 0.8, -0.5], [0.5, 0.8, 0.5], [0.5, 0.2, 0.5]]
    far = [[5, 0, 0], [6, 0, 0], [6, 1, 0], [5, 1, 0]]
    mesh = QuadMesh(np.array(v + up + far, dtype=float), np.arange(12).reshape(3, 4))
    np.testing.assert_array_equal(self_intersections(mesh), [[0, 1]])


def test_none_in_sound_surfaces() -> None:
    for quads in (quad_torus(), cube_sphere(), quad_grid()):
        assert len(self_intersections(QuadMesh(*quads))) == 0


def test_touching_is_not_cutting() -> None:
    """A copy in the same place, a lid upon a lid, a square that stands on another."""
    v, q = quad_grid(4, 4)
    assert len(self_intersections(join((v, q), (v, q)))) == 0
    assert len(self_intersections(join((v, q), (v + np.array([0.3, 0.2, 0.0]), q)))) == 0
    standing = v[:, [2, 0, 1]] * [1, 0.5, 0.5] + [1.3, 0.7, 0.0]
    assert len(self_intersections(join((v, q), (standing, q)))) == 0
    assert len(self_intersections(join((v, q), (standing - [0, 0, 0.1], q)))) > 0


def test_neighbours_do_not_count() -> None:
    """A quad folded over its neighbour shares vertices with it: that is for other figures."""
    v, q = quad_grid(2, 1)
    v = v.copy()
    v[4:] += [-1.7, 0.0, 0.2]
    assert len(self_intersections(QuadMesh(v, q))) == 0


def test_against_brute_force() -> None:
    v, q = quad_torus(7, 5)
    mesh = join((v, q), (v[:, [0, 2, 1]] * [1, -1, 1] + [0.31, 0.11, 0.05], q))
    found = self_intersections(mesh)
    assert len(found) > 10
    assert {tuple(pair) for pair in found.tolist()} == brute_force(mesh)


@given(st.integers(0, 10_000), st.integers(2, 12), st.floats(0.05, 1.0))
def test_random_quads(seed: int, count: int, size: float) -> None:
    """Quads at random, some huge, none flat: the same pairs as by brute force."""
    rng = np.random.default_rng(seed)
    scale = size * rng.choice([0.2, 1.0, 5.0], count)
    corners = rng.normal(size=(count, 1, 3)) + scale[:, None, None] * rng.normal(size=(count, 4, 3))
    mesh = QuadMesh(corners.reshape(-1, 3), np.arange(4 * count).reshape(-1, 4))
    assert {tuple(pair) for pair in self_intersections(mesh).tolist()} == brute_force(mesh)


def test_few_and_none() -> None:
    v, q = quad_grid(1, 1)
    assert self_intersections(QuadMesh(v, q)).shape == (0, 2)
    assert self_intersections(QuadMesh(v, q[:0])).shape == (0, 2)
    same = QuadMesh(np.zeros((8, 3)), np.arange(8).reshape(2, 4))
    assert self_intersections(same).shape == (0, 2)


def test_figures_of_many_quads() -> None:
    """Two tori of 5,000 quads through each other, in far less than two seconds; in the report."""
    v, q = quad_torus(100, 50)
    mesh = join((v, q), (v[:, [0, 2, 1]] * [1, -1, 1] + [0.5, 0.0, 0.0], q))
    start = time.process_time()
    count = len(self_intersections(mesh))
    assert time.process_time() - start < 2.0
    assert count > 100
    assert check_quads(mesh).self_intersections == count

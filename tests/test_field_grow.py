"""grow_creases: what belongs to a crease comes back, noise and round folds stay out."""

from __future__ import annotations

import numpy as np

from tests.meshes import cube, icosphere
from tests.test_field_sharpness import folded
from vhquad.field.features import find_creases, sharp_edges
from vhquad.field.grow import grow_creases, with_steps
from vhquad.field.sharpness import side_angles
from vhquad.mesh.triangle import TriMesh


def grown_at_40(mesh: TriMesh, pairs: np.ndarray) -> np.ndarray:
    return grow_creases(mesh, pairs, sharp_edges(mesh, 40.0), 40.0)


def edges_of(pairs: np.ndarray) -> set[tuple[int, int]]:
    return {(int(min(p)), int(max(p))) for p in pairs}


def beside_a_cube(mesh: TriMesh) -> tuple[TriMesh, np.ndarray]:
    """A mesh and, behind it, a cube with most of all sharp edges; the creases of the cube."""
    box = cube(4)
    vertices = np.concatenate([mesh.vertices, 1000.0 * box.vertices + 2000.0])
    faces = np.concatenate([mesh.faces, box.faces + mesh.n_vertices])
    return TriMesh(vertices, faces), find_creases(box, 40.0) + mesh.n_vertices


def test_the_rest_of_a_crease_comes_back() -> None:
    mesh = cube(6)
    creases = find_creases(mesh, 40.0)
    some = creases[::5]
    assert len(grown_at_40(mesh, some)) == len(some)  # most sharp edges are no creases
    some = creases[15:]
    grown = grown_at_40(mesh, some)
    np.testing.assert_array_equal(grown[: len(some)], some)
    assert edges_of(grown) == edges_of(creases)
    assert len(grown) == len(creases)


def test_a_crease_that_turns_into_a_chamfer_goes_on() -> None:
    """Two steps of 50 degrees, a column apart: each takes half of the bend and is no crease.

    Where a crease goes over into one of them, that one is kept, over its whole length.
    """
    mesh = folded(2, np.radians(100), n=24)
    sharp = sharp_edges(mesh, 40.0)
    assert len(find_creases(mesh, 40.0)) == 0
    assert (side_angles(mesh, sharp) > np.radians(60)).all()
    pairs = mesh.edges[sharp]
    column = np.rint(mesh.vertices[pairs[:, 0], 0] * 1e6)
    one = pairs[column == column[0]]
    both, others = beside_a_cube(mesh)
    grown = grown_at_40(both, np.concatenate([one[:2], others]))
    assert edges_of(grown) == edges_of(one) | edges_of(others)


def test_a_round_fold_does_not_join() -> None:
    """Of three steps of 50 degrees, the middle one sees all three bend the surface."""
    mesh = folded(3, np.radians(150), n=24)
    sharp = sharp_edges(mesh, 40.0)
    inner = np.argsort(side_angles(mesh, sharp))[-8:]
    first = mesh.edges[sharp[inner[:1]]]
    both, others = beside_a_cube(mesh)
    start = np.concatenate([first, others])
    assert len(grown_at_40(both, start)) == len(start)


def test_noise_does_not_join() -> None:
    sphere = icosphere(4)
    rng = np.random.default_rng(0)
    noisy = TriMesh(sphere.vertices * (1 + 0.03 * rng.normal(size=(2562, 1))), sphere.faces)
    sharp = sharp_edges(noisy, 40.0)
    both, others = beside_a_cube(noisy)
    few = np.concatenate([noisy.edges[sharp[::100]], others])
    assert len(sharp) > 1000
    assert len(grown_at_40(both, few)) < len(few) + 0.05 * len(sharp)


def test_nothing_grows_from_nothing() -> None:
    assert grown_at_40(cube(3), np.zeros((0, 2), np.int64)).shape == (0, 2)


def test_long_steps_of_a_designed_part_are_kept() -> None:
    """Three steps of 50 degrees, each 0.7 long, beside a cube; on their own they stay out."""
    mesh = folded(3, np.radians(150), n=24)
    steps = edges_of(mesh.edges[sharp_edges(mesh, 40.0)])
    both, others = beside_a_cube(mesh)
    sharp = sharp_edges(both, 40.0)
    assert edges_of(with_steps(both, others, sharp, 0.69)) == steps | edges_of(others)
    assert edges_of(with_steps(both, others, sharp, 0.71)) == edges_of(others)
    alone = sharp_edges(mesh, 40.0)
    one = mesh.edges[alone][:1]
    assert edges_of(with_steps(mesh, one, alone, 0.1)) == edges_of(one)

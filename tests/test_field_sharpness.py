"""Creases told from noise and round folds on shapes where the answer is plain."""

from __future__ import annotations

import numpy as np
import pytest

from tests.data_paths import data_file
from tests.exports import bored_block, dome_on_square
from tests.meshes import cube, grid, icosphere, torus
from vhquad.field.features import dihedral_angles, find_creases, sharp_edges
from vhquad.field.sharpness import chain_labels, side_angles
from vhquad.mesh.load import load
from vhquad.mesh.triangle import TriMesh


def folded(steps: int, total: float, n: int = 12) -> TriMesh:
    """A strip of 2 n columns; in its middle it bends by ``total``, over ``steps`` columns."""
    flat = grid(2 * n, 8, 2.0, 0.7)
    at = np.arange(2 * n) - n + 1 - (steps - 1) // 2
    heading = np.cumsum(np.where((at > 0) & (at <= steps), total / steps, 0.0))
    x = np.concatenate([[0.0], np.cumsum(np.cos(heading))]) / n
    z = np.concatenate([[0.0], -np.cumsum(np.sin(heading))]) / n
    column = np.rint(flat.vertices[:, 0] * n).astype(int)
    return TriMesh(np.stack([x[column], flat.vertices[:, 1], z[column]], axis=1), flat.faces)


def test_one_bend_is_a_crease_and_three_steps_are_a_fold() -> None:
    sharp, round_ = folded(1, np.radians(90)), folded(3, np.radians(150))
    # 1. the single edge row is found whole
    assert len(sharp_edges(sharp, 40.0)) == len(find_creases(sharp, 40.0)) == 8
    # 2. each step of the fold is as sharp as asked for, but none bends the surface all at once
    assert len(sharp_edges(round_, 40.0)) == 24
    assert len(find_creases(round_, 40.0)) == 0


def test_sides_of_a_known_bend() -> None:
    mesh = folded(1, np.radians(75))
    edges = sharp_edges(mesh, 40.0)
    np.testing.assert_allclose(np.degrees(side_angles(mesh, edges)), 75.0, atol=1e-6)


@pytest.mark.parametrize("n", [12, 32, 90])
@pytest.mark.parametrize("lean", [0.0, 4.0, 6.0])
def test_long_triangles_of_planes_hide_no_creases(n: int, lean: float) -> None:
    """A block with a hole, straight or leaning, has 12 edges and two rims."""
    mesh = bored_block(n, 8.0, lean)
    assert mesh.euler_characteristic == 0
    assert len(find_creases(mesh, 40.0)) == 12 + 2 * n == len(sharp_edges(mesh, 40.0))


@pytest.mark.parametrize("n", [24, 48, 96])
def test_long_triangles_beside_fine_ones_hide_no_crease(n: int) -> None:
    """The rim of a dome on a square: it alone is sharp."""
    mesh = dome_on_square(n)
    found = mesh.vertices[find_creases(mesh, 40.0)]
    assert len(found) == n
    assert np.abs(found[..., 2]).max() == 0.0
    assert (mesh.n_components, mesh.euler_characteristic) == (1, 1)


@pytest.mark.parametrize("around", [(24, 8), (12, 8), (16, 8)])
def test_rings_of_planar_quads_stay_round(around: tuple[int, int]) -> None:
    """Of 8 sides across: an edge bends by 45 degrees, as do the next ones."""
    mesh = torus(*around)
    assert len(sharp_edges(mesh, 40.0)) >= around[0]
    assert len(find_creases(mesh, 40.0)) == 0


def test_noise_makes_no_creases() -> None:
    sphere = icosphere(4)
    rng = np.random.default_rng(0)
    noisy = TriMesh(sphere.vertices * (1 + 0.03 * rng.normal(size=(2562, 1))), sphere.faces)
    assert len(sharp_edges(noisy, 40.0)) > 1000
    assert len(find_creases(noisy, 40.0, shortest=0.5)) < 0.05 * len(sharp_edges(noisy, 40.0))


def test_noise_does_not_hide_creases() -> None:
    mesh = cube(12)
    rng = np.random.default_rng(0)
    noisy = TriMesh(mesh.vertices + 0.004 * rng.normal(size=mesh.vertices.shape), mesh.faces)
    assert dihedral_angles(noisy).max() > np.radians(95)
    assert len(find_creases(noisy, 40.0)) >= 0.95 * 144


def test_chains_end_where_creases_branch() -> None:
    mesh = cube(3)
    pairs = mesh.edges[sharp_edges(mesh, 40.0)]
    label = chain_labels(mesh, pairs)
    assert np.bincount(label).tolist() == [3] * 12


@pytest.mark.parametrize(
    ("name", "least", "most"),
    [
        ("cad_bracket", 0.97, 1.0),
        ("wingnut", 0.85, 1.0),
        ("penguin", 0.0, 0.1),
        ("head_remeshed", 0.0, 0.5),
    ],
)
def test_machine_parts_keep_theirs_and_creatures_have_few(
    name: str, least: float, most: float
) -> None:
    mesh = load(data_file("tris", f"{name}.obj")).mesh
    shortest = 2.5 * np.sqrt(mesh.area / 2000)
    share = len(find_creases(mesh, 40.0, shortest)) / len(sharp_edges(mesh, 40.0))
    assert least <= share <= most

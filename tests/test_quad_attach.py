"""attach_to_creases: edges come to lie on creases beside them, nothing else moves."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.data_paths import data_file
from tests.quad_meshes import quad_grid
from vhquad.api import remesh
from vhquad.field.features import sharp_edges
from vhquad.mesh.closest import ClosestPoints
from vhquad.mesh.load import load
from vhquad.mesh.quad import QuadMesh
from vhquad.mesh.quality import scaled_jacobians
from vhquad.mesh.triangle import TriMesh
from vhquad.quad.attach import attach_to_creases
from vhquad.quad.curves import CurveConstraints
from vhquad.quad.sliding import Pulls

Floats = NDArray[np.float64]
NONE = CurveConstraints.none(13 * 17)


def flat(nx: int = 16, ny: int = 12) -> tuple[QuadMesh, ClosestPoints, NDArray[np.bool_]]:
    """Unit squares, what they lie on, and their border."""
    mesh = QuadMesh(*quad_grid(nx, ny))
    x, y = mesh.vertices.T[:2]
    border = (x == 0) | (x == nx) | (y == 0) | (y == ny)
    return mesh, ClosestPoints(TriMesh(mesh.vertices, mesh.triangles())), border


def off(mesh: QuadMesh, vertices: Floats, line: Floats, count: int = 200) -> Floats:
    """Distances of points of a line from the nearest edges of moved quads."""
    t = np.linspace(0.0, 1.0, count)[:, None]
    points = (1 - t) * line[0] + t * line[1]
    a, b = vertices[mesh.edges].transpose(1, 0, 2)
    side = b - a
    share = np.einsum("pei,ei->pe", points[:, None] - a, side) / (side**2).sum(axis=1)
    gap = points[:, None] - a - np.clip(share, 0, 1)[..., None] * side
    return np.asarray(np.linalg.norm(gap, axis=2).min(axis=1))


def test_an_edge_chain_moves_onto_a_line_beside_it() -> None:
    mesh, surface, border = flat()
    line = np.array([[5.0, 6.3, 0.0], [11.0, 6.3, 0.0]])
    assert off(mesh, mesh.vertices, line).mean() > 0.15
    moved = attach_to_creases(mesh.vertices, mesh.quads, surface, border, NONE, line[None])
    assert off(mesh, moved, line).mean() < 0.03
    assert np.array_equal(moved[border], mesh.vertices[border])
    assert scaled_jacobians(QuadMesh(moved, mesh.quads)).min() > 0.5


def test_the_gradient_of_pulls_is_that_of_their_energy(rng: np.random.Generator) -> None:
    x = rng.standard_normal((7, 3))
    edges = np.array([[0, 1], [1, 2], [0, 1], [5, 3]])
    pulls = Pulls(edges, rng.random(4), rng.standard_normal((4, 3)), 2.5)
    gradient = pulls.cost(x)[1]
    for i, axis in np.ndindex(7, 3):
        step = np.zeros((7, 3))
        step[i, axis] = 1e-6
        slope = (pulls.cost(x + step)[0] - pulls.cost(x - step)[0]) / 2e-6
        assert gradient[i, axis] == pytest.approx(slope, abs=1e-7)


def test_quads_far_away_stay() -> None:
    mesh, surface, border = flat(24, 12)
    line = np.array([[4.0, 6.3, 0.0], [8.0, 6.3, 0.0]])
    none = CurveConstraints.none(mesh.n_vertices)
    moved = attach_to_creases(mesh.vertices, mesh.quads, surface, border, none, line[None])
    far = mesh.vertices[:, 0] > 12
    assert np.array_equal(moved[far], mesh.vertices[far])
    assert not np.array_equal(moved, mesh.vertices)


@pytest.mark.parametrize(
    "line",
    [
        pytest.param([[3.0, 6.0, 0.0], [11.0, 6.0, 0.0]], id="followed"),
        pytest.param([[4.0, 3.0, 0.0], [10.0, 9.0, 0.0]], id="across"),
    ],
)
def test_creases_that_edges_follow_or_cross_move_nothing(line: list[list[float]]) -> None:
    mesh, surface, border = flat()
    moved = attach_to_creases(mesh.vertices, mesh.quads, surface, border, NONE, np.array([line]))
    assert np.array_equal(moved, mesh.vertices)


def test_no_crease_moves_nothing() -> None:
    mesh, surface, border = flat()
    moved = attach_to_creases(mesh.vertices, mesh.quads, surface, border, NONE, np.zeros((0, 2, 3)))
    assert np.array_equal(moved, mesh.vertices)


@pytest.mark.parametrize("degrees", [4.0, 8.0, 15.0])
def test_the_left_out_side_of_a_narrow_wedge_is_met(degrees: float) -> None:
    """One side along a row of edges, the other at an angle that leaves no room for quads."""
    mesh, surface, held = flat()
    x, y = mesh.vertices.T[:2]
    held |= (y == 6) & (x >= 4) & (x <= 12)
    rise = 8 * np.tan(np.radians(degrees))
    sides = np.array([[[4.0, 6, 0], [12.0, 6, 0]], [[4.0, 6, 0], [12.0, 6 + rise, 0]]])
    moved = attach_to_creases(mesh.vertices, mesh.quads, surface, held, NONE, sides)
    before, after = (off(mesh, v, sides[1]).mean() for v in (mesh.vertices, moved))
    assert after < 0.2 * before
    assert np.array_equal(moved[held], mesh.vertices[held])
    assert scaled_jacobians(QuadMesh(moved, mesh.quads)).min() >= 0.1


def test_narrow_and_curved_creases_of_a_part_are_met() -> None:
    """Mean distance of a wingnut's creases from the edges, 0.02 % of the diagonal at most."""
    mesh = load(data_file("tris", "wingnut.obj")).mesh
    result = remesh(mesh.vertices, mesh.faces, method="curvature", target_quads=2000)
    creases = mesh.vertices[mesh.edges[sharp_edges(mesh, 40.0)]]
    length = np.linalg.norm(creases[:, 1] - creases[:, 0], axis=1)
    quads = result.quads
    gaps = np.array([off(quads, quads.vertices, line, 21).mean() for line in creases])
    assert np.average(gaps, weights=length) < 2e-4 * mesh.diagonal
    assert result.report.quality.folded_quads == 0

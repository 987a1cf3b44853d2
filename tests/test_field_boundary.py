"""Boundary corners and tangents against loops whose course is known."""

from __future__ import annotations

import numpy as np
import pytest

from tests.field_checks import check_aligned
from tests.meshes import OPEN, Case, cone, disk, grid, half_sphere, open_cylinder
from vhquad.field.align import AlignSettings, align_field
from vhquad.field.boundary import boundary_tangents
from vhquad.field.cross import CrossField
from vhquad.field.smooth import smoothest
from vhquad.mesh.triangle import TriMesh


def no_field(mesh: TriMesh) -> CrossField:
    """Nothing known: the boundary alone decides."""
    return CrossField("faces", np.zeros(mesh.n_faces))


def rough_disk(rings: int, noise: float, seed: int) -> TriMesh:
    """A disk whose boundary vertices were pushed in and out by a share of the edge length."""
    flat = disk(rings)
    rng = np.random.default_rng(seed)
    rim = flat.is_boundary_vertex
    factor = np.where(rim, 1.0 + noise / rings * rng.uniform(-1, 1, flat.n_vertices), 1.0)
    return TriMesh(flat.vertices * factor[:, None], flat.faces)


def uneven_disk(rings: int) -> TriMesh:
    """A round disk without the six-fold symmetry of its lattice, which no cross field likes."""
    flat = disk(rings)
    shift = np.random.default_rng(0).uniform(-0.2, 0.2, flat.vertices.shape) / rings
    shift[flat.is_boundary_vertex] = shift[:, 2] = 0.0
    return TriMesh(flat.vertices + shift, flat.faces)


def test_a_rectangle_has_four_corners_and_straight_sides() -> None:
    mesh = grid(8, 6)
    found = boundary_tangents(mesh, 0.2)
    # 1. exactly the four corners of the rectangle
    at = mesh.vertices[mesh.tail[found.corner]]
    assert sorted(map(tuple, at[:, :2].tolist())) == [(0, 0), (0, 0.75), (1, 0), (1, 0.75)]
    # 2. the sides are straight already
    np.testing.assert_allclose(found.lean, 0.0, atol=1e-9)


def test_round_loops_have_no_corner_however_coarse() -> None:
    for mesh in (disk(6), open_cylinder(), cone(), half_sphere(3)):
        for edge_length in (0.05, 0.2, 0.5):
            assert not boundary_tangents(mesh, edge_length).corner.any()


def test_rough_boundary_is_smoothed_towards_the_circle() -> None:
    mesh = rough_disk(16, 0.2, 3)
    found = boundary_tangents(mesh, 4.0 / 16)
    assert not found.corner.any()
    # The tangent of the circle at the middle of each boundary edge, against edge and fit.
    h = np.flatnonzero(mesh.twin < 0)
    p, q = mesh.vertices[mesh.tail[h], :2], mesh.vertices[mesh.head[h], :2]
    edge = np.angle((q - p) @ [1, 1j])
    circle = np.angle((p + q) @ [1, 1j]) + np.pi / 2
    before = np.angle(np.exp(1j * (edge - circle)))
    after = np.angle(np.exp(1j * (edge + found.lean[h] - circle)))
    assert np.abs(after).mean() < 0.5 * np.abs(before).mean()


@pytest.mark.parametrize("case", OPEN, ids=str)
@pytest.mark.parametrize("edge_length", [0.03, 0.3])
def test_boundaries_decide_where_no_field_is_known(case: Case, edge_length: float) -> None:
    mesh = case.mesh
    check_aligned(mesh, align_field(mesh, no_field(mesh), None, AlignSettings(edge_length)))


def test_disk_cylinder_and_hole_get_the_indices_they_must() -> None:
    # 1. a disk with a smooth rim: four valence-3 vertices, the rim straight everywhere
    mesh = uneven_disk(10)
    round_disk = align_field(mesh, no_field(mesh))
    assert round_disk.report.singularities == {3: 4}
    assert set(round_disk.sector_quads[round_disk.sector_is_feature]) == {2}
    # 2. a tube needs nothing
    tube = align_field(open_cylinder(), no_field(open_cylinder()))
    assert tube.report.singularities == {}
    # 3. a square frame: four corners of one quad outside, four of three inside
    frame = grid(9, 9, height=1.0, hole=True)
    aligned = align_field(frame, no_field(frame))
    assert aligned.report.singularities == {}
    counts = np.bincount(aligned.sector_quads[aligned.sector_is_feature])
    assert counts[1] == 4
    assert counts[3] == 4


@pytest.mark.parametrize("seed", range(4))
def test_the_loop_index_of_a_rough_disk_does_not_depend_on_the_noise(seed: int) -> None:
    mesh = rough_disk(12, 0.25, seed)
    rng = np.random.default_rng(seed)
    z = smoothest(mesh) * np.exp(1j * rng.uniform(-0.8, 0.8, mesh.n_faces))
    aligned = align_field(mesh, CrossField("faces", z), None, AlignSettings(0.2))
    check_aligned(mesh, aligned)
    assert set(aligned.sector_quads[aligned.sector_is_feature]) == {2}

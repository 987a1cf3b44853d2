"""Seamless maps: the plane and the cylinder as they are, and exact integers everywhere."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.map_stages import NAMES, field_along, made, noisy, stages
from tests.meshes import blob, grid, random_rigid
from vhquad.geometry.frames import face_axes, to_3d
from vhquad.mesh.triangle import next_halfedge
from vhquad.quad.seamless_map import (
    UNITS_PER_EDGE,
    rotate,
    size_weights,
    solve_seamless_map,
    twice_area,
)


@pytest.mark.parametrize("name", NAMES)
def test_valid_on_every_analytic_mesh(name: str) -> None:
    s = stages(name)
    assert s.seamless.is_valid
    assert (twice_area(s.seamless.uv) > 0).all()
    # The area of the image is near what the sizes ask for: the map does not shrink, save on the
    # cone, where four singularities crowd about the apex and directions go before sizes.
    asked = float((s.aligned.mesh.face_areas / s.aligned.size**2).sum())
    assert (0.25 if name == "cone" else 0.6) * asked < s.seamless.area < 1.15 * asked


@pytest.mark.parametrize("name", NAMES)
def test_snapped_to_integers_exactly(name: str) -> None:
    s = stages(name)
    mesh, m = s.aligned.mesh, s.seamless
    corner = m.uv.reshape(-1, 2)
    # 1. transitions hold to the last bit at both ends of every edge, and are antisymmetric
    h = np.flatnonzero(mesh.twin >= 0)
    for near, far in ((h, next_halfedge(mesh.twin[h])), (next_halfedge(h), mesh.twin[h])):
        there = rotate(corner[near], m.rotation[h]) + m.translation[h]
        np.testing.assert_array_equal(there, corner[far])
    back = rotate(m.translation[h], m.rotation[mesh.twin[h]])
    np.testing.assert_array_equal(m.translation[mesh.twin[h]], -back)
    # 2. whatever moves an isoline is a multiple of 4 ...
    assert (m.translation % 4 == 0).all()
    special = s.tracing.special[mesh.tail]
    assert (corner[special] % 4 == 0).all()
    on = np.flatnonzero(s.aligned.feature)
    fixed = corner[next_halfedge(on)] == corner[on]
    assert (fixed.sum(axis=1) == 1).all()
    assert (corner[on][fixed] % 4 == 0).all()
    # 3. ... and ordinary vertices are odd, so that no isoline meets them
    plain = ~special
    plain[np.isin(mesh.tail, mesh.tail[on])] = False
    assert (corner[plain] % 2 == 1).all()


@pytest.mark.parametrize("name", ["grid", "hole"])
def test_flat_meshes_are_mapped_by_a_similarity(name: str) -> None:
    s = stages(name)
    edge = np.abs(np.roll(s.seamless.uv, -1, axis=1) - s.seamless.uv).astype(float)
    length = np.linalg.norm(edge, axis=2) * s.seamless.unit * s.edge
    # Rounding moves a corner by 4 units at most, of 2^20 a mean edge.
    np.testing.assert_allclose(length, s.aligned.mesh.edge_lengths, rtol=30 / UNITS_PER_EDGE)


def test_cylinder_unrolls() -> None:
    s = stages("cylinder")  # 24-gon of radius 1, height 2
    girth, height = 24 * 2 * np.sin(np.pi / 24), 2.0
    assert s.seamless.area == pytest.approx(girth * height / s.edge**2, rel=1e-4)
    shift = np.abs(s.seamless.translation).max(axis=0).max() * s.seamless.unit * s.edge
    assert shift == pytest.approx(girth, rel=1e-4)


def test_sizes_steer_the_map() -> None:
    # Twice the size to the right of the middle: isolines there are farther apart.
    mesh = grid(16, 12)
    s = made(mesh, z=field_along(mesh, np.tile([1.0, 0.0, 0.0], (mesh.n_faces, 1))))
    right = s.aligned.mesh.vertices[s.aligned.mesh.faces].mean(axis=1)[:, 0] > 0.5
    sized = replace(s.aligned, size=np.where(right, 2.0, 1.0) * s.edge)
    m = solve_seamless_map(sized)
    share = twice_area(m.uv) / (m.unit**-2) / (2 * s.aligned.mesh.face_areas)
    assert m.is_valid
    assert share[~right].mean() > 1.5 * share[right].mean()


def test_directions_are_kept_before_sizes() -> None:
    # No map has sizes that change along and across a straight field: isolines bend, or quads do
    # not get their size. They bend far less than if both counted alike.
    mesh = grid(16, 16)
    s = made(mesh, z=field_along(mesh, np.tile([1.0, 0.0, 0.0], (mesh.n_faces, 1))))
    refined = s.aligned.mesh
    p = refined.vertices[refined.faces]
    x, y = p.mean(axis=1)[:, 0], p.mean(axis=1)[:, 1]
    sized = replace(s.aligned, size=s.edge * (1.0 + 2.0 * np.maximum(x, y)))
    direction = np.exp(1j * s.aligned.angle)
    along = to_3d(direction, face_axes(refined))[:, :2]

    def lean(size_weight: float) -> float:
        """Mean angle between the isolines of v and the field, degrees."""
        m = solve_seamless_map(sized, size_weight=size_weight)
        assert m.is_valid
        d = (m.uv[:, 1:] - m.uv[:, :1]).astype(float)
        gradient = np.linalg.solve(p[:, 1:, :2] - p[:, :1, :2], d)[:, :, 0]
        cosine = (gradient * along).sum(axis=1) / np.linalg.norm(gradient, axis=1)
        return float(np.degrees(np.arccos(np.clip(cosine, -1, 1))).mean())

    assert lean(0.1) < 0.6 * lean(1.0)


def test_sizes_count_less_where_the_field_is_sure() -> None:
    turn = np.array([0.0, 0.5, 1.0, 3.0])
    doubted, sure = (size_weights(turn, np.full(4, t)) for t in (0.0, 1.0))
    # 1: in doubt, the turn of the surface, at least 0.1; 2: if sure, a tenth of its third power.
    np.testing.assert_allclose(doubted, [0.1, 0.5, 1.0, 1.0])
    np.testing.assert_allclose(sure, [0.01, 0.0125, 0.1, 1.0])
    # 3: the geometric mean between, and sizes count again where the surface turns much.
    np.testing.assert_allclose(size_weights(turn, np.full(4, 0.5)), np.sqrt(doubted * sure))


def test_motion_and_scale_change_nothing(rng: np.random.Generator) -> None:
    s = stages("blob")
    moved = replace(s.aligned, mesh=random_rigid(rng).mesh(s.aligned.mesh))
    again = solve_seamless_map(moved)
    np.testing.assert_array_equal(again.rotation, s.seamless.rotation)
    np.testing.assert_allclose(
        again.uv * again.unit, s.seamless.uv * s.seamless.unit, atol=16 * s.seamless.unit
    )


def test_noise_is_survived(rng: np.random.Generator) -> None:
    mesh = blob(3)
    calls: list[tuple[int, int]] = []
    s = made(mesh, quads=400, z=noisy(mesh, 1.0, rng))
    m = solve_seamless_map(s.aligned, on_solve=lambda solves, flips: calls.append((solves, flips)))
    assert m.is_valid
    # The callback saw every solve, and the last one had no folds.
    assert [n for n, _ in calls] == list(range(1, m.solves + 1))
    assert calls[-1][1] == m.flips == 0


def test_a_fold_is_counted() -> None:
    uv = np.array([[[0, 0], [3, 0], [0, 5]], [[0, 0], [0, 5], [3, 0]], [[0, 0], [2, 2], [4, 4]]])
    assert twice_area(uv).tolist() == [15, -15, 0]
    m = replace(stages("grid").seamless, flips=1)
    assert not m.is_valid


def test_a_wrong_angle_is_counted() -> None:
    # The field now asks for seven quads around a vertex where the map turns by three.
    s = stages("sphere")
    v = np.flatnonzero(s.aligned.sector_quads == 3)[0]
    quads = s.aligned.sector_quads.copy()
    quads[v] = 7
    m = solve_seamless_map(replace(s.aligned, sector_quads=quads))
    assert (m.flips, m.wrong_angles) == (0, 1)
    assert not m.is_valid


def test_quarter_turns() -> None:
    z = np.array([[3, 1]] * 5)
    turned = rotate(z, np.array([0, 1, 2, 3, -1]))
    assert turned.tolist() == [[3, 1], [-1, 3], [-3, -1], [1, -3], [1, -3]]

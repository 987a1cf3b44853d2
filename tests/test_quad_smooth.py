"""smooth_quads: unfolds, squares up, keeps surface, curves and corners."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from tests.map_stages import stages
from tests.quad_meshes import (
    Quads,
    bound_to_rim,
    cube_sphere,
    quad_disk,
    quad_grid,
    quad_torus,
    shaken,
    triangulated,
)
from vhquad.errors import MeshError
from vhquad.mesh.closest import ClosestPoints, Hits
from vhquad.mesh.quad import QuadMesh
from vhquad.mesh.vectors import cross
from vhquad.quad import descent, smooth
from vhquad.quad.aspects import smoothed_aspects
from vhquad.quad.corners import ahead, behind, cross_rows
from vhquad.quad.curves import CurveConstraints
from vhquad.quad.distortion import (
    corner_jacobians,
    directions,
    distortion,
    misalignment,
    quad_normals,
)
from vhquad.quad.embed import embed_layout
from vhquad.quad.guide import FieldGuide
from vhquad.quad.sliding import Problem, State, folded_quads
from vhquad.quad.smooth import smooth_quads, smoothed_sizes

NOBODY = np.zeros(0, dtype=np.int64)


def quad_edges(x: np.ndarray, q: np.ndarray) -> np.ndarray:
    """The four edges of each quad, in its order; (k, 4, 3)."""
    return x[np.roll(q, -1, axis=1)] - x[q]


def outward(quads: Quads, x: np.ndarray) -> np.ndarray:
    """Surface normals near the quads, from the closest points of their centres."""
    mesh = triangulated(quads)
    return mesh.face_normals[ClosestPoints(mesh).query(x[quads[1]].mean(axis=1)).face]


@pytest.mark.parametrize("quads", [cube_sphere(8), quad_torus()], ids=["cube_sphere", "torus"])
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_closed_surfaces_unfold(quads: Quads, seed: int) -> None:
    mesh = triangulated(quads)
    x = shaken(quads, np.random.default_rng(seed), 1.5, NOBODY)
    surface = ClosestPoints(mesh)
    x = surface.query(x).point
    before = folded_quads(x, quads[1], outward(quads, x))
    out = smooth_quads(x, quads[1], surface)
    # 1: the test means something: a fifth of the quads came folded.
    assert before.mean() > 0.2
    # 2: none is left.
    assert not folded_quads(out, quads[1], outward(quads, out)).any()
    # 3: angles are good; the undisturbed meshes have least scaled Jacobians of 0.87 and above.
    assert corner_jacobians(out, quads[1], quad_normals(out, quads[1])).min() > 0.6
    # 4: on the surface, to rounding.
    assert surface.query(out).distance.max() < 1e-12


def test_it_ends_where_nothing_is_left_to_gain(monkeypatch: pytest.MonkeyPatch) -> None:
    quads = quad_torus()
    x = shaken(quads, np.random.default_rng(0), 0.5, NOBODY)
    surface = ClosestPoints(triangulated(quads))
    ask, steps, least = surface.query, [0, 0], []
    for number, stale in enumerate((descent.STALE, -1.0)):  # the latter: never

        def counted(points: np.ndarray, number: int = number) -> Hits:
            steps[number] += 1
            return ask(points)

        monkeypatch.setattr(surface, "query", counted)
        monkeypatch.setattr(descent, "STALE", stale)
        out = smooth_quads(x, quads[1], surface, iterations=120)
        least.append(corner_jacobians(out, quads[1], quad_normals(out, quads[1])).min(axis=1))
    assert steps[0] < 0.5 * steps[1]
    np.testing.assert_allclose(least[0].mean(), least[1].mean(), atol=1e-3)


def test_a_strip_squeezed_to_nothing_opens() -> None:
    quads = quad_torus(30, 12)
    x = quads[0].reshape(30, 12, 3).copy()
    x[10] = x[11] = 0.5 * (x[10] + x[11])
    x[20] = 0.9 * x[20] + 0.1 * x[21]
    x[21] = 1.2 * x[20] - 0.2 * x[21]  # turned over
    x = x.reshape(-1, 3)
    assert folded_quads(x, quads[1], outward(quads, x)).sum() >= 24
    out = smooth_quads(x, quads[1], ClosestPoints(triangulated(quads)))
    assert not folded_quads(out, quads[1], outward(quads, out)).any()
    # The strips take their share again: no rung shorter than a third of the mean.
    rung = np.linalg.norm(
        np.roll(out.reshape(30, 12, 3), -1, axis=0) - out.reshape(30, 12, 3), axis=2
    )
    assert rung.min() > rung.mean() / 3


def test_another_attempt_moves_what_is_near_a_fold_only(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where nothing else unfolds it, on a mesh that is good everywhere else."""
    v, q = quad_grid(60, 60)
    x = v.copy()
    swapped = np.flatnonzero((v[:, 1] == 30) & np.isin(v[:, 0], [30, 31]))
    x[swapped] = x[swapped[::-1]]
    monkeypatch.setattr(smooth, "FOLDED_ROUNDS", ())
    whole = smooth.descend

    def descend(problem: Problem, state: State, *rest: Any) -> State:
        return state if len(problem.quads) == len(q) else whole(problem, state, *rest)

    monkeypatch.setattr(smooth, "descend", descend)
    rim = (v[:, :2] % 60 == 0).any(axis=1)
    up = np.tile([0.0, 0.0, 1.0], (len(q), 1))
    assert folded_quads(x, q, up).sum() == 2
    out = smooth_quads(x, q, ClosestPoints(triangulated((v, q))), rim)
    assert not folded_quads(out, q, up).any()
    far = np.abs(v[:, :2] - 30.5).max(axis=1) > 15
    np.testing.assert_array_equal(out[far], v[far])
    assert np.abs(out - v).max() < 0.05


def test_flat_grid_comes_back_exactly() -> None:
    quads = quad_grid(12, 10)
    v, q = quads
    corner = np.flatnonzero(np.isin(v[:, 0], [0, 12]) & np.isin(v[:, 1], [0, 10]))
    sides = [v[:, 1] == 0, v[:, 0] == 12, v[:, 1] == 10, v[:, 0] == 0]
    curve = np.full(len(v), -1)
    for i, side in enumerate(sides):
        curve[side] = i
    corners = np.array([[0, 0, 0], [12, 0, 0], [12, 10, 0], [0, 10, 0.0]])
    lines = [corners[[i, (i + 1) % 4]] for i in range(4)]
    fixed = np.isin(np.arange(len(v)), corner)
    x = shaken(quads, np.random.default_rng(4), 0.8, np.flatnonzero(curve >= 0))
    x[curve == 0] += [0.3, 0, 0] * (~fixed[curve == 0])[:, None]
    out = smooth_quads(
        x,
        q,
        ClosestPoints(triangulated(quads)),
        fixed,
        CurveConstraints(lines, [False] * 4, curve),
        iterations=100,
        target_edge=np.ones(len(v)),
    )
    # Unit squares are the only minimum of the energy, which is smooth there: L-BFGS gets close.
    assert np.abs(out - v).max() < 1e-4


def test_boundary_slides_on_its_circle() -> None:
    quads = quad_disk(6, 6)
    v, q = quads
    mesh, rim, circle = bound_to_rim(quads)
    rng = np.random.default_rng(0)
    x = shaken(quads, rng, 0.9, rim)
    arc = circle.locate(rim, v[rim])
    x[rim] = circle.position(rim, arc + 0.4 * rng.uniform(-1, 1, len(rim)) * np.diff(arc).mean())
    out = smooth_quads(x, q, ClosestPoints(mesh), curves=circle)
    # 1: no folds, 2: on the polyline to rounding, 3: vertices did move along it.
    assert not folded_quads(out, q, np.tile([0, 0, 1.0], (len(q), 1))).any()
    at = circle.position(rim, circle.locate(rim, out[rim]))
    assert np.abs(at - out[rim]).max() < 1e-12
    assert np.linalg.norm(out[rim] - x[rim], axis=1).max() > 1e-3


def test_fixed_vertices_do_not_move_and_good_meshes_stay_good() -> None:
    quads = cube_sphere(6)
    v, q = quads
    fixed = np.zeros(len(v), dtype=bool)
    fixed[[0, 17, 40]] = True
    before = corner_jacobians(v, q, quad_normals(v, q)).min()
    out = smooth_quads(v, q, ClosestPoints(triangulated(quads)), fixed)
    assert (out[fixed] == v[fixed]).all()
    assert corner_jacobians(out, q, quad_normals(out, q)).min() > min(before, 0.8) - 1e-9


def test_thin_sheet_keeps_its_sides() -> None:
    """Two parallel layers much closer than an edge: no vertex changes layer."""
    v, q = quad_grid(10, 10)
    lift = np.array([0, 0, 0.05])
    top, bottom = v + lift, v - lift
    both = np.concatenate([top, bottom]), np.concatenate([q, q[:, ::-1] + len(v)])
    mesh = triangulated(both)
    edge = np.flatnonzero(mesh.is_boundary_vertex)
    x = shaken(both, np.random.default_rng(1), 1.2, edge)
    out = smooth_quads(x, both[1], ClosestPoints(mesh), mesh.is_boundary_vertex)
    assert np.abs(out[:, 2] - both[0][:, 2]).max() < 1e-12
    assert not folded_quads(out, both[1], outward(both, both[0])).any()


def test_target_edges_steer_density() -> None:
    quads = quad_torus(40, 16)
    v, q = quads
    wanted = np.where(v[:, 0] > 0, 2.0, 1.0)
    out = smooth_quads(v, q, ClosestPoints(triangulated(quads)), target_edge=wanted, iterations=60)
    area = lambda x: np.linalg.norm(  # noqa: E731
        np.cross(x[q[:, 2]] - x[q[:, 0]], x[q[:, 3]] - x[q[:, 1]]), axis=1
    )
    big = v[q].mean(axis=1)[:, 0] > 0
    # The torus starts even; afterwards the wanted half is clearly larger.
    assert area(v)[big].mean() == pytest.approx(area(v)[~big].mean(), rel=0.05)
    assert area(out)[big].mean() > 1.2 * area(out)[~big].mean()


def test_gradient_is_that_of_the_energy(rng: np.random.Generator) -> None:
    v, q = cube_sphere(2)
    x = v + 0.4 * rng.normal(size=v.shape)  # some corners folded
    n, size = quad_normals(v, q), np.full(len(q), 0.7)
    for epsilon in (0.3, 0.05):
        at = distortion(x, q, n, size, epsilon, 0.3)
        assert (at.area < 0).any()
        direction = rng.normal(size=v.shape)
        h = 1e-6
        ahead = distortion(x + h * direction, q, n, size, epsilon, 0.3, False).energy
        behind = distortion(x - h * direction, q, n, size, epsilon, 0.3, False).energy
        # Central differences: error about h², far below the tolerance.
        slope = (at.gradient * direction).sum()
        assert (ahead - behind) / (2 * h) == pytest.approx(slope, rel=1e-5)


def test_gradient_towards_oblong_quads(rng: np.random.Generator) -> None:
    v, q = cube_sphere(2)
    x = v + 0.2 * rng.normal(size=v.shape)
    n, size = quad_normals(x, q), rng.uniform(0.5, 1.0, len(q))
    aspect = rng.uniform(0.5, 2.0, len(q))
    along = rng.normal(size=(len(q), 3))
    along /= np.linalg.norm(along, axis=1, keepdims=True)

    def cost(x: np.ndarray) -> tuple[float, np.ndarray]:
        at = distortion(x, q, n, size, 0.1, 0.3, aspect=aspect)
        off, pull = misalignment(x, q, directions(n, along), size, aspect=aspect)
        return at.energy + off, at.gradient + pull

    move, h = rng.normal(size=v.shape), 1e-6
    slope = (cost(x + h * move)[0] - cost(x - h * move)[0]) / (2 * h)
    # Central differences, as above.
    assert slope == pytest.approx((cost(x)[1] * move).sum(), rel=1e-5)


def test_a_rectangle_is_the_minimum_if_asked_for() -> None:
    v, q = quad_grid(1, 1)
    n, size, aspect = np.array([[0, 0, 1.0]]), np.ones(1), np.full(1, 4.0)
    x = v * [2.0, 0.5, 1.0]  # edges 0 and 2 run along x
    at = distortion(x, q, n, size, 1e-9, 0.3, aspect=aspect)
    assert at.energy == pytest.approx(4 * 1.3, abs=1e-12)
    assert np.abs(at.gradient).max() < 1e-12


def test_aspects_are_those_of_a_grid_however_quads_are_numbered(rng: np.random.Generator) -> None:
    v, q = quad_grid(8, 6)
    turn = rng.integers(0, 4, len(q))
    turned = q[np.arange(len(q))[:, None], (np.arange(4) + turn[:, None]) % 4]
    even = np.where(turn % 2 == 0, 1.5, 1 / 1.5)
    # 1: averaging changes nothing where all are alike; 2: none is longer than twice its width.
    np.testing.assert_allclose(smoothed_aspects(v * [1.5, 1, 1], turned), even, rtol=1e-12)
    far = smoothed_aspects(v * [5.0, 1, 1], turned)
    np.testing.assert_allclose(np.maximum(far, 1 / far), 2.0, rtol=1e-12)


def test_aspects_of_uneven_rows_even_out() -> None:
    v, q = quad_grid(10, 10)
    x = v.copy()
    x[:, 0] += np.where(v[:, 0] % 2 == 1, 0.3, 0.0)  # columns 1.3 and 0.7 wide in turn
    off = lambda rounds: float(np.abs(np.log(smoothed_aspects(x, q, rounds))).mean())  # noqa: E731
    assert off(0) == pytest.approx(0.5 * np.log(1.3 / 0.7))
    assert off(2) < 0.4 * off(0)


def test_cross_products_and_neighbouring_corners(rng: np.random.Generator) -> None:
    a, b = rng.normal(size=(2, 7, 4, 3))
    np.testing.assert_array_equal(cross(a, b), np.cross(a, b))
    np.testing.assert_array_equal(cross(a, b[:, :1]), np.cross(a, b[:, :1]))  # broadcast
    rows = cross_rows(a.transpose(2, 1, 0), b.transpose(2, 1, 0))
    np.testing.assert_array_equal(rows.transpose(2, 1, 0), np.cross(a, b))
    np.testing.assert_array_equal(ahead(rows), np.roll(rows, -1, axis=1))
    np.testing.assert_array_equal(behind(rows[0]), np.roll(rows[0], 1, axis=0))


def test_edges_off_a_direction_cost_their_share_across() -> None:
    v, q = quad_grid(3, 2)
    n, size = np.tile([0.0, 0.0, 1.0], (len(q), 1)), np.full(len(q), 2.0)
    first = quad_edges(v, q)[:, 0]

    def cost(angle: float) -> float:
        c, s = np.cos(angle), np.sin(angle)
        along = first @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1.0]])
        return misalignment(v, q, directions(n, along), size)[0]

    # Four unit edges a quad, each with sin(angle) across, over s = 2.
    assert cost(0.0) == pytest.approx(0.0, abs=1e-30)
    assert cost(0.3) == pytest.approx(len(q) * 0.5 * 4 * (np.sin(0.3) / 2) ** 2)
    assert cost(0.3 + np.pi) == pytest.approx(cost(0.3))
    energy, gradient = misalignment(v, q, directions(n, np.zeros_like(first)), size)
    assert energy == 0.0
    assert not gradient.any()
    # By its weight, and to the bit where that is 1.
    plain = misalignment(v, q, directions(n, first + 0.1), size)[0]
    assert misalignment(v, q, directions(n, first + 0.1, np.ones(len(q))), size)[0] == plain
    weight = np.arange(float(len(q)))
    each = [
        misalignment(v, q[[i]], directions(n[[i]], first[[i]] + 0.1), size[[i]])[0]
        for i in range(len(q))
    ]
    total = misalignment(v, q, directions(n, first + 0.1, weight), size)[0]
    assert total == pytest.approx(weight @ each)


def test_gradient_of_the_misalignment(rng: np.random.Generator) -> None:
    v, q = cube_sphere(2)
    x = v + 0.2 * rng.normal(size=v.shape)
    n, size = quad_normals(x, q), rng.uniform(0.5, 1.0, len(q))
    along = rng.normal(size=(len(q), 3))
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    across = directions(n, along, rng.uniform(1.0, 2.0, len(q)))
    _, gradient = misalignment(x, q, across, size)
    move, h = rng.normal(size=v.shape), 1e-5
    ahead = misalignment(x + h * move, q, across, size)[0]
    behind = misalignment(x - h * move, q, across, size)[0]
    # The energy is quadratic: central differences are exact up to rounding.
    assert (ahead - behind) / (2 * h) == pytest.approx((gradient * move).sum(), rel=1e-8)


def test_a_guided_polish_keeps_to_the_field(monkeypatch: pytest.MonkeyPatch) -> None:
    s = stages("blob")
    mesh = s.aligned.mesh
    layout = s.quantise(300).layout
    quads = QuadMesh(embed_layout(layout, s.aligned, s.seamless), layout.quads)
    surface, guide = ClosestPoints(mesh), FieldGuide(s.aligned)

    def off(x: np.ndarray) -> float:
        edge = quad_edges(x, quads.quads)[:, 0]
        along = guide.along(guide.faces(x[quads.quads].mean(axis=1)), edge)
        cosine = (along * edge).sum(axis=1) / np.linalg.norm(edge, axis=1)
        return float(np.degrees(np.arccos(np.clip(cosine, -1, 1))).mean())

    free = smooth_quads(quads.vertices, quads.quads, surface)
    guided = smooth_quads(quads.vertices, quads.quads, surface, guide=guide)
    assert off(guided) < 0.8 * off(free)
    sure = FieldGuide(replace(s.aligned, trust=np.ones(mesh.n_faces)))
    strict = off(smooth_quads(quads.vertices, quads.quads, surface, guide=sure))
    assert strict < off(guided)
    monkeypatch.setattr(smooth, "SURELY", 1.0)  # the aspects alone
    assert strict < off(smooth_quads(quads.vertices, quads.quads, surface, guide=sure))
    assert (corner_jacobians(guided, quads.quads, quad_normals(guided, quads.quads)) > 0).all()


def test_the_guide_gives_the_nearest_arm() -> None:
    s = stages("grid")
    mesh = s.aligned.mesh
    centres = mesh.vertices[mesh.faces].mean(axis=1)
    for angle in np.radians([0, 30, 100, 200, 300]):
        near = np.tile([np.cos(angle), np.sin(angle), 0.0], (len(centres), 1))
        guide = FieldGuide(s.aligned)
        arm = guide.along(guide.faces(centres), near)
        turn = np.round(angle / (np.pi / 2)) * np.pi / 2  # the field runs along the axes
        np.testing.assert_allclose(
            arm, np.tile([np.cos(turn), np.sin(turn), 0], (len(arm), 1)), atol=1e-9
        )


def test_unit_square_is_the_minimum() -> None:
    v, q = quad_grid(1, 1)
    n, size = np.array([[0, 0, 1.0]]), np.ones(1)
    at = distortion(v, q, n, size, 1e-9, 0.3)
    # F = 1, D = 1: each corner costs 1 + λ, and the gradient vanishes.
    assert at.energy == pytest.approx(4 * 1.3, abs=1e-12)
    assert np.abs(at.gradient).max() < 1e-12


def test_sizes_keep_area_and_smooth_out() -> None:
    v, q = quad_grid(10, 10)
    x = v.copy()
    x[:, 0] = np.where(v[:, 0] == 5, 5.99, v[:, 0])
    size = smoothed_sizes(x, q, 100.0)
    assert (size**2).sum() == pytest.approx(100.0)
    assert size.min() > 0.7
    assert size.max() < 1.3


def test_bad_input_is_refused() -> None:
    v, q = quad_grid(2, 2)
    surface = ClosestPoints(triangulated((v, q)))
    with pytest.raises(MeshError, match="outside"):
        smooth_quads(v, q + 5, surface)
    with pytest.raises(MeshError, match="one entry a vertex"):
        smooth_quads(v, q, surface, fixed=[True])
    with pytest.raises(MeshError, match="no length"):
        CurveConstraints([[[0, 0, 0], [0, 0, 0]]], [False], np.full(9, -1))

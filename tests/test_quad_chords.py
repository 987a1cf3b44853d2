"""fit_chords and settle_on_curves: areas by hand and by brute force, kinks become vertices."""

from __future__ import annotations

import numpy as np
import pytest

from tests.quad_meshes import bound_to_rim, quad_disk
from vhquad.mesh.closest import ClosestPoints
from vhquad.quad.chords import Polyline, fit_chords
from vhquad.quad.curves import CurveConstraints
from vhquad.quad.distortion import corner_jacobians, quad_normals
from vhquad.quad.settle import settle_on_curves
from vhquad.quad.sliding import folded_quads, make_problem, place

Floats = np.ndarray


def circle(n: int, start: float = 0.0) -> Floats:
    angle = start + 2 * np.pi * np.arange(n) / n
    return np.stack([np.cos(angle), np.sin(angle), np.zeros(n)], axis=1)


def test_area_off_a_chord_of_a_circle() -> None:
    # A parabola of sag h over a chord c is off by h sqrt(8/15) in the root mean square.
    line = circle(4000)
    line = Polyline(np.concatenate([line, line[:1]]))
    angle = 0.2
    chord, sag = 2 * np.sin(angle / 2), 1 - np.cos(angle / 2)
    off = line.off(np.array([[1.0]]), np.array([[1.0 + angle]]))
    assert off.item() == pytest.approx(chord * sag * np.sqrt(8 / 15), rel=5e-3)


def test_area_off_a_chord_by_sampling(rng: np.random.Generator) -> None:
    points = np.cumsum(rng.uniform(0.1, 1.0, (9, 3)), axis=0) + 100.0
    line = Polyline(points)
    a, b = 0.3 * line.arc[-1], 0.8 * line.arc[-1]
    s = a + (b - a) * (np.arange(20000) + 0.5) / 20000
    x, (start, end) = line.at(s)[0], line.at(np.array([a, b]))[0]
    d = (end - start) / np.linalg.norm(end - start)
    away = x - start - ((x - start) @ d)[:, None] * d
    expected = (b - a) * np.sqrt((away**2).sum(axis=1).mean())
    assert line.off(np.array([a]), np.array([b])).item() == pytest.approx(expected, rel=1e-6)


def test_straight_chains_stay() -> None:
    curves = CurveConstraints([[[0, 0, 0], [1, 0, 0], [5, 0, 0]]], [False], [0, 0, 0])
    arc = np.array([1.3, 2.0, 4.1])
    assert np.abs(fit_chords(curves, np.arange(3), arc) - arc).max() < 1e-6


@pytest.mark.parametrize("n", [8, 24])
def test_vertices_go_to_the_kinks(n: int) -> None:
    # As many vertices as corners, a fifth of an edge beside them: the polygon is met exactly.
    polygon = circle(n)
    curves = CurveConstraints([polygon], [True], np.zeros(n, dtype=np.int64))
    edge = np.linalg.norm(polygon[1] - polygon[0])
    arc = edge * (np.arange(n) + 0.2)
    found = fit_chords(curves, np.arange(n), arc)
    x = curves.position(np.arange(n), found)
    assert np.abs(np.sort(np.linalg.norm(x, axis=1)) - 1).max() < 1e-9
    gap = np.diff(np.sort(np.mod(found, n * edge)))
    assert np.abs(gap - edge).max() < 1e-9


def test_sizes_along_a_circle_stay() -> None:
    # Steps of one to two: on a circle, whose bend is the same everywhere, they are as wanted.
    n = 24
    curves = CurveConstraints([circle(2400)], [True], np.zeros(n, dtype=np.int64))
    step = 1.5 + 0.5 * np.cos(2 * np.pi * np.arange(n) / n)
    arc = np.cumsum(step) * 2 * np.pi / step.sum() - 0.1
    found = fit_chords(curves, np.arange(n), arc)
    change = np.diff(found) / np.diff(arc)
    assert change.min() > 0.85
    assert change.max() < 1.15


def test_a_corner_between_straight_lines_is_taken() -> None:
    # An L of 4 + 4 with 7 vertices that all miss its corner.
    curves = CurveConstraints([[[0, 4, 0], [0, 0, 0], [4, 0, 0]]], [False], np.zeros(7, int))
    arc = np.arange(1, 8) + np.where(np.arange(1, 8) < 4, 0.0, 0.3)
    found = fit_chords(curves, np.arange(7), arc)
    assert np.abs(found - 4).min() < 1e-9
    assert (np.diff(found) > 0).all()


def test_a_disk_takes_its_rim_and_stays_good() -> None:
    quads = quad_disk(6, 6)
    v, q = quads
    mesh, rim, curves = bound_to_rim(quads)
    # Turned by a third of an edge, every rim vertex misses the kinks of the input's rim.
    arc = curves.locate(rim, v[rim])
    x = v.copy()
    x[rim] = curves.position(rim, arc + 0.3 * np.diff(arc).mean())
    surface = ClosestPoints(mesh)
    size = np.full(len(q), np.sqrt(mesh.area / len(q)))
    problem = make_problem(q, surface, curves, np.zeros(len(v), dtype=bool), size)
    state = place(problem, x, None)
    found = settle_on_curves(problem, state, 0.1).vertices
    missed = [np.linalg.norm(y[rim][:, None] - v[rim], axis=2).min(axis=0) for y in (x, found)]
    assert missed[0].min() > 0.02
    assert np.abs(missed[1]).max() < 1e-9
    assert not folded_quads(found, q, np.tile([0, 0, 1.0], (len(q), 1))).any()
    least = corner_jacobians(found, q, quad_normals(found, q)).min()
    assert least > 0.9 * corner_jacobians(v, q, quad_normals(v, q)).min()

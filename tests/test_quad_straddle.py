"""straddled: the L2 projection of creases onto edges; borders and straight creases stay."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.quad_meshes import quad_tube
from vhquad.mesh.closest import ClosestPoints
from vhquad.mesh.triangle import TriMesh
from vhquad.quad.curves import CurveConstraints
from vhquad.quad.straddle import straddled

Floats = NDArray[np.float64]


def tube(n: int, rows: int = 4) -> tuple[Floats, NDArray[np.int64], Floats]:
    """Quads of a tube of radius 1 with n around, and the height of each vertex in rows."""
    v, q = quad_tube(n, rows)
    row = v[:, 2].copy()
    v[:, :2] /= np.linalg.norm(v[:, :2], axis=1, keepdims=True)
    v[:, 2] *= 2 * np.pi / n
    return v, q, row


def surface_of(v: Floats, q: NDArray[np.int64]) -> ClosestPoints:
    return ClosestPoints(TriMesh(v, np.concatenate([q[:, [0, 1, 2]], q[:, [0, 2, 3]]])))


def circle(height: float, n: int = 4000) -> Floats:
    t = 2 * np.pi * np.arange(n) / n
    return np.stack([np.cos(t), np.sin(t), np.full(n, height)], axis=1)


@pytest.mark.parametrize("n", [8, 12, 30])
def test_a_circle_goes_where_its_projection_is_known(n: int) -> None:
    """Vertices at the radius 3 sinc(t/2)^2 / (2 + cos t) for n steps of t."""
    v, q, row = tube(n)
    curves = CurveConstraints([circle(v[row == 2, 2][0])], [True], np.where(row == 2, 0, -1))
    moved = straddled(v, q, surface_of(v, q), curves)
    step = 2 * np.pi / n
    known = 3 * (np.sin(step / 2) / (step / 2)) ** 2 / (2 + np.cos(step))
    assert np.linalg.norm(moved[row == 2, :2], axis=1) == pytest.approx(known, rel=1e-3)
    assert known - 1 == pytest.approx(2 / 3 * (1 - np.cos(step / 2)), rel=0.1)  # of the sag
    assert np.array_equal(moved[row != 2], v[row != 2])

    def mean_off(radius: float) -> float:
        """Of the circle from the polygon."""
        t = (np.arange(1000) + 0.5) / 1000 * step - step / 2
        return float(np.abs(radius * np.cos(step / 2) - np.cos(t)).mean())

    assert mean_off(known) < 0.45 * mean_off(1.0)


def test_borders_stay() -> None:
    v, q, row = tube(12)
    rims = [circle(v[row == r, 2][0]) for r in (0, 4)]
    curve = np.where(row == 0, 0, np.where(row == 4, 1, -1))
    assert np.array_equal(
        straddled(v, q, surface_of(v, q), CurveConstraints(rims, [True, True], curve)), v
    )


def test_straight_creases_stay() -> None:
    v, q, row = tube(12)
    along = np.flatnonzero((v[:, 1] == 0) & (v[:, 0] > 0) & (row > 0) & (row < 4))
    curve = np.full(len(v), -1)
    curve[along] = 0
    line = np.array([[1.0, 0, 0], [1.0, 0, v[:, 2].max()]])
    assert len(along) == 3
    moved = straddled(v, q, surface_of(v, q), CurveConstraints([line], [False], curve))
    assert np.abs(moved - v).max() < 1e-12


def test_the_ends_of_an_arc_stay() -> None:
    v, q, row = tube(16)
    angle = np.arctan2(v[:, 1], v[:, 0])
    inner = (row == 2) & (angle > 1e-9) & (angle < np.pi / 2 + 0.1)
    last = angle[inner].max()
    t = np.linspace(0, last, 500)
    arc = np.stack([np.cos(t), np.sin(t), np.full(500, v[row == 2, 2][0])], axis=1)
    inner &= angle < last - 1e-9
    moved = straddled(
        v, q, surface_of(v, q), CurveConstraints([arc], [False], np.where(inner, 0, -1))
    )
    assert np.array_equal(moved[~inner], v[~inner])
    assert (np.linalg.norm(moved[inner, :2], axis=1) > 1.001).all()


def test_quads_thinner_than_the_sag_turn_not() -> None:
    """A flat ring whose crease would go past the next circle, which turns the quads between."""
    n = 8
    v, q, row = tube(n)
    circles = np.array([0.6, 0.8, 1.0, 1.01, 1.4])
    v[:, :2] *= circles[row.astype(np.int64), None]
    v[:, 2] = 0.0
    curves = CurveConstraints([circle(0.0)], [True], np.where(row == 2, 0, -1))
    assert np.array_equal(straddled(v, q, surface_of(v, q), curves), v)
    v[row == 3, :2] *= 1.2 / 1.01
    assert np.linalg.norm(straddled(v, q, surface_of(v, q), curves)[row == 2], axis=1).min() > 1.02


def test_no_curves_move_nothing() -> None:
    v, q, _ = tube(8)
    assert straddled(v, q, surface_of(v, q), CurveConstraints.none(len(v))) is v

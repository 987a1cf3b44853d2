"""Conditions that keep special places and tubes apart: asked for when broken, and only then."""

from __future__ import annotations

import numpy as np
import pytest

from tests.map_stages import NAMES, Stages, stages
from tests.tmesh_cases import lengths, row
from vhquad.quad.layout import Layout, build_layout
from vhquad.quad.separation import Condition, loop_conditions, separation_conditions


def value(condition: Condition, n: np.ndarray) -> float:
    return float(sum(c * n[k] for k, c in condition.form))


def wanted(s: Stages, quads: int) -> np.ndarray:
    return s.tmesh.lengths * np.sqrt(quads / s.seamless.area)


def crowded(layout: Layout) -> int:
    """Special vertices that fell together with another."""
    nodes = np.flatnonzero(layout.tmesh.node_vertex >= 0)
    return len(nodes) - len(np.unique(layout.vertex_of[nodes]))


@pytest.mark.parametrize("name", sorted(set(NAMES) - {"torus"}))
def test_all_lengths_zero_ask_for_conditions(name: str) -> None:
    s = stages(name)
    zero = np.zeros(len(s.tmesh.arcs), dtype=np.int64)
    layout = build_layout(s.tmesh, zero)
    found = separation_conditions(layout, wanted(s, 200))
    assert found
    for condition in found:
        # 1. broken as it is; 2. kept by the true lengths; 3. a true combination of arcs
        assert value(condition, zero) < condition.bound
        assert value(condition, wanted(s, 10_000)) > 0
        assert all(c != 0 and 0 <= k < len(zero) for k, c in condition.form)
    assert len(set(found)) == len(found)


@pytest.mark.parametrize("target", [20, 200])
@pytest.mark.parametrize("name", NAMES)
def test_nothing_special_falls_together_in_the_end(name: str, target: int) -> None:
    s = stages(name)
    layout = s.quantise(target).layout
    assert separation_conditions(layout, wanted(s, target)) == []
    assert crowded(layout) == 0
    # Distinct stretches of features stay distinct: no vertex has more boundary than it should.
    tmesh = layout.tmesh
    points = [
        layout.half_arc_points(2 * a)[:-1]
        for a, arc in enumerate(tmesh.arcs)
        if arc.feature >= 0 and layout.lengths[a] > 0
    ]
    if points:
        inner = [p[p >= len(tmesh.node_points)] for p in points]
        label = layout.vertex_of[np.concatenate(inner)]
        assert len(np.unique(label)) == len(label)


def test_two_corners_of_a_rectangle_part() -> None:
    # Two rectangles, the right one without width: its right corners meet the middle nodes, which
    # are nothing special. Both without width: left and right corners meet.
    tmesh = row(2)
    scaled = lengths(2, [1, 1], 1) * 0.4
    fine = build_layout(tmesh, lengths(2, [1, 0], 1))
    assert separation_conditions(fine, scaled) == []
    bad = build_layout(tmesh, lengths(2, [0, 0], 1))
    found = separation_conditions(bad, scaled)
    assert found
    for condition in found:
        assert condition.bound == 1
        # a way from the left to the right, along the bottom or the top of each rectangle
        assert [k % 2 for k, _ in condition.form] == [0, 1]
        assert all(c == 1 and k < 4 for k, c in condition.form)
        assert value(condition, lengths(2, [1, 0], 1)) >= condition.bound


def test_a_flat_rectangle_parts_its_long_sides() -> None:
    found = separation_conditions(
        build_layout(row(1), lengths(1, [3], 0)), lengths(1, [3], 1) * 0.9
    )
    assert found
    assert all(c.form in (((2, 1),), ((3, 1),)) for c in found)


def test_thin_tubes_are_widened() -> None:
    s = stages("cylinder")
    layout = s.quantise(200).layout
    rims = [[a for a, arc in enumerate(s.tmesh.arcs) if arc.feature == c] for c in (0, 1)]
    assert loop_conditions(layout, wanted(s, 200)) == []
    for around, thin in ((1, True), (2, True), (3, False), (4, False)):
        n = np.array([3 * (arc.feature < 0) for arc in s.tmesh.arcs])
        for rim in rims:
            n[rim[0]] = around  # all of it in the longest piece; the other pieces vanish
        narrow = build_layout(s.tmesh, n)
        found = loop_conditions(narrow, wanted(s, 200))
        assert bool(found) == thin
        for condition in found:
            assert value(condition, n) < condition.bound <= 3


def test_the_coarsest_cube_is_left_alone() -> None:
    # One quad a side: no two edges join the same two corners.
    s = stages("cube")
    ones = np.ones(len(s.tmesh.arcs), dtype=np.int64)
    assert loop_conditions(build_layout(s.tmesh, ones), wanted(s, 6)) == []


def test_a_squashed_cube_is_opened() -> None:
    # A cube without height, two quads back to back: its upper corners must leave the lower ones.
    s = stages("cube")
    upright = [int(np.ptp(a.points[:, 2]) > 0.5) for a in s.tmesh.arcs]
    flat = 1 - np.array(upright)
    found = separation_conditions(build_layout(s.tmesh, flat), wanted(s, 6))
    assert found
    for condition in found:
        assert [upright[k] for k, _ in condition.form] == [1]

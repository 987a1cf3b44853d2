"""Quantised layouts: right topology and irregular vertices at any target, near the count asked."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.map_stages import NAMES, Stages, made, noisy, stages
from tests.meshes import grid, icosphere, open_cylinder, torus
from tests.tmesh_cases import lengths, row
from vhquad.mesh.quad import QuadMesh
from vhquad.mesh.triangle import TriMesh
from vhquad.quad.layout import Layout, side_length
from vhquad.quad.quantize import _Program, quantise


def check_layout(s: Stages, layout: Layout) -> QuadMesh:
    """Topology of the mesh, and irregular vertices exactly those of the field."""
    # 1. whole, not negative, opposite sides equal
    assert layout.lengths.dtype.kind == "i"
    assert (layout.lengths >= 0).all()
    for p in layout.tmesh.patches:
        a, b, c, d = (side_length(layout.lengths, side) for side in p.sides)
        assert (a, b) == (c, d)
    # 2. a manifold of the same topology, quads with four different corners
    quads = QuadMesh(np.random.default_rng(0).normal(size=(layout.n_vertices, 3)), layout.quads)
    assert quads.is_manifold
    assert len(quads.degenerate_quads) == 0
    assert quads.n_components == s.mesh.n_components
    assert quads.euler_characteristic == s.mesh.euler_characteristic
    assert quads.n_boundary_loops == len(s.mesh.boundary_loops)
    # 3. as many quads about each special vertex as the field asks for, and 4 (2) elsewhere
    aligned = s.aligned
    wanted = np.bincount(
        aligned.sector_vertex, aligned.sector_quads, minlength=aligned.mesh.n_vertices
    )
    count = np.bincount(layout.quads.ravel(), minlength=layout.n_vertices)
    nodes = np.flatnonzero(layout.tmesh.node_vertex >= 0)
    own = layout.vertex_of[nodes]
    assert len(np.unique(own)) == len(own)
    np.testing.assert_array_equal(count[own], wanted[layout.tmesh.node_vertex[nodes]])
    rest = np.ones(layout.n_vertices, dtype=bool)
    rest[own] = False
    on_rim = quads.is_boundary_vertex
    assert (count[rest & ~on_rim] == 4).all()
    assert (count[rest & on_rim] == 2).all()
    return quads


@pytest.mark.parametrize("name", NAMES)
def test_topology_at_every_target(name: str) -> None:
    s = stages(name)
    for target in (1, 6, 20, 60, 200, 1000):
        check_layout(s, s.quantise(target).layout)


@pytest.mark.parametrize("name", ["blob", "half_sphere", "pretzel", "bad_torus", "open_torus"])
def test_count_is_met_on_shapes_without_symmetry(name: str) -> None:
    s = stages(name)
    for target in (200, 1000, 3000):
        miss = len(s.quantise(target).layout.quads) / target
        assert abs(miss - 1) < (0.15 if target == 200 else 0.05)


@pytest.mark.parametrize("name", ["cube", "plate", "disk", "hole"])
def test_count_is_met_to_a_step_on_regular_shapes(name: str) -> None:
    # All arcs of a cube are equally long and grow together, from n to n + 1 quads.
    s = stages(name)
    for target in (200, 1000, 3000):
        step = 2 * np.sqrt(len(s.tmesh.patches) / target)
        miss = len(s.quantise(target).layout.quads) / target
        assert abs(np.log(miss)) < 1.2 * step


@given(
    target=st.integers(4, 600),
    strength=st.floats(0.0, 1.0),
    seed=st.integers(0, 10_000),
    shape=st.sampled_from(["sphere", "torus", "grid", "cylinder"]),
)
@settings(max_examples=25)
def test_topology_whatever_the_field(target: int, strength: float, seed: int, shape: str) -> None:
    build = {
        "sphere": lambda: icosphere(2),
        "torus": lambda: torus(16, 8),
        "grid": grid,
        "cylinder": lambda: open_cylinder(16, 6),
    }
    mesh: TriMesh = build[shape]()
    s = made(mesh, quads=max(target, 20), z=noisy(mesh, strength, np.random.default_rng(seed)))
    if s.seamless.is_valid:
        check_layout(s, s.quantise(target).layout)


def test_a_rectangle_gets_square_cells() -> None:
    s = stages("grid")  # 1 x 0.75
    for target, expected in ((12, (3, 4)), (48, (6, 8)), (300, (15, 20))):
        n = s.quantise(target).layout.lengths
        assert tuple(sorted(set(n.tolist()))) == expected


def test_a_torus_without_singularities() -> None:
    quads = check_layout(stages("torus"), stages("torus").quantise(300).layout)
    assert quads.irregular_interior == {}


def test_a_sphere_is_a_cube() -> None:
    s = stages("sphere")
    quads = check_layout(s, s.quantise(400).layout)
    assert quads.irregular_interior == {3: 8}
    assert s.quantise(1).layout.quads.shape[0] >= 6  # no mesh of fewer has eight 3-valent corners


def test_lengths_follow_the_wanted_ones() -> None:
    s = stages("blob")
    q = s.quantise(2000)
    wanted = s.tmesh.lengths * q.scale
    off = np.abs(q.layout.lengths - wanted)
    # Rounding moves an arc by a quad or so, and not by much more to make sides agree.
    assert np.median(off) < 0.6
    assert off.max() < 3.5
    assert q.scale == pytest.approx(np.sqrt(2000 / s.seamless.area), rel=0.1)


def test_a_row_by_hand() -> None:
    # Three rectangles 1 x 2 in 24 quads: each 2 x 4.
    q = quantise(row(3, width=1.0, height=2.0), 24.0, 6.0)
    np.testing.assert_array_equal(q.layout.lengths, lengths(3, [2, 2, 2], 4))
    assert q.conditions == 0
    # Thin ones far below a quad wide: one stays, so that left and right do not meet.
    q = quantise(row(4, width=0.05, height=1.0), 5.0, 0.2)
    assert Counter(q.layout.lengths[:4].tolist())[0] < 4
    assert q.conditions > 0 or q.layout.lengths[:4].sum() > 0


def test_rounding_up_spares_the_integer_program(monkeypatch: pytest.MonkeyPatch) -> None:
    # Rounding towards the wanted lengths ends between conditions here.
    def never(self: object) -> None:
        raise AssertionError("the integer program was asked")

    monkeypatch.setattr(_Program, "_search", never)
    s = stages("cone")
    ways = []
    rounded = _Program._rounded

    def watched(self: _Program, real: np.ndarray, up: bool) -> np.ndarray | None:
        ways.append(up)
        return rounded(self, real, up)

    monkeypatch.setattr(_Program, "_rounded", watched)
    found = quantise(s.tmesh, 400, s.seamless.area)
    assert True in ways
    check_layout(s, found.layout)
    assert found.n_quads == pytest.approx(400, rel=0.1)


def test_nothing_is_written_to_the_standard_output(capfd: pytest.CaptureFixture[str]) -> None:
    quantise(row(3, width=1.0, height=2.0), 24.0, 6.0)
    assert capfd.readouterr().out == ""


def test_same_again() -> None:
    s = stages("pretzel")
    a = quantise(s.tmesh, 500, s.seamless.area)
    b = quantise(s.tmesh, 500, s.seamless.area)
    np.testing.assert_array_equal(a.layout.lengths, b.layout.lengths)
    np.testing.assert_array_equal(a.layout.quads, b.layout.quads)

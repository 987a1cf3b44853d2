"""The integer-grid map of a layout: exact, unfolded, and cut by its isolines into the layout."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.map_stages import NAMES, Stages, made, noisy, stages
from tests.meshes import blob, icosphere, pretzel
from vhquad.errors import ParametrizationError
from vhquad.mesh.quad import QuadMesh
from vhquad.mesh.triangle import next_halfedge
from vhquad.quad.extract import extract_polygons
from vhquad.quad.grid import GRID
from vhquad.quad.integer_map import IntegerMap, integer_map
from vhquad.quad.layout import Layout, build_layout
from vhquad.quad.seamless_map import rotate

TARGETS = (20, 200)


def build(s: Stages, layout: Layout) -> IntegerMap:
    return integer_map(s.aligned, s.seamless, s.tracing, s.tmesh, layout)


@cache
def mapped(name: str, target: int) -> IntegerMap:
    s = stages(name)
    return build(s, s.quantise(target).layout)


def extracted(made: IntegerMap) -> QuadMesh:
    grid_uv = made.uv * GRID
    whole = np.rint(grid_uv).astype(np.int64)
    np.testing.assert_array_equal(whole, grid_uv)  # multiples of 1 / GRID, exactly
    found = extract_polygons(made.mesh, whole, made.rotation, made.translation * GRID)
    assert (np.diff(found.polygons.start) == 4).all()
    return QuadMesh(found.polygons.vertices, found.polygons.corners.reshape(-1, 4))


def colours(quads: NDArray[np.int64], rounds: int = 6) -> NDArray[np.int64]:
    """Colour refinement of the vertices by their quads: sorted, equal for isomorphic meshes."""
    colour = np.zeros(quads.max() + 1, dtype=np.int64)
    for _ in range(rounds):
        around = colour[quads]
        # A quad seen from each corner, with an orientation.
        seen = sum(np.roll(around, -k, axis=1) * p for k, p in enumerate((1, 7919, 104729, 31)))
        mixed = (seen * 2654435761 + 97) % 1_000_003
        total = np.bincount(quads.ravel(), mixed.ravel().astype(float), len(colour))
        colour = (total.astype(np.int64) * 48271 + colour * 16807) % 1_000_003
    return np.sort(colour)


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("name", NAMES)
def test_the_isolines_are_the_layout(name: str, target: int) -> None:
    layout = stages(name).quantise(target).layout
    found = extracted(mapped(name, target))
    # 1. as many quads and vertices; 2. the same mesh, as far as colour refinement sees
    assert (found.n_quads, found.n_vertices) == (len(layout.quads), layout.n_vertices)
    np.testing.assert_array_equal(colours(found.quads), colours(layout.quads))


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize("name", NAMES)
def test_the_map_is_exact(name: str, target: int) -> None:
    s, m = stages(name), mapped(name, target)
    mesh, corner = m.mesh, m.uv.reshape(-1, 2)
    # 1. nothing folds, and the area is the number of quads to the last bit
    assert m.is_valid
    assert m.flips == m.wrong_angles == 0
    assert m.area == pytest.approx(len(s.quantise(target).layout.quads), rel=1e-12)
    # 2. transitions are quarter turns and integers, at both ends of every edge
    h = np.flatnonzero(mesh.twin >= 0)
    for near, far in ((h, next_halfedge(mesh.twin[h])), (next_halfedge(h), mesh.twin[h])):
        there = rotate(corner[near], m.rotation[h]) + m.translation[h]
        np.testing.assert_array_equal(there, corner[far])
    # 3. special vertices are grid points, feature edges on isolines
    special = s.tracing.special[mesh.tail]
    np.testing.assert_array_equal(corner[special], np.rint(corner[special]))
    on = np.flatnonzero(s.aligned.feature)
    step = corner[next_halfedge(on)] - corner[on]
    fixed = step == 0
    assert (fixed.sum(axis=1) == 1).all()
    np.testing.assert_array_equal(corner[on][fixed], np.rint(corner[on][fixed]))
    # 4. no other vertex is on an isoline
    plain = np.ones(mesh.n_vertices, dtype=bool)
    plain[mesh.tail[on]] = plain[mesh.head[on]] = False
    inside = plain[mesh.tail] & ~special
    assert (corner[inside] != np.rint(corner[inside])).all()


def test_sides_of_a_rectangle() -> None:
    # A flat 1 x 0.75 grid in 8 x 6 quads: the map is the plane itself, scaled by 8 and turned.
    m = build(stages("grid"), stages("grid").quantise(48).layout)
    assert (m.translation == 0).all()
    uv, place = m.uv.reshape(-1, 2), m.mesh.vertices[m.mesh.tail][:, :2]
    assert sorted(np.ptp(uv, axis=0)) == [6.0, 8.0]
    corner = uv[np.argmin(place.sum(axis=1))]
    distance = np.linalg.norm(uv - corner, axis=1)
    np.testing.assert_allclose(distance, 8 * np.linalg.norm(place, axis=1), atol=4 / GRID)


@pytest.mark.parametrize("target", [60, 400])
def test_noisy_field(target: int, rng: np.random.Generator) -> None:
    mesh = blob(3)
    s = made(mesh, quads=target, z=noisy(mesh, 0.9, rng))
    assert sum(s.aligned.report.singularities.values()) > 8
    layout = s.quantise(target).layout
    m = build(s, layout)
    assert m.is_valid
    assert extracted(m).n_quads == len(layout.quads)


COARSE = ("bad_torus", "cone", "open_torus", "pretzel", "plate")


def test_the_careful_way_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("vhquad.quad.integer_map.SOLVES", 0)
    for name in COARSE:
        assert build(stages(name), stages(name).quantise(20).layout).is_valid


def test_folds_are_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    # With ordinary vertices left where the continuous map has them, coarse maps fold.
    monkeypatch.setattr("vhquad.quad.integer_map._moved", lambda task, _: task.start)
    monkeypatch.setattr("vhquad.quad.integer_map.SOLVES", 0)
    monkeypatch.setattr("vhquad.quad.integer_map.MOST_SPLITS", 0)
    for name in COARSE:
        left = build(stages(name), stages(name).quantise(20).layout)
        assert left.flips > 0
        assert not left.is_valid


def test_splits_make_room_where_the_mesh_has_none(monkeypatch: pytest.MonkeyPatch) -> None:
    # One quad to two triangles, with dozens of singularities: some of these have no room.
    mesh = pretzel(2)
    cases = [
        made(mesh, quads=233, z=noisy(mesh, 0.9, np.random.default_rng(seed)))
        for seed in (5, 9, 21, 26, 29, 33, 35)
    ]
    cases = [s for s in cases if s.seamless.is_valid]
    layouts = [s.quantise(233).layout for s in cases]
    split = 0
    for s, layout in zip(cases, layouts, strict=True):
        m = build(s, layout)
        assert m.is_valid
        assert extracted(m).n_quads == len(layout.quads)
        split += m.mesh.n_faces > s.aligned.mesh.n_faces
    assert split > 0
    monkeypatch.setattr("vhquad.quad.integer_map.MOST_SPLITS", 0)
    assert not all(build(s, layout).is_valid for s, layout in zip(cases, layouts, strict=True))


def test_lengths_that_contradict_each_other() -> None:
    s = stages("sphere")
    lengths = s.quantise(200).layout.lengths.copy()
    lengths[0] += 1
    layout = replace(s.quantise(200).layout, lengths=lengths)
    with pytest.raises(ParametrizationError, match="do not belong"):
        build(s, layout)


def test_no_time_still_gives_a_map() -> None:
    s = stages("pretzel")
    layout = s.quantise(20).layout
    m = integer_map(s.aligned, s.seamless, s.tracing, s.tmesh, layout, seconds=0.0)
    assert m.uv.shape == (m.mesh.n_faces, 3, 2)
    assert m.area == pytest.approx(len(layout.quads), rel=1e-12)  # fixed by the special vertices


def test_a_finer_sphere_has_the_same_quads() -> None:
    fine = made(icosphere(3))
    layout = fine.quantise(200).layout
    assert extracted(build(fine, layout)).n_quads == len(layout.quads)
    assert build_layout(fine.tmesh, layout.lengths).n_vertices == layout.n_vertices

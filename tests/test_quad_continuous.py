"""Continuous maps: linear in the size of quads, kept for all counts of a class."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest

from tests.meshes import cube, icosphere, torus
from tests.remesh_checks import plain_field
from vhquad.mesh.triangle import TriMesh
from vhquad.quad import continuous
from vhquad.quad.continuous import ContinuousMap, MapInput
from vhquad.quad.counts import map_quads, narrow_map_quads, stand_in_quads
from vhquad.quad.pipeline import RemeshResult, RemeshSettings, remesh_mesh
from vhquad.watch import Watch


@pytest.fixture(autouse=True)
def _own_cache(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("VHQUAD_CACHE", str(tmp_path))


def _never(*args: object, **kwargs: object) -> None:
    raise AssertionError("made again")


def _run(mesh: TriMesh, count: int, cache: bool, known: bool = False) -> RemeshResult:
    field = plain_field(mesh)
    if known:
        field = replace(field, confidence=np.ones(mesh.n_faces))
    return remesh_mesh(mesh, field, RemeshSettings(count), cache=cache)


@pytest.mark.parametrize(
    ("span", "made_for"),
    [
        (4.0, lambda n: map_quads(n, 1e9)),
        (2.0, narrow_map_quads),
    ],
    ids=["smooth", "creased"],
)
def test_classes(span: float, made_for: Callable[[float], float]) -> None:
    """1. One after the other, each with its maps for one count near its least."""
    counts = np.geomspace(1.0, 1e6, 500)
    made = np.array([made_for(n) for n in counts])
    assert (counts / made > 0.88).all()
    assert (counts / made < 0.89 * span).all()
    assert sorted(set(np.diff(np.log(made) / np.log(span)).round(9))) == [0.0, 1.0]
    assert [made_for(n) for n in (500, 2_000, 7_100, 14_000)] == [500, 2_000, 8_000, 8_000]


def test_coarse_meshes_share_a_map() -> None:
    """1. More quads than a quarter as many as triangles ask for no other map; stand-ins do."""
    assert map_quads(9_000, 28_000) == map_quads(2_000, 28_000) == 2_000
    assert map_quads(9_000, 29_000) == 8_000
    assert map_quads(9_000, 28_000, known=True) == map_quads(4_000, 28_000, known=True) == 4_000


def test_classes_of_known_parts() -> None:
    """1. Narrow up to where the detail of fields ends, then wide."""
    for n in np.geomspace(1.0, 7_000, 100):
        assert map_quads(n, 1e9, known=True) == narrow_map_quads(n)
    for n in np.geomspace(7_100, 1e6, 100):
        assert map_quads(n, 1e9, known=True) == map_quads(n, 1e9)


def test_coarse_meshes_share_a_stand_in() -> None:
    """1. By the count alone."""
    assert stand_in_quads(7_100) == stand_in_quads(28_000) == 10_000
    assert stand_in_quads(28_500) == 40_000


KNOWN = "known torus"  # its field is sure of itself
MESHES = {"ball": icosphere(4), "torus": torus(60, 40), "cube": cube(24), KNOWN: torus(60, 40)}
WIDE, NARROW = (700, 1700, 3000), (700, 870)
FOUND = {"ball": WIDE, "torus": WIDE, "cube": NARROW, KNOWN: NARROW}
MADE_AGAIN = {"ball": (430,), "torus": (430,), "cube": (430, 900), KNOWN: (430, 900)}


@pytest.mark.parametrize("name", MESHES)
def test_other_counts_find_the_map(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """2. Of the class, and they make the same quads of it as without; others make their own."""
    mesh, known = MESHES[name], name == KNOWN
    _run(mesh, 500, True, known)
    alone = [_run(mesh, count, False, known) for count in FOUND[name]]
    with monkeypatch.context() as patch:
        patch.setattr(continuous, "align_field", _never)
        patch.setattr(continuous, "solve_seamless_map", _never)
        for count, made in zip(FOUND[name], alone, strict=True):
            again = _run(mesh, count, True, known)
            np.testing.assert_array_equal(again.quads.quads, made.quads.quads)
            np.testing.assert_array_equal(again.quads.vertices, made.quads.vertices)
            part, other = again.report.components[0], made.report.components[0]
            assert part.singularities == other.singularities
        for count in MADE_AGAIN[name]:
            with pytest.raises(AssertionError, match="made again"):
                _run(mesh, count, True, known)
        with pytest.raises(AssertionError, match="made again"):
            _run(TriMesh(1.5 * mesh.vertices, mesh.faces), 700, True, known)


def _input(mesh: TriMesh, target: int) -> MapInput:
    field = plain_field(mesh)
    none = np.zeros((0, 2), dtype=np.int64)
    return MapInput(mesh, field, none, target, 500.0, 0.5, 0.5, None, 0.01, 0.0)


def _solve(mesh: TriMesh, target: int) -> ContinuousMap:
    return _input(mesh, target).solve(True, Watch(), lambda step, share: None)


def test_a_kept_map_is_the_map(tmp_path: Path) -> None:
    """3. To the last bit of every array; a damaged one is made again."""
    mesh = torus(60, 40)
    first = _solve(mesh, 500)
    (entry,) = tmp_path.glob("map-*.npz")
    whole = entry.read_bytes()
    for damaged in (whole, whole[: len(whole) // 2], b"", whole[:1000] + b"x" * 64 + whole[1064:]):
        entry.write_bytes(damaged)
        second = _solve(mesh, 500)
        for a, b in ((first.aligned, second.aligned), (first.seamless, second.seamless)):
            for part in fields(a):
                x, y = getattr(a, part.name), getattr(b, part.name)
                if isinstance(x, TriMesh):
                    np.testing.assert_array_equal(x.vertices, y.vertices)
                    np.testing.assert_array_equal(x.faces, y.faces)
                elif isinstance(x, np.ndarray):
                    np.testing.assert_array_equal(x, y)
                    assert x.dtype == y.dtype
                else:
                    assert x == y, part.name


def test_maps_scale_with_the_count() -> None:
    """4. Twice the quads: the map's area, in squared quads, is twice as large."""
    mesh = torus(60, 40)
    few, many = _solve(mesh, 450), _solve(mesh, 800)
    assert many.seamless.area / few.seamless.area == pytest.approx(800 / 450, rel=1e-9)
    assert few.aligned.size is None or (few.aligned.size > 0).all()

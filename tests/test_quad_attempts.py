"""What remesh_mesh tries in turn where a map is not to be had, and what the report says of it."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from tests.map_stages import noisy
from tests.meshes import cube, grid, icosphere, merge, moved, tetrahedron
from tests.remesh_checks import check_valid, run
from vhquad.errors import ParametrizationError
from vhquad.field.align import AlignedField, align_field
from vhquad.field.cross import CrossField
from vhquad.mesh.triangle import TriMesh
from vhquad.quad import continuous, mapping
from vhquad.quad.component import PAIRED
from vhquad.quad.quantize import Quantisation, quantise
from vhquad.quad.seamless_map import SeamlessMap
from vhquad.quad.tmesh import TMesh
from vhquad.report import MAP


def test_a_field_without_a_map_falls_back(monkeypatch: pytest.MonkeyPatch) -> None:
    solve = continuous.solve_seamless_map
    monkeypatch.setattr(
        continuous, "solve_seamless_map", lambda *a, **k: replace(solve(*a, **k), flips=3, solves=9)
    )
    mesh = merge(icosphere(2), moved(grid(), (3.0, 0, 0)))
    result = run(mesh, 200)
    assert result.quads.is_manifold
    assert result.report.topology_kept
    assert len(result.report.fallbacks) == 2
    for part in result.report.components:
        assert part.method == "paired triangles"
        assert "3 triangles of the map stay folded after 9 solves" in part.reason
    assert any("paired triangles" in line for line in result.report.shortfalls())


def test_creases_beside_folds_go_before_all_do(monkeypatch: pytest.MonkeyPatch) -> None:
    """A map folded in the middle of one edge of a cube as long as that is a crease."""
    solve = continuous.solve_seamless_map
    creases: list[int] = []

    def folded(aligned: AlignedField, **given: Any) -> SeamlessMap:
        made, mesh = solve(aligned, **given), aligned.mesh
        creases.append(int(aligned.feature.sum()) // 2)
        middle = 0.5 * (mesh.vertices[mesh.tail] + mesh.vertices[mesh.head])
        on_edge = (middle[:, 0] > 0.49) & (middle[:, 1] > 0.49) & (np.abs(middle[:, 2]) < 0.15)
        if not (on_edge & aligned.feature).any():
            return made
        uv = made.uv.copy()
        bad = np.unique(np.flatnonzero(on_edge) // 3)
        uv[bad] = uv[bad][:, ::-1]
        return replace(made, uv=uv, flips=len(bad))

    monkeypatch.setattr(continuous, "solve_seamless_map", folded)
    mesh = cube(6)
    result = run(mesh, 600)
    part = result.report.components[0]
    assert part.method == f"{MAP}, some creases"
    assert "triangles of the map stay folded" in part.reason
    assert result.report.quality.folded_quads == 0
    assert creases[0] == 12 * 6
    assert 11 * 6 <= creases[-1] < 12 * 6
    assert any("some creases" in line for line in result.report.shortfalls())


@pytest.mark.parametrize(
    ("factors", "chosen"),
    [((2, 3, 4, 5), 0), ((2.1, 2, 2, 2), 0), ((3, 2, 4, 4), 1), ((5, 4, 3, 2), 3)],
)
def test_a_count_that_nothing_meets_is_explained(
    monkeypatch: pytest.MonkeyPatch, factors: tuple[float, ...], chosen: int
) -> None:
    """The first attempt that makes about the nearest count is taken, and the report says so."""
    made: list[int] = []

    def more(tmesh: TMesh, target: float, area: float) -> Quantisation:
        found = quantise(tmesh, factors[len(made)] * target, area)
        made.append(found.n_quads)
        return found

    monkeypatch.setattr(mapping, "quantise", more)
    mesh = tetrahedron()
    result = run(mesh, 60)
    check_valid(mesh, result)
    assert len(made) == 4
    part = result.report.components[0]
    assert part.made == made[chosen]
    assert (part.method == MAP) == (chosen == 0)
    for count in made:
        assert f"{count} quads where 60 were asked for" in part.reason
    lines = result.report.shortfalls()
    assert any("count missed, because" in line for line in lines) == (chosen == 0)


def test_a_layout_of_another_topology_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    def with_a_hole(tmesh: TMesh, target: float, area: float) -> Quantisation:
        made = quantise(tmesh, target, area)
        return replace(made, layout=replace(made.layout, quads=made.layout.quads[1:]))

    monkeypatch.setattr(mapping, "quantise", with_a_hole)
    result = run(icosphere(2), 100)
    check_valid(icosphere(2), result)
    part = result.report.components[0]
    assert part.method == "paired triangles"
    assert "instead of (1, 2, 0)" in part.reason


def test_every_further_attempt_leaves_fewer_singularities(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pairs are cancelled within half an edge at first, then within one, then within two."""
    seen: list[tuple[float, int]] = []

    def watched(mesh: TriMesh, field: CrossField, creases, settings, seam):  # type: ignore[no-untyped-def]
        aligned = align_field(mesh, field, creases, settings, seam)
        seen.append((settings.cancel, sum(aligned.report.singularities.values())))
        return aligned

    def never(tmesh: TMesh, target: float, area: float) -> Quantisation:
        raise ParametrizationError("not at this density")

    monkeypatch.setattr(continuous, "align_field", watched)
    monkeypatch.setattr(mapping, "quantise", never)
    mesh = icosphere(3)
    result = run(mesh, 60, CrossField("faces", noisy(mesh, 1.0, np.random.default_rng(0))))
    assert result.report.components[0].method == PAIRED
    assert [cancel for cancel, _ in seen] == [0.5, 1.0, 2.0]
    counts = [count for _, count in seen]
    assert counts[0] > counts[1] >= counts[2] >= 8  # a sphere has eight at least

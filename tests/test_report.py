"""Reports: JSON in and out, and what they call a shortfall."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pytest

from tests.meshes import grid, quad_cube, quad_grid, torus, two_spheres
from vhquad.errors import ConfigError
from vhquad.jsonable import from_plain, plain, write_json
from vhquad.mesh.quad import QuadMesh
from vhquad.mesh.quality import check_quads
from vhquad.mesh.triangle import TriMesh
from vhquad.report import CheckReport, ComponentReport, MeshCounts, RemeshReport, versions


def sample(quads: QuadMesh, surface: TriMesh | None = None, **changes: object) -> RemeshReport:
    counts = MeshCounts.of(quads)
    report = RemeshReport(
        asked=quads.n_quads,
        made=quads.n_quads,
        input=counts,
        output=counts,
        quality=check_quads(quads, surface),
        components=(
            ComponentReport(10, 20, 4, 4, "integer-grid map", "", {3: 8}, 1, {"map": 0.5}),
            ComponentReport(3, 1, 1, 1, "paired triangles", "no map was found"),
        ),
        repair=("duplicate vertices welded: 3",),
        seconds={"map": 0.5, "check": 0.01},
        warnings=("mind the gap",),
        settings={"crease": None, "seed": 3},
    )
    return replace(report, **changes)  # type: ignore[arg-type]


def test_counts_of_triangles_and_quads() -> None:
    """V - E + F by hand: a 4 x 3 grid of 5 x 4 vertices is a disk."""
    assert MeshCounts.of(quad_grid(4, 3)) == MeshCounts(20, 12, 1, 1, 1)
    assert MeshCounts.of(torus()).topology == (1, 0, 0)
    assert MeshCounts.of(two_spheres()).topology == (2, 4, 0)


@pytest.mark.parametrize("quads", [quad_cube(3), quad_grid(4, 3)], ids=["closed", "open"])
def test_round_trip_through_json(quads: QuadMesh, tmp_path: Path) -> None:
    """Every figure comes back: numbers, integer keys, the quality and its distances."""
    surface = TriMesh(quads.vertices, quads.triangles())
    report = sample(quads, surface)
    path = tmp_path / "report.json"
    write_json(path, report)
    assert RemeshReport.from_dict(json.loads(path.read_text(encoding="utf-8"))) == report


def test_json_is_strict(tmp_path: Path) -> None:
    """An empty result has NaN figures; JSON knows none, so they are null and come back as NaN."""
    report = sample(QuadMesh(np.zeros((3, 3)), np.zeros((0, 4), dtype=int)))
    assert report.quality is not None
    assert math.isnan(report.quality.scaled_jacobian_min)
    text = json.dumps(report.to_dict(), allow_nan=False)
    back = RemeshReport.from_dict(json.loads(text))
    assert back.quality is not None
    assert math.isnan(back.quality.scaled_jacobian_min)


def test_damaged_report_is_refused() -> None:
    values = sample(quad_cube(2)).to_dict()
    del values["input"]["faces"]
    with pytest.raises(ConfigError, match="MeshCounts"):
        RemeshReport.from_dict(values)
    with pytest.raises(ConfigError, match="JSON object"):
        from_plain(MeshCounts, 3)


def test_no_shortfall_where_all_is_well() -> None:
    report = sample(quad_cube(3), warnings=())
    assert replace(report, components=report.components[:1]).shortfalls() == ()


def test_shortfalls_name_what_is_wrong() -> None:
    """Warnings, the count, the topology and fallbacks, one line each."""
    other = MeshCounts(1, 1, 2, 4, 0)
    report = sample(quad_cube(3), asked=100, input=other)
    assert not report.topology_kept
    lines = report.shortfalls()
    assert lines[0] == "mind the gap"
    assert lines[1] == "54 quads were made where 100 were asked for"
    assert "(1, 2, 0), those of the input (2, 4, 0)" in lines[2]
    assert lines[3] == "component 1: fallback used (paired triangles), because no map was found"
    assert len(lines) == 4


def test_count_band_is_a_tenth() -> None:
    cube = sample(quad_cube(3), warnings=(), components=())
    assert replace(cube, asked=60).shortfalls() == ()  # 54 is 10 % below 60
    assert len(replace(cube, asked=61).shortfalls()) == 1


def test_bad_quads_are_shortfalls() -> None:
    """A vertex of a flat grid pulled across its quads folds some of them."""
    flat = quad_grid(4, 3)
    vertices = flat.vertices.copy()
    vertices[6] += np.array([1.0, 0.0, 0.0])
    bad = QuadMesh(vertices, flat.quads)
    check = CheckReport(check_quads(bad), MeshCounts.of(grid(3, 3, hole=True)))
    assert check.is_valid  # folded, but a manifold of quads
    lines = check.shortfalls()
    assert any("folded quads" in line for line in lines)
    assert any("boundary loops are (1, 1, 1), those of the surface (1, 0, 2)" in x for x in lines)


@dataclass(frozen=True)
class Everything:
    numbers: tuple[float, ...]
    names: list[str]
    table: dict[int, float] = field(default_factory=dict)
    maybe: MeshCounts | None = None


def test_plain_takes_what_reports_hold() -> None:
    """numpy values, tuples, paths, nested dataclasses, infinities."""
    value = {"a": np.float64(1.5), 2: np.arange(2), "p": Path("x/y"), "s": {3}, "i": np.inf}
    assert plain(value) == {"a": 1.5, "2": [0, 1], "p": str(Path("x/y")), "s": [3], "i": None}
    whole = Everything((1.0, 2.5), ["a"], {3: 0.5}, MeshCounts(1, 2, 3, 4, 5))
    assert from_plain(Everything, json.loads(json.dumps(plain(whole)))) == whole


def test_versions_name_what_decides_the_result() -> None:
    assert set(versions()) == {"vhquad", "python", "numpy", "scipy", "torch", "libigl"}

"""The clocks of the speed benchmark: nested steps are taken out, and a run yields every step."""

from __future__ import annotations

import json
import sys
import time
from argparse import Namespace
from pathlib import Path

import pytest

from tests.meshes import blob
from vhquad.mesh.io import write_triangle_mesh

sys.path.insert(0, str(Path(__file__).parents[1] / "benchmarks"))

import speed
import speed_run


def test_a_step_does_not_count_what_is_inside_it() -> None:
    clock = speed_run.Clock()
    inner = clock.timed("inner", lambda: time.sleep(0.2))

    def work() -> str:
        time.sleep(0.05)
        inner()
        inner()
        return "done"

    assert clock.timed("outer", work)() == "done"
    assert 0.4 <= clock.seconds["inner"][1] < 0.6
    assert 0.05 <= clock.seconds["outer"][1] < 0.2
    assert clock.seconds["inner"][0] < 0.2  # sleeping takes no CPU


def test_steps_name_functions_that_exist() -> None:
    import importlib

    for names in speed_run.STEPS.values():
        for name in names:
            home, attribute = name.rsplit(".", 1)
            assert callable(getattr(importlib.import_module(home), attribute)), name


def test_a_run_and_its_second(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    mesh = tmp_path / "blob.obj"
    write_triangle_mesh(mesh, blob(3))  # without symmetry: no eigenvalues are equal
    options = Namespace(repeat=2, second=True, eigsh=1000, peers=False)
    entry = speed.measure(mesh, 500, (), options)
    assert entry["vertices"] == 642
    run, second = entry["remesh"], entry["second, more"]
    assert run["code"] in (0, 3)
    assert set(speed_run.STEPS) - {"proxy"} <= set(run["steps"])
    spent = sum(step["cpu"] for step in run["steps"].values())
    assert 0.5 * run["cpu"] < spent <= run["cpu"]  # what is left is the way out
    assert "network" not in second["steps"]  # the field was kept
    assert "map" not in second["steps"]  # nor was the map made again,
    assert "map" in entry["second, fewer"]["steps"]  # but for a class of its own
    assert entry["second, fewer"]["made"] < run["made"] < second["made"]
    assert entry["second, half"]["made"] < entry["second, fewer"]["made"]
    assert second["made"] < entry["second, twice"]["made"]
    assert len(run["all"]) == 2
    assert run["cpu"] == max(run["all"])  # the upper one of two
    pairs = entry["eigenpairs"]
    assert [one["laplacian"] for one in pairs] == ["connection", "scalar"]
    for one in pairs:
        assert min(one["eigsh"], one["ours"]) > 0
        assert one["span"] < 1e-3
        assert one["values"] < 1e-4
    json.dumps(entry)
    speed.show([entry])
    shown = capsys.readouterr().out
    assert "from the field to quads" in shown
    assert "connection" in shown
    pytest.importorskip("matplotlib")
    speed.plot([entry, {**entry, "vertices": 6420}], tmp_path / "speed.png")
    assert (tmp_path / "speed.png").stat().st_size > 5000

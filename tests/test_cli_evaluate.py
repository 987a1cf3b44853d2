"""`vhquad evaluate`: figures of a model as tables, JSON and pictures."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest

from tests.command_line import Invoke, write_obj
from tests.quad_meshes import cube_sphere, quad_torus

SMALL = ("--vertices", "250", "350", "--triangulations", "1", "--k", "16", "--jobs", "1")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Two quad meshes and rubbish."""
    path = tmp_path / "quads"
    path.mkdir()
    write_obj(path / "torus.obj", *quad_torus())
    write_obj(path / "ball.obj", *cube_sphere())
    (path / "rubbish.obj").write_text("no mesh", encoding="ascii")
    return path


def test_dataset_to_figures(invoke: Invoke, folder: Path, tmp_path: Path) -> None:
    """1. A trained model on a dataset: tables that can be read, JSON that holds them."""
    dataset, run = tmp_path / "dataset", tmp_path / "run"
    assert invoke("preprocess", folder, "--out", dataset, *SMALL, "--val", "0").code == 0
    assert invoke("train", dataset, "--out", run, "--steps", "1").code == 0
    assert invoke("evaluate", run, dataset).refused("test split", "2 in train")
    report = tmp_path / "report.json"
    shown = invoke("evaluate", run, dataset, "--split", "train", "--json", report)
    assert shown.code == 0
    for word in ("model + curvature", "principal", "random", "artist's", "confidence"):
        assert word in shown.out
    assert max(map(len, shown.out.splitlines())) <= 80
    found = json.loads(report.read_text(encoding="utf-8"))
    assert {sample["name"] for sample in found["samples"]} == {"torus.t0", "ball.t0"}
    assert (found["model"], found["split"]) == (str(run), "train")
    random = next(row for row in found["rows"] if row["method"] == "random")
    assert random["mean_angle"] == pytest.approx(22.5, abs=2.5)

    printed = invoke("evaluate", run, dataset, "--split", "all", "--json", "-")
    assert json.loads(printed.out)["rows"] == found["rows"]
    assert invoke("--quiet", "evaluate", run, dataset, "--split", "all").out == ""


def test_a_folder_of_quads_is_prepared_on_the_way(
    invoke: Invoke, folder: Path, small_model: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """2. All shapes are for testing; nothing is left beside them; the unusable is named."""
    monkeypatch.setattr("os.cpu_count", lambda: 1)  # no processes to wait for
    before = sorted(folder.parent.rglob("*"))
    run = invoke("evaluate", small_model, folder, "--json", "-")
    assert run.code == 0
    assert "skipped rubbish.obj" in run.err
    samples = json.loads(run.out)["samples"]
    assert sorted((s["shape"], s["split"]) for s in samples) == [
        ("ball", "test"),
        ("torus", "test"),
    ]
    assert [p for p in sorted(folder.parent.rglob("*")) if "cache" not in p.parts] == before


def test_refusals(
    invoke: Invoke, folder: Path, small_model: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert invoke("evaluate", small_model, folder, "--split", "best").refused("--split", "all")
    assert invoke("evaluate", small_model, folder, "--json", "a.txt").refused("--json", ".json")
    assert invoke("evaluate", folder / "none.safetensors", folder).refused("none.safetensors")
    assert invoke("evaluate", small_model, folder / "none").refused("none")
    assert invoke("evaluate", small_model).code == 2
    monkeypatch.setitem(sys.modules, "pyvista", None)
    run = invoke("evaluate", small_model, folder, "--maps", folder / "maps")
    assert run.refused("extra viz", "pip install")

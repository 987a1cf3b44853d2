"""`vhquad preprocess` and `vhquad train`: from a folder of quads to a model that predicts."""

from __future__ import annotations

import json
import signal
import sys
import time
from pathlib import Path

import pytest

from tests.command_line import Invoke, program, write_obj
from tests.meshes import half_sphere, icosphere
from tests.quad_meshes import cube_sphere, quad_torus

SMALL = ("--vertices", "250", "350", "--triangulations", "1", "--k", "16", "--val", "0")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Two quad meshes, a plain triangle mesh and rubbish."""
    path = tmp_path / "quads"
    path.mkdir()
    write_obj(path / "torus.obj", *quad_torus())
    write_obj(path / "ball.obj", *cube_sphere())
    plain = half_sphere(2)
    write_obj(path / "plain.obj", plain.vertices, plain.faces)
    (path / "rubbish.obj").write_text("no mesh", encoding="ascii")
    return path


def test_quads_to_model_to_field(invoke: Invoke, folder: Path, tmp_path: Path) -> None:
    """The whole way, by default names; what cannot be used is named; training resumes."""
    run = invoke("preprocess", folder, *SMALL, "--jobs", "1")
    assert run.code == 0
    assert "rubbish.obj" in run.err
    dataset = tmp_path / "quads_dataset"
    index = json.loads((dataset / "index.json").read_text(encoding="utf-8"))
    assert len(index["samples"]) == 3

    first = invoke("train", dataset, "--steps", "2", "--preset", "starter", "--seed", "1")
    assert first.code == 0
    run_folder = tmp_path / "quads_dataset_run"
    assert (run_folder / "model.safetensors").exists()
    assert invoke("train", dataset, "--steps", "2").refused("--resume")
    again = invoke("train", dataset, "--resume")
    assert again.code == 0

    ball = icosphere(2)
    source = write_obj(tmp_path / "ball.obj", ball.vertices, ball.faces)
    assert invoke("predict", source, "--model", run_folder).code == 0
    assert source.with_suffix(".ffield").exists()


def test_a_folder_of_meshes_is_prepared_on_the_way(
    invoke: Invoke, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Into the run, which resumes from it; what cannot be used is named."""
    monkeypatch.setattr(sys.modules["vhquad.cli.train"], "FEW_SAMPLES", 6)
    (folder / "plain.obj").unlink()
    run = folder.parent / "mine"
    first = invoke("train", folder, "--init", "default", "--steps", "2", "--out", run)
    assert first.code == 0
    assert "rubbish.obj" in first.err
    samples = json.loads((run / "dataset" / "0" / "index.json").read_text())["samples"]
    assert {s["source"] for s in samples} == {"torus.obj", "ball.obj"}
    assert len(samples) == 4  # six over three files: two of each
    assert {s["split"] for s in samples} == {"train"}
    again = invoke("train", folder, "--resume", "--out", run)
    assert again.code == 0
    assert "rubbish.obj" not in again.err


def test_refusals(invoke: Invoke, tmp_path: Path) -> None:
    empty = tmp_path / "empty"
    empty.mkdir()
    assert invoke("preprocess", empty).refused("empty", "no mesh")
    assert invoke("train", empty).refused("empty", "no mesh")
    assert invoke("preprocess", tmp_path / "no").refused("no")
    assert invoke("preprocess", empty, "--out", empty).refused("--out")
    assert invoke("preprocess", empty, "--val", "2").refused("--val")
    assert invoke("train", tmp_path / "no").refused("vhquad preprocess")
    assert invoke("train", empty, "--steps", "1", "--epochs", "1").refused("--steps or --epochs")
    assert invoke("train", empty, "--init", "default", "--preset", "paper").refused("--init")
    assert invoke("train", empty, "--blocks", "6").refused("--blocks", "--init")
    assert invoke("train", empty, "--preset", "huge").refused("huge", "starter")
    assert invoke("train", empty, "--resume", "--rate", "1").refused("--resume", "--rate")
    assert invoke("train").code == 2


def test_interrupted_preprocess_stops_its_workers(folder: Path) -> None:
    """Ctrl-C reaches the whole group; nothing half written stays, no worker goes on."""
    with program("preprocess", folder, "--triangulations", "500", "--jobs", "2") as process:
        while not (folder.parent / "quads_dataset" / "samples").exists():
            assert process.poll() is None
            time.sleep(0.1)
        time.sleep(3.0)  # workers have started, or are about to
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=60)  # ends when the last worker has closed the pipes
    assert (process.returncode, out) == (130, "")
    assert err.splitlines()[-1] == "vhquad: interrupted"
    assert "Traceback" not in err
    assert not list(folder.parent.rglob(".*.npz"))

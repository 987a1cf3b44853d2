"""The trainer on a tiny dataset: it learns, repeats, resumes exactly, and refuses what is unfit."""

from __future__ import annotations

import csv
import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from safetensors import safe_open
from safetensors.torch import save_file

from tests.learn_data import MODEL, SETTINGS, write_shapes
from vhquad.errors import ConfigError, DatasetError, ModelError
from vhquad.learn.dataset import Dataset
from vhquad.learn.preprocess import preprocess
from vhquad.learn.runstate import Record
from vhquad.learn.schedule import TrainSettings, learning_rate, mirrored, sample_of_step
from vhquad.learn.train import train
from vhquad.nn.checkpoint import load_model

SHORT = TrainSettings(steps=12, validate_every=5, save_every=4, rate=3e-3)


@pytest.fixture(scope="module")
def dataset(tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    """Two tori to train on, one to validate with, two samples each."""
    folder = tmp_path_factory.mktemp("tori")
    write_shapes(folder / "in", 3)
    (folder / "in" / "split.json").write_text('{"ring1": "val"}')
    return preprocess(folder / "in", folder / "out", SETTINGS, 1)


def _losses(path: Path) -> list[tuple[str, ...]]:
    """The log without the wall times."""
    with path.open() as file:
        return [(*row[:5], row[6]) for row in csv.reader(file)]


def test_it_learns(dataset: Dataset, tmp_path: Path) -> None:
    """1. The loss falls; the run's folder holds a model that loads, a log and a checkpoint."""
    records: list[Record] = []
    result = train(
        dataset.folder, tmp_path / "run", replace(SHORT, steps=60), MODEL, on_record=records.append
    )
    direction = [r.direction for r in records if r.split == "train"]
    assert len(direction) == 60
    assert np.mean(direction[-12:]) < 0.7 * np.mean(direction[:12])
    assert [r.step for r in records if r.split == "val"] == list(range(5, 61, 5))
    assert result.steps == 60
    assert result.validation == [r for r in records if r.split == "val"][-1]
    model = load_model(result.model)
    assert model.settings == MODEL
    assert model.losses["val"]["direction"] == result.validation.direction
    assert model.notes["steps"] == 60
    assert len(_losses(tmp_path / "run" / "losses.csv")) == 1 + 60 + 12


@pytest.mark.parametrize("dropout", [0.0, 0.3])
def test_resuming_is_exact(dataset: Dataset, tmp_path: Path, dropout: float) -> None:
    """2. Stopped at 7, resumed, stopped at 9, resumed: the same losses and weights, to the bit."""
    model = replace(MODEL, dropout=dropout)
    train(dataset.folder, tmp_path / "whole", SHORT, model)
    train(dataset.folder, tmp_path / "parts", SHORT, model, stop_after=7)
    torch.manual_seed(99)  # the state of the global generator is of no account
    train(dataset.folder, tmp_path / "parts", resume=True, stop_after=9)
    train(dataset.folder, tmp_path / "parts", resume=True)
    parts = tmp_path / "parts"
    assert _losses(parts / "losses.csv") == _losses(tmp_path / "whole" / "losses.csv")
    for name in ("model.safetensors", "checkpoint.safetensors"):
        assert (parts / name).read_bytes() == (tmp_path / "whole" / name).read_bytes()


def test_an_interrupted_run_resumes_exactly(dataset: Dataset, tmp_path: Path) -> None:
    """3. Ctrl-C between two checkpoints, and a crash that left log lines beyond the checkpoint."""

    def interrupt(record: Record) -> None:
        if record.step == 6:
            raise KeyboardInterrupt

    train(dataset.folder, tmp_path / "whole", SHORT, MODEL)
    with pytest.raises(KeyboardInterrupt):
        train(dataset.folder, tmp_path / "cut", SHORT, MODEL, on_record=interrupt)
    log = tmp_path / "cut" / "losses.csv"
    log.write_text(log.read_text() + "7,train,9,9,9,9,ring0.t0\n")
    train(dataset.folder, tmp_path / "cut", resume=True)
    assert _losses(log) == _losses(tmp_path / "whole" / "losses.csv")


def test_a_seed_repeats(dataset: Dataset, tmp_path: Path) -> None:
    """4. The same seed gives the same weights, another one others."""
    few = replace(SHORT, steps=3)
    files = []
    for name, seed in (("a", 0), ("b", 0), ("c", 1)):
        result = train(dataset.folder, tmp_path / name, replace(few, seed=seed), MODEL)
        files.append(result.model.read_bytes())
    assert files[0] == files[1] != files[2]


@pytest.mark.parametrize("blocks", [None, MODEL.blocks + 1])
def test_starting_from_a_model(dataset: Dataset, tmp_path: Path, blocks: int | None) -> None:
    """5. Fine-tuning starts where the model was, deepened or not, and keeps its settings."""
    first = train(dataset.folder, tmp_path / "a", replace(SHORT, steps=8), MODEL)
    records: list[Record] = []
    second = train(
        dataset.folder,
        tmp_path / "b",
        replace(SHORT, steps=1, rate=1e-9, validate_every=1),
        init=first.model,
        on_record=records.append,
        blocks=blocks,
    )
    assert load_model(second.model).settings == replace(
        load_model(first.model).settings, blocks=blocks or MODEL.blocks
    )
    assert first.validation is not None
    assert records[-1].direction == pytest.approx(first.validation.direction, rel=1e-4)
    with pytest.raises(ConfigError, match="not both"):
        train(dataset.folder, tmp_path / "c", SHORT, MODEL, init=first.model)
    with pytest.raises(ConfigError, match="more blocks"):
        train(dataset.folder, tmp_path / "c", SHORT, MODEL, blocks=5)


def test_several_datasets_are_mixed(dataset: Dataset, tmp_path: Path) -> None:
    """6. Twice the samples; sets prepared otherwise are refused."""
    records: list[Record] = []
    settings = replace(SHORT, steps=8, mirror=False)
    train([dataset.folder] * 2, tmp_path / "r", settings, MODEL, on_record=records.append)
    seen = [r.sample for r in records if r.split == "train"]
    assert sorted(seen) == sorted([e.name for e in dataset.split("train")] * 2)
    write_shapes(tmp_path / "in", 1)
    other = preprocess(tmp_path / "in", tmp_path / "other", replace(SETTINGS, k=20), 1)
    with pytest.raises(DatasetError, match="other features, k or order"):
        train([dataset.folder, other.folder], tmp_path / "s", SHORT, MODEL)


def test_bfloat16_learns_too(dataset: Dataset, tmp_path: Path) -> None:
    """7. Nearly the same losses as in float32."""
    found = []
    for precision in ("float32", "bfloat16"):
        settings = replace(SHORT, steps=10, precision=precision)
        result = train(dataset.folder, tmp_path / precision, settings, MODEL)
        assert result.validation is not None
        found.append(result.validation.direction)
    assert found[1] == pytest.approx(found[0], rel=0.1)


def test_refusals(dataset: Dataset, tmp_path: Path) -> None:
    """8. A used folder, no run, a damaged checkpoint, nothing to train on, a device that is not."""
    train(dataset.folder, tmp_path / "run", replace(SHORT, steps=1), MODEL)
    with pytest.raises(ConfigError, match="--resume"):
        train(dataset.folder, tmp_path / "run", SHORT, MODEL)
    with pytest.raises(ModelError, match="no run to resume"):
        train(dataset.folder, tmp_path / "none", resume=True)
    checkpoint = tmp_path / "run" / "checkpoint.safetensors"
    checkpoint.write_bytes(checkpoint.read_bytes()[:-100])
    with pytest.raises(ModelError, match="damaged"):
        train(dataset.folder, tmp_path / "run", resume=True)
    with pytest.raises(ConfigError, match="--device nowhere"):
        train(dataset.folder, tmp_path / "d", SHORT, MODEL, device="nowhere")
    write_shapes(tmp_path / "in", 1)
    (tmp_path / "in" / "split.json").write_text('{"ring0": "test"}')
    empty = preprocess(tmp_path / "in", tmp_path / "empty", SETTINGS, 1)
    with pytest.raises(DatasetError, match="training split"):
        train(empty.folder, tmp_path / "e", SHORT, MODEL)
    for wrong in (
        {"steps": 0},
        {"rate": 0.0},
        {"ema": 1.0},
        {"precision": "half"},
        {"weigh": "no"},
    ):
        with pytest.raises(ConfigError):
            TrainSettings(**wrong)  # type: ignore[arg-type]


def test_vertices_count_by_edges_or_by_area(dataset: Dataset, tmp_path: Path) -> None:
    """9. Another loss from the first step on; a run of before there was a choice goes by area."""
    short = replace(SHORT, steps=6, validate_every=6)
    for weigh in ("edges", "area"):
        train(dataset.folder, tmp_path / weigh, replace(short, weigh=weigh), MODEL)
    edges, area = (_losses(tmp_path / name / "losses.csv") for name in ("edges", "area"))
    assert edges[1][2] != area[1][2]
    old = tmp_path / "old"
    train(dataset.folder, old, replace(short, weigh="area"), MODEL, stop_after=3)
    with safe_open(old / "checkpoint.safetensors", framework="pt") as file:
        about = json.loads(file.metadata()["run"])
        tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
    del about["training"]["weigh"]
    save_file(tensors, old / "checkpoint.safetensors", metadata={"run": json.dumps(about)})
    train(dataset.folder, old, resume=True)
    assert _losses(old / "losses.csv") == area


def test_schedule() -> None:
    """9. One cycle: rise, peak, fall to a thousandth; every sample once an epoch; half mirrored."""
    settings = TrainSettings(steps=1000, rate=1.0)
    rates = [learning_rate(settings, s) for s in range(1000)]
    assert int(np.argmax(rates)) == 100
    assert rates[100] == 1.0
    assert math.isclose(rates[-1], 1e-3, rel_tol=0.01)
    assert np.all(np.diff(rates[:101]) > 0)
    assert np.all(np.diff(rates[100:]) < 0)
    epochs = [[sample_of_step(settings, 7 * e + i, 7) for i in range(7)] for e in range(3)]
    assert all(sorted(epoch) == list(range(7)) for epoch in epochs)
    assert epochs[0] != epochs[1]
    share = np.mean([mirrored(settings, s) for s in range(1000)])
    assert 0.45 < share < 0.55
    assert not any(mirrored(replace(settings, mirror=False), s) for s in range(20))

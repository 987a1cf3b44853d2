"""Model files: a round trip, and a clear refusal of everything that does not fit."""

from __future__ import annotations

import json
import pickle
from dataclasses import replace
from pathlib import Path

import pytest
import torch

from tests.nn_inputs import answer, as_input, blob_operators, random_network, small_settings
from vhquad.errors import ConfigError, ModelError
from vhquad.nn.checkpoint import Model, default_model_path, load_model, save_model
from vhquad.nn.settings import ModelSettings, preset


@pytest.fixture
def saved(tmp_path: Path) -> Path:
    """A model on disk."""
    path = tmp_path / "model.safetensors"
    network = random_network(small_settings(), torch.float32)
    save_model(path, Model(network, {"val": {"direction": 0.5}}, {"steps": 3}))
    return path


def test_round_trip(saved: Path) -> None:
    """1. Same settings, losses, notes and answer; a folder stands for the model in it."""
    network = random_network(small_settings(), torch.float32)
    for path in (saved, saved.parent):
        model = load_model(path)
        assert model.settings == small_settings()
        assert model.losses == {"val": {"direction": 0.5}}
        assert model.notes == {"steps": 3}
        given = as_input(blob_operators(), torch.float32)
        assert (answer(model.network, given)[0] == answer(network, given)[0]).all()
        assert not model.network.training


def test_loading_leaves_the_random_state_alone(saved: Path) -> None:
    """2. Building the network draws weights; the caller must not notice."""
    torch.manual_seed(5)
    expected = torch.rand(1)
    torch.manual_seed(5)
    load_model(saved)
    assert torch.equal(torch.rand(1), expected)


def _change(path: Path, **changes: object) -> None:
    about = json.loads(path.with_suffix(".json").read_text())
    about.update(changes)
    path.with_suffix(".json").write_text(json.dumps(about))


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"version": 99}, "version 99"),
        ({"format": "other"}, "does not describe a vhquad model"),
        ({"settings": None}, "holds no settings"),
        ({"settings": {"channels": 16, "colour": 3}}, "unknown model settings"),
        ({"settings": {"channels": 0}}, "channels must be"),
        ({"settings": {"channels": "16"}}, "channels must be"),
        ({"settings": small_settings(channels=17).to_dict()}, "does not fit the settings"),
        ({"settings": small_settings(blocks=3).to_dict()}, "does not fit the settings"),
    ],
)
def test_unfit_settings_are_refused(saved: Path, changes: dict[str, object], message: str) -> None:
    """3. Foreign, future and contradicting descriptions."""
    _change(saved, **changes)
    with pytest.raises(ModelError, match=message):
        load_model(saved)


def test_damaged_files_are_refused(saved: Path, tmp_path: Path) -> None:
    """4. Cut off, no safetensors, no JSON, missing, NaN."""
    whole = saved.read_bytes()
    for data in (whole[: len(whole) // 2], b"", b"\xff" * 100, pickle.dumps({"a": 1})):
        saved.write_bytes(data)
        with pytest.raises(ModelError, match="damaged"):
            load_model(saved)
    saved.write_bytes(whole)
    saved.with_suffix(".json").write_text("{")
    with pytest.raises(ModelError, match="cannot be read"):
        load_model(saved)
    saved.with_suffix(".json").unlink()
    with pytest.raises(ModelError, match="does not exist"):
        load_model(saved)
    with pytest.raises(ModelError, match="does not exist"):
        load_model(tmp_path / "none.safetensors")
    with pytest.raises(ModelError, match="safetensors file"):
        load_model(tmp_path / "model.pt")
    network = random_network(small_settings(), torch.float32)
    with torch.no_grad():
        network.head.vectors.weight[0, 0] = torch.nan
    save_model(saved, Model(network))
    with pytest.raises(ModelError, match="NaN"):
        load_model(saved)


def test_settings_check_themselves() -> None:
    """5. Wrong values raise where they are made."""
    for wrong in ({"order": 3}, {"head": "other"}, {"dropout": 1.0}, {"k": -1}, {"features": ""}):
        with pytest.raises(ConfigError):
            ModelSettings(**wrong)  # type: ignore[arg-type]
    with pytest.raises(ConfigError, match="paper, starter"):
        preset("large")
    assert ModelSettings.from_dict(preset("paper").to_dict()) == preset("paper")


def test_the_shipped_model() -> None:
    """6. It is there, loads, is the starter preset deepened, and carries the losses of its card."""
    model = load_model()
    assert model.settings == replace(preset("starter"), blocks=8)
    assert default_model_path().stat().st_size < 10_000_000
    assert model.losses["test"]["direction"] < 0.05
    card = (default_model_path().parent / "README.md").read_text(encoding="utf-8")
    assert f"{model.losses['test']['direction']:.3f}" in card

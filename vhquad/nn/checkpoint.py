"""Trained models on disk: NAME.safetensors (weights) and NAME.json (settings, losses, version).

Loading parses two plain formats and runs nothing that is in them. Whatever does not fit is refused
with a ModelError that says what to do.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import torch
from safetensors import SafetensorError
from safetensors.torch import load as load_tensors
from safetensors.torch import save as save_tensors

from vhquad.atomic import write_atomic
from vhquad.errors import ConfigError, ModelError
from vhquad.nn.files import default_model_path, model_file
from vhquad.nn.network import VectorHeatNet
from vhquad.nn.settings import ModelSettings

__all__ = ["Model", "default_model_path", "load_model", "save_model"]

FORMAT, VERSION = "vhquad-model", 1
LARGEST = 512 * 2**20  # bytes; nothing we make comes near


@dataclass(frozen=True, eq=False)
class Model:
    """A network ready to predict, and what is known of it.

    Attributes
    ----------
    network : VectorHeatNet
        In evaluation mode.
    losses : dict
        Losses by split, as the trainer measured them.
    notes : dict
        Anything else worth keeping with the weights (data, steps, licence); JSON values.
    """

    network: VectorHeatNet
    losses: dict[str, Any] = field(default_factory=dict)
    notes: dict[str, Any] = field(default_factory=dict)

    @property
    def settings(self) -> ModelSettings:
        """The network's settings."""
        return self.network.settings


def save_model(path: Path | str, model: Model) -> None:
    """Write PATH (.safetensors) and the JSON beside it, each whole or not at all."""
    path = Path(path)
    if path.suffix != ".safetensors":
        raise ModelError(f"a model's file must end in .safetensors, not {path.name}")
    state = {k: v.detach().cpu().contiguous() for k, v in model.network.state_dict().items()}
    about = {
        "format": FORMAT,
        "version": VERSION,
        "settings": model.settings.to_dict(),
        "losses": model.losses,
        "notes": model.notes,
    }
    write_atomic(path.with_suffix(".json"), json.dumps(about, indent=1) + "\n")
    write_atomic(path, save_tensors(state, metadata={"format": FORMAT}))


def load_model(path: Path | str | None = None) -> Model:
    """Read a model; the one shipped with vhquad if no path is given.

    Parameters
    ----------
    path : path, optional
        The .safetensors file, with its .json beside it; a folder that holds model.safetensors; or
        "default".

    Raises
    ------
    ModelError
        If a file is missing, damaged, not a vhquad model, of another version, or if weights and
        settings do not fit each other.
    """
    path = model_file(path)
    about = _read_about(path)
    try:
        settings = ModelSettings.from_dict(about["settings"])
    except (ConfigError, TypeError) as error:
        raise ModelError(f"{path.with_suffix('.json')}: {error}") from None
    state = _read_weights(path)
    with torch.random.fork_rng(devices=[]):
        network = VectorHeatNet(settings)
    expected = {name: tuple(value.shape) for name, value in network.state_dict().items()}
    found = {name: tuple(value.shape) for name, value in state.items()}
    if expected != found:
        wrong = sorted(n for n in expected.keys() | found.keys() if expected.get(n) != found.get(n))
        raise ModelError(
            f"{path.name} does not fit the settings in {path.with_suffix('.json').name}: "
            f"{len(wrong)} tensors differ, the first is {wrong[0]}"
        )
    bad = sorted(n for n, v in state.items() if not v.is_floating_point() or not v.isfinite().all())
    if bad:
        raise ModelError(f"{path}: tensor {bad[0]} holds NaN, infinite or whole numbers")
    network.load_state_dict({name: value.float() for name, value in state.items()})
    network.eval()
    return Model(network, about.get("losses", {}), about.get("notes", {}))


def _read_about(path: Path) -> dict[str, Any]:
    beside = path.with_suffix(".json")
    if path.suffix != ".safetensors":
        raise ModelError(f"{path.name} is not a vhquad model; give a .safetensors file")
    for file in (path, beside):
        if not file.is_file():
            raise ModelError(f"{file} does not exist; a model is a .safetensors and a .json file")
        if file.stat().st_size > LARGEST:
            raise ModelError(f"{file} is larger than any vhquad model")
    try:
        about = json.loads(beside.read_text(encoding="utf-8"))
    except (ValueError, OSError) as error:
        raise ModelError(f"{beside} cannot be read: {error}") from None
    if not isinstance(about, dict) or about.get("format") != FORMAT:
        raise ModelError(f"{beside} does not describe a vhquad model")
    if about.get("version") != VERSION:
        raise ModelError(
            f"{beside} has version {about.get('version')}, this vhquad reads {VERSION}; "
            "use the vhquad that wrote it, or train again"
        )
    if not isinstance(about.get("settings"), dict):
        raise ModelError(f"{beside} holds no settings")
    return about


def _read_weights(path: Path) -> dict[str, torch.Tensor]:
    try:
        return load_tensors(path.read_bytes())
    except (SafetensorError, ValueError, OSError, KeyError) as error:
        raise ModelError(f"{path} is damaged or no safetensors file: {error}") from None

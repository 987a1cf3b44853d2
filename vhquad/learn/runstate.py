"""The state of a training run in memory and on disk, and its loss log."""

from __future__ import annotations

import copy
import csv
import io
import json
from collections import deque
from dataclasses import asdict, dataclass, fields
from pathlib import Path

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save as save_tensors

from vhquad.atomic import write_atomic
from vhquad.errors import ConfigError, ModelError
from vhquad.learn.schedule import TrainSettings
from vhquad.nn.network import VectorHeatNet
from vhquad.nn.settings import ModelSettings

__all__ = ["LossLog", "Record", "RunState", "load_run", "save_run"]

FORMAT, VERSION = "vhquad-run", 1
FILE = "checkpoint.safetensors"
MOMENTS = ("step", "exp_avg", "exp_avg_sq")  # of AdamW, per parameter


@dataclass(frozen=True)
class Record:
    """One line of ``losses.csv``: a training step, or a validation."""

    step: int
    split: str
    direction: float
    magnitude: float
    rate: float
    seconds: float
    sample: str


class RunState:
    """Network, optimiser, averaged network and step count; changed in place by the trainer.

    ``changing`` is True while weights are half updated: what an interrupt then leaves is no state.
    """

    def __init__(
        self, network: VectorHeatNet, averaged: VectorHeatNet, settings: TrainSettings, step: int
    ) -> None:
        self.network, self.averaged = network, averaged.eval()
        self.settings, self.step = settings, step
        self.changing = False  # while a step is half done
        self.optimizer = torch.optim.AdamW(
            network.parameters(), lr=settings.rate, weight_decay=settings.weight_decay
        )

    @classmethod
    def new(cls, network: VectorHeatNet, settings: TrainSettings) -> RunState:
        """At step 0."""
        return cls(network, copy.deepcopy(network), settings, 0)

    def to(self, device: torch.device) -> None:
        """Move everything to a device."""
        self.network.to(device)
        self.averaged.to(device)
        for moments in self.optimizer.state.values():
            for name in MOMENTS[1:]:
                moments[name] = moments[name].to(device)

    @torch.no_grad()
    def average(self) -> None:
        """Let the averaged weights follow; faster at first, so that the start is forgotten."""
        decay = min(self.settings.ema, (1.0 + self.step) / (10.0 + self.step))
        for kept, new in zip(self.averaged.parameters(), self.network.parameters(), strict=True):
            kept.lerp_(new, 1.0 - decay)


def save_run(folder: Path, state: RunState) -> None:
    """Write the checkpoint, whole or not at all."""
    tensors: dict[str, torch.Tensor] = {}
    for prefix, network in (("network", state.network), ("averaged", state.averaged)):
        for name, value in network.state_dict().items():
            tensors[f"{prefix}/{name}"] = value.detach().cpu().contiguous()
    for name, parameter in state.network.named_parameters():
        for moment in MOMENTS:
            if parameter in state.optimizer.state:
                value = state.optimizer.state[parameter][moment]
                tensors[f"{moment}/{name}"] = value.detach().cpu().contiguous()
    about = {
        "format": FORMAT,
        "version": VERSION,
        "step": state.step,
        "model": state.network.settings.to_dict(),
        "training": state.settings.to_dict(),
    }
    write_atomic(folder / FILE, save_tensors(tensors, metadata={"run": json.dumps(about)}))


def load_run(folder: Path, settings: TrainSettings | None = None) -> RunState:
    """Read the checkpoint of a run; its own settings unless others are given.

    Raises
    ------
    ModelError
        If there is none, or it is damaged or of another version.
    """
    path = folder / FILE
    if not path.is_file():
        raise ModelError(f"{folder} holds no run to resume ({FILE} is missing)")
    try:
        with safe_open(path, framework="pt") as file:
            about = json.loads((file.metadata() or {}).get("run", "{}"))
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
    except (SafetensorError, ValueError, OSError) as error:
        raise ModelError(f"{path} is damaged: {error}") from None
    if about.get("format") != FORMAT or about.get("version") != VERSION:
        raise ModelError(f"{path} is not a run of this version of vhquad; train anew")
    try:
        model = ModelSettings.from_dict(about["model"])
        given = {"weigh": "area", **about["training"]}  # all that earlier versions had
        own = TrainSettings.from_dict(given)
        state = RunState.new(VectorHeatNet(model), own if settings is None else settings)
        state.step = int(about["step"])
        for prefix, network in (("network", state.network), ("averaged", state.averaged)):
            start = f"{prefix}/"
            network.load_state_dict(
                {n[len(start) :]: v for n, v in tensors.items() if n.startswith(start)}
            )
        for name, parameter in state.network.named_parameters():
            if f"step/{name}" in tensors:
                moments = {moment: tensors[f"{moment}/{name}"] for moment in MOMENTS}
                state.optimizer.state[parameter] = moments
    except (KeyError, TypeError, RuntimeError, ConfigError) as error:
        raise ModelError(f"{path} does not fit itself: {error}") from None
    return state


class LossLog:
    """``losses.csv``; a resumed run cuts it back to its checkpoint and goes on.

    Parameters
    ----------
    path : Path
    step : int
        Lines beyond this step are dropped.
    """

    def __init__(self, path: Path, step: int) -> None:
        self.path = path
        self._recent: dict[str, deque[Record]] = {}
        self._pending: list[Record] = []
        self._lines: list[str] = [",".join(f.name for f in fields(Record)) + "\n"]
        path.parent.mkdir(parents=True, exist_ok=True)
        if step > 0 and path.exists():
            old = path.read_text(encoding="utf-8").splitlines(keepends=True)[1:]
            self._lines += [line for line in old if int(line.split(",")[0]) <= step]
        write_atomic(path, "".join(self._lines))

    def add(self, record: Record) -> None:
        """Keep a record; written by :meth:`flush`."""
        self._pending.append(record)
        self._recent.setdefault(record.split, deque(maxlen=200)).append(record)

    def flush(self) -> None:
        """Append what has come in since the last time."""
        buffer = io.StringIO()
        writer = csv.writer(buffer, lineterminator="\n")
        for record in self._pending:
            row = asdict(record)
            row["seconds"] = round(record.seconds, 4)
            writer.writerow(row.values())
        with self.path.open("a", encoding="utf-8") as file:
            file.write(buffer.getvalue())
        self._pending = []

    def recent(self, split: str) -> dict[str, float]:
        """Mean losses of the last 200 records of a split."""
        records = self._recent.get(split)
        if not records:
            return {}
        return {
            "direction": sum(r.direction for r in records) / len(records),
            "magnitude": sum(r.magnitude for r in records) / len(records),
        }

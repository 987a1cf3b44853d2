"""The trainer: one mesh a step, AdamW, one cycle, averaged weights; stops and resumes exactly.

A run's folder holds ``model.safetensors`` + ``model.json`` (the averaged weights, usable at any
time), ``checkpoint.safetensors`` (all that a resume needs) and ``losses.csv``.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import torch

from vhquad.errors import ConfigError, DatasetError
from vhquad.learn.dataset import Dataset, Sample, SampleEntry, open_dataset
from vhquad.learn.device import choose_device
from vhquad.learn.runstate import LossLog, Record, RunState, load_run, save_run
from vhquad.learn.schedule import TrainSettings, learning_rate, mirrored, sample_of_step
from vhquad.nn.checkpoint import Model, load_model, save_model
from vhquad.nn.deepen import deepened
from vhquad.nn.loss import field_loss
from vhquad.nn.network import VectorHeatNet
from vhquad.nn.settings import ModelSettings, preset

__all__ = ["TrainResult", "check_fit", "train"]

Item = tuple[Dataset, SampleEntry]
SHARED = ("features", "turned", "k", "in_channels", "in_lines", "order")  # of model and datasets


@dataclass(frozen=True)
class TrainResult:
    """How a run ended.

    Attributes
    ----------
    model : Path
        The averaged weights.
    steps : int
        Steps done in all.
    validation : Record or None
        Losses of the last validation, if there is a validation split.
    seconds : float
        Wall time of this call.
    """

    model: Path
    steps: int
    validation: Record | None
    seconds: float


def train(
    datasets: Path | str | Sequence[Path | str],
    out: Path | str,
    settings: TrainSettings | None = None,
    model: ModelSettings | None = None,
    init: Path | str | None = None,
    resume: bool = False,
    device: str = "auto",
    on_record: Callable[[Record], None] | None = None,
    stop_after: int | None = None,
    blocks: int | None = None,
) -> TrainResult:
    """Train a model on the training split of one or more datasets.

    Parameters
    ----------
    datasets : path or list of paths
        Made by :func:`vhquad.learn.preprocess.preprocess`, with the same features and k.
    out : path
        The run's folder.
    settings : TrainSettings, optional
        With ``resume``, those of the run if not given.
    model : ModelSettings, optional
        The starter preset if not given; features, their number and k are the datasets'.
    init : path, optional
        Start from the weights of this model ("default": the shipped one) and its settings.
    resume : bool
        Go on where the run in ``out`` stopped.
    device : "auto", "cpu", "cuda" or torch's name of one
    on_record : callable, optional
        Called with a Record after every step and every validation.
    stop_after : int, optional
        Stop, with a checkpoint, when so many steps are done in all.
    blocks : int, optional
        With ``init``: deepen the model to so many blocks (:mod:`vhquad.nn.deepen`).

    Returns
    -------
    TrainResult

    Raises
    ------
    DatasetError
        If a dataset cannot be used or nothing is in its training split.
    ModelError
        If the model or checkpoint to start from does not fit.
    ConfigError
        If the run's folder is in use and ``resume`` is not given, or settings contradict.
    """
    start = time.monotonic()
    folder = Path(out)
    opened = _open(datasets)
    training, validation = _items(opened, "train"), _items(opened, "val")
    if not training:
        raise DatasetError("no sample with ground truth is in the training split")
    target = choose_device(device)
    if resume:
        state = load_run(folder, settings)
    else:
        if (folder / "checkpoint.safetensors").exists():
            raise ConfigError(f"{folder} holds a run already; add --resume, or name another folder")
        settings = TrainSettings() if settings is None else settings
        state = RunState.new(_network(opened[0], model, init, blocks, settings.seed), settings)
    check_fit(state.network.settings, opened[0])
    state.to(target)
    log = LossLog(folder / "losses.csv", state.step)
    last: Record | None = None
    end = min(state.settings.steps, stop_after or state.settings.steps)
    try:
        while state.step < end:
            record = _step(state, training, target)
            log.add(record)
            if on_record is not None:
                on_record(record)
            at_end = state.step == state.settings.steps
            if validation and (state.step % state.settings.validate_every == 0 or at_end):
                last = _validate(state, validation, target)
                log.add(last)
                if on_record is not None:
                    on_record(last)
            if state.step % state.settings.save_every == 0 or state.step == end:
                _save(folder, state, log, last)
    except KeyboardInterrupt:
        if not state.changing:  # else the last checkpoint stands
            _save(folder, state, log, last)
        raise
    return TrainResult(folder / "model.safetensors", state.step, last, time.monotonic() - start)


def _open(datasets: Path | str | Sequence[Path | str]) -> list[Dataset]:
    paths = [datasets] if isinstance(datasets, (str, Path)) else list(datasets)
    opened = [open_dataset(path) for path in paths]
    if not opened:
        raise DatasetError("no dataset given")
    first = opened[0]
    for other in opened[1:]:
        if any(getattr(other, name) != getattr(first, name) for name in SHARED):
            raise DatasetError(
                f"{other.folder} was prepared with other features, k or order than {first.folder}"
            )
    return opened


def _items(datasets: list[Dataset], split: str) -> list[Item]:
    return [(d, entry) for d in datasets for entry in d.split(split)]  # type: ignore[arg-type]


def _network(
    dataset: Dataset,
    model: ModelSettings | None,
    init: Path | str | None,
    blocks: int | None,
    seed: int,
) -> VectorHeatNet:
    if init is not None:
        if model is not None:
            raise ConfigError("give either a model to start from or a preset, not both")
        network = load_model(init).network
        return network if blocks is None else deepened(network, blocks, seed)
    if blocks is not None:
        raise ConfigError("only a model to start from can be given more blocks")
    base = preset("starter") if model is None else model
    chosen = replace(
        base,
        features=dataset.features,
        turned=dataset.turned,
        k=dataset.k,
        in_channels=dataset.in_channels,
        in_lines=dataset.in_lines,
        order=dataset.order,
    )
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        return VectorHeatNet(chosen)


def check_fit(model: ModelSettings, dataset: Dataset) -> None:
    """Refuse a dataset that was prepared otherwise than a model needs.

    Raises
    ------
    DatasetError
    """
    for name in SHARED:
        if getattr(model, name) != getattr(dataset, name):
            raise DatasetError(
                f"the model was made for {name} = {getattr(model, name)}, {dataset.folder} was "
                f"prepared with {getattr(dataset, name)}; preprocess again with the model's"
            )


def _step(state: RunState, items: list[Item], device: torch.device) -> Record:
    """One optimiser step on one mesh."""
    begin = time.monotonic()
    settings, step = state.settings, state.step
    dataset, entry = items[sample_of_step(settings, step, len(items))]
    sample = _load(dataset, entry, device)
    assert sample.truth is not None  # only samples with truth are in a split
    mesh = sample.input.mirror_image() if mirrored(settings, step) else sample.input
    rate = learning_rate(settings, step)
    for group in state.optimizer.param_groups:
        group["lr"] = rate
    state.network.train()
    devices = [device] if device.type == "cuda" else []
    with torch.random.fork_rng(devices=devices):  # dropout too is a function of the step
        torch.manual_seed(settings.seed * 1_000_003 + step)
        if settings.precision == "bfloat16":
            with torch.autocast(device.type, dtype=torch.bfloat16):
                output = state.network(mesh.low_precision())
        else:
            output = state.network(mesh)
    truth = sample.truth.by_edges() if settings.weigh == "edges" else sample.truth
    loss = field_loss(output.float(), truth)
    state.optimizer.zero_grad(set_to_none=True)
    loss.total.backward()
    norm = torch.nn.utils.clip_grad_norm_(state.network.parameters(), settings.clip)
    state.changing = True
    if bool(torch.isfinite(norm)):
        state.optimizer.step()
        state.average()
    state.step += 1
    state.changing = False
    return Record(
        step=state.step,
        split="train",
        direction=float(loss.direction.detach()),
        magnitude=float(loss.magnitude.detach()),
        rate=rate,
        seconds=time.monotonic() - begin,
        sample=entry.name,
    )


def _validate(state: RunState, items: list[Item], device: torch.device) -> Record:
    """Mean losses of the averaged weights over the validation split."""
    begin = time.monotonic()
    network = state.averaged
    total = torch.zeros(2, dtype=torch.float64)
    with torch.no_grad():
        for dataset, entry in items:
            sample = _load(dataset, entry, device)
            assert sample.truth is not None
            loss = field_loss(network(sample.input), sample.truth)
            total += torch.stack([loss.direction, loss.magnitude]).double().cpu()
    direction, magnitude = (total / len(items)).tolist()
    rate = learning_rate(state.settings, state.step)
    return Record(
        state.step,
        "val",
        direction,
        magnitude,
        rate,
        time.monotonic() - begin,
        f"{len(items)} meshes",
    )


def _load(dataset: Dataset, entry: SampleEntry, device: torch.device) -> Sample:
    sample = dataset.load(entry)
    if device.type == "cpu":
        return sample
    truth = None if sample.truth is None else sample.truth.to(device)
    return Sample(sample.name, sample.input.to(device), truth)


def _save(folder: Path, state: RunState, log: LossLog, validation: Record | None) -> None:
    log.flush()
    save_run(folder, state)
    losses: dict[str, dict[str, float]] = {"train": log.recent("train")}
    if validation is not None:
        losses["val"] = {"direction": validation.direction, "magnitude": validation.magnitude}
    notes = {"steps": state.step, "training": state.settings.to_dict()}
    save_model(folder / "model.safetensors", Model(state.averaged, losses, notes))

"""`vhquad train`: a dataset to a model."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from vhquad.cli.guard import Shell, complain, guarded
from vhquad.cli.options import Device
from vhquad.cli.outputs import check_folder
from vhquad.errors import ConfigError

if TYPE_CHECKING:
    from vhquad.cli.progress import Progress
    from vhquad.learn.runstate import Record
    from vhquad.learn.schedule import TrainSettings

__all__ = ["train"]


@guarded
def train(
    ctx: typer.Context,
    datasets: Annotated[
        list[Path],
        typer.Argument(
            metavar="DATASET",
            help="Made by `vhquad preprocess`; several are mixed.",
            show_default=False,
        ),
    ],
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            "-o",
            metavar="RUN",
            help="The run's folder; its model.safetensors is what --model takes.  "
            "[default: DATASET_run]",
            show_default=False,
        ),
    ] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Go on where the run stopped.")] = False,
    steps: Annotated[
        int | None,
        typer.Option(
            "--steps",
            metavar="N",
            help="Optimiser steps, one mesh each.  [default: 20000]",
            show_default=False,
        ),
    ] = None,
    epochs: Annotated[
        float | None,
        typer.Option(
            "--epochs",
            help="Passes over the training samples, in place of --steps.",
            show_default=False,
        ),
    ] = None,
    rate: Annotated[
        float | None,
        typer.Option("--rate", help="Peak learning rate.  [default: 0.001]", show_default=False),
    ] = None,
    preset: Annotated[
        str | None,
        typer.Option(
            "--preset",
            help="Sizes of the network: starter, or paper (three times the work a step).  "
            "[default: starter]",
            show_default=False,
        ),
    ] = None,
    init: Annotated[
        str | None,
        typer.Option(
            "--init",
            metavar="MODEL",
            help="Start from a trained model, to fine-tune it; `default` is the shipped one.",
            show_default=False,
        ),
    ] = None,
    device: Device = "auto",
    precision: Annotated[
        str | None,
        typer.Option(
            "--precision",
            help="float32, or bfloat16 (faster on hardware that has it).  [default: float32]",
            show_default=False,
        ),
    ] = None,
    seed: Annotated[
        int | None,
        typer.Option(
            "--seed", help="The same seed gives the same model.  [default: 0]", show_default=False
        ),
    ] = None,
) -> None:
    """Train a Vector Heat Network on a dataset.

    Ctrl-C stops with a checkpoint; `--resume` goes on from it and arrives at the same losses as an
    uninterrupted run.
    """
    run = Path(f"{datasets[0].as_posix().rstrip('/')}_run") if out is None else out
    check_folder("--out", run)
    if steps is not None and epochs is not None:
        raise ConfigError("give --steps or --epochs, not both")
    if init is not None and preset is not None:
        raise ConfigError("give --init or --preset, not both: a trained model has its own sizes")
    shell: Shell = ctx.obj
    from vhquad.cli.progress import Progress
    from vhquad.cli.show import show_training

    with Progress(shell.quiet, "loading libraries") as progress:
        from vhquad.learn.train import train as run_training
        from vhquad.nn.settings import preset as model_preset

        given = {"rate": rate, "precision": precision, "seed": seed}
        given["steps"] = steps if epochs is None else _steps_of(epochs, datasets)
        settings = _settings({k: v for k, v in given.items() if v is not None}, resume)
        model = None if preset is None else model_preset(preset)
        try:
            result = run_training(
                list(datasets),
                run,
                settings,
                model,
                init,
                resume,
                device,
                on_record=_Watch(progress, settings.steps if settings else None),
            )
        except KeyboardInterrupt:
            if (run / "checkpoint.safetensors").exists():
                complain(f"stopped; the same command with --resume goes on from {run}")
            raise
    show_training(shell, run, result)


def _settings(given: dict[str, object], resume: bool) -> TrainSettings | None:
    """The settings, or None to take those of the run that is resumed."""
    from vhquad.learn.schedule import TrainSettings

    if resume:
        if given:
            names = ", ".join(f"--{name}" for name in sorted(given))
            raise ConfigError(f"--resume goes on with the run's own settings; leave out {names}")
        return None
    return TrainSettings.from_dict(given)


def _steps_of(epochs: float, datasets: list[Path]) -> int:
    from vhquad.learn.dataset import open_dataset

    if epochs <= 0:
        raise ConfigError(f"--epochs must be positive, not {epochs}")
    samples = sum(len(open_dataset(path).split("train")) for path in datasets)
    return max(1, round(epochs * samples))


class _Watch:
    """Shows the losses as they come: those of training averaged, the last of validation."""

    def __init__(self, progress: Progress, steps: int | None) -> None:
        self.progress, self.steps = progress, steps
        self.direction = self.magnitude = None  # type: float | None
        self.validation = ""

    def __call__(self, record: Record) -> None:
        if record.split == "val":
            self.validation = f", validation {record.direction:.4f} / {record.magnitude:.4f}"
        else:
            self.direction = _follow(self.direction, record.direction)
            self.magnitude = _follow(self.magnitude, record.magnitude)
        share = None if self.steps is None else record.step / self.steps
        note = f"step {record.step}"
        if self.direction is not None and self.magnitude is not None:
            note += f", direction / magnitude {self.direction:.4f} / {self.magnitude:.4f}"
        self.progress("training", share, note + self.validation)


def _follow(average: float | None, value: float) -> float:
    return value if average is None else 0.98 * average + 0.02 * value

"""`vhquad train`: a dataset to a model."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from vhquad.cli.folders import holds_meshes, prepare
from vhquad.cli.guard import Shell, complain, guarded
from vhquad.cli.options import Device
from vhquad.cli.outputs import check_folder
from vhquad.errors import ConfigError

if TYPE_CHECKING:
    from vhquad.cli.progress import Progress
    from vhquad.learn.runstate import Record

__all__ = ["train"]

FEW_SAMPLES = 60  # of a folder of meshes, at least
MOST_OF_ONE = 20  # mesh
FEWEST_TO_SPLIT = 10  # meshes: with fewer, all are for training


@guarded
def train(
    ctx: typer.Context,
    datasets: Annotated[
        list[Path],
        typer.Argument(
            metavar="DATASET",
            help="Made by `vhquad preprocess`, or a folder of quad meshes, which is then prepared "
            "first; several are mixed.",
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
            help="Sizes of the network: starter, or paper (three times the work a step, and its "
            "loss by area).  [default: starter]",
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
    blocks: Annotated[
        int | None,
        typer.Option(
            "--blocks",
            metavar="N",
            help="With --init: deepen the model to N blocks; the new ones change nothing at first.",
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
    """Train a Vector Heat Network on a dataset, or on a folder of quad meshes.

    A folder of meshes is prepared into RUN/dataset: about 60 samples in all at least, whole,
    deformed and cropped; `vhquad preprocess` makes them to your measure. With `--init default` a
    handful of your meshes teaches the shipped model your style.

    Ctrl-C stops with a checkpoint; `--resume` goes on from it and arrives at the same losses as an
    uninterrupted run.
    """
    run = Path(f"{datasets[0].as_posix().rstrip('/')}_run") if out is None else out
    check_folder("--out", run)
    if steps is not None and epochs is not None:
        raise ConfigError("give --steps or --epochs, not both")
    if init is not None and preset is not None:
        raise ConfigError("give --init or --preset, not both: a trained model has its own sizes")
    if blocks is not None and init is None:
        raise ConfigError("--blocks deepens the model that --init names; add it")
    shell: Shell = ctx.obj
    from vhquad.cli.progress import Progress
    from vhquad.cli.show import show_training

    with Progress(shell.quiet, "loading libraries") as progress:
        from vhquad.learn.schedule import TrainSettings
        from vhquad.learn.train import train as run_training
        from vhquad.nn.settings import preset as model_preset

        weigh = "area" if preset == "paper" else None
        given = {"rate": rate, "precision": precision, "seed": seed, "steps": steps}
        if resume:
            _refuse({**given, "epochs": epochs, "blocks": blocks})
        ready = [
            _prepared(folder, run / "dataset" / f"{place}", init, preset, progress)
            if holds_meshes(folder)
            else folder
            for place, folder in enumerate(datasets)
        ]
        if epochs is not None:
            given["steps"] = _steps_of(epochs, ready)
        chosen = {name: v for name, v in {**given, "weigh": weigh}.items() if v is not None}
        settings = None if resume else TrainSettings.from_dict(chosen)
        model = None if preset is None else model_preset(preset)
        try:
            result = run_training(
                ready,
                run,
                settings,
                model,
                init,
                resume,
                device,
                on_record=_Watch(progress, settings.steps if settings else None),
                blocks=blocks,
            )
        except KeyboardInterrupt:
            if (run / "checkpoint.safetensors").exists():
                complain(f"stopped; the same command with --resume goes on from {run}")
            raise
    show_training(shell, run, result)


def _prepared(
    folder: Path, out: Path, init: str | None, preset: str | None, progress: Progress
) -> Path:
    """A dataset of a folder's meshes, with the features that the model to be trained takes."""
    from vhquad.learn.preprocess import MESH_SUFFIXES, PreprocessSettings
    from vhquad.nn.checkpoint import load_model
    from vhquad.nn.settings import preset as model_preset

    if (out / "index.json").exists():  # of the run that is resumed
        return out
    model = model_preset(preset or "starter") if init is None else load_model(init).settings
    count = sum(path.suffix.lower() in MESH_SUFFIXES for path in folder.rglob("*"))
    settings = PreprocessSettings(
        triangulations=min(max(FEW_SAMPLES // max(count, 1), 2), MOST_OF_ONE),
        crops=0.5,
        deform=0.5,
        val=0.0 if count < FEWEST_TO_SPLIT else 0.1,
        features=model.features,
        turned=model.turned,
        k=model.k,
    )
    return prepare(folder, out, settings, progress)


def _refuse(given: dict[str, object]) -> None:
    """Raise if a run that is resumed is given settings of its own."""
    names = ", ".join(f"--{name}" for name in sorted(given) if given[name] is not None)
    if names:
        raise ConfigError(f"--resume goes on with the run's own settings; leave out {names}")


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

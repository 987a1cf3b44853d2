"""`vhquad evaluate`: how good is a model on meshes whose quads are known."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from vhquad.cli.folders import holds_meshes, prepare
from vhquad.cli.guard import Shell, guarded
from vhquad.cli.options import Device
from vhquad.cli.outputs import check_folder, check_outputs, json_file
from vhquad.errors import ConfigError

if TYPE_CHECKING:
    from vhquad.cli.progress import Progress
    from vhquad.nn.checkpoint import Model

__all__ = ["evaluate"]

SPLITS = ("test", "val", "train", "all")


@guarded
def evaluate(
    ctx: typer.Context,
    model: Annotated[
        str,
        typer.Argument(
            metavar="MODEL",
            help="A trained model (.safetensors) or its folder; `default` is the shipped one.",
            show_default=False,
        ),
    ],
    datasets: Annotated[
        list[Path],
        typer.Argument(
            metavar="DATASET",
            help="Made by `vhquad preprocess`, or a folder of meshes as it takes them, which is "
            "prepared for this one time; several are taken together.",
            show_default=False,
        ),
    ],
    split: Annotated[
        str,
        typer.Option(
            "--split",
            metavar="NAME",
            help="test, val, train or all. Every shape of a folder of meshes is for testing, "
            "unless its split.json says otherwise.",
        ),
    ] = "test",
    json: Annotated[
        Path | None,
        typer.Option(
            "--json",
            metavar="FILE",
            help="Write all figures, those of each sample too, as JSON; - prints them instead of "
            "the tables.",
            show_default=False,
        ),
    ] = None,
    maps: Annotated[
        Path | None,
        typer.Option(
            "--maps",
            metavar="FOLDER",
            help="Write a PNG of each sample, coloured by the error and by the confidence; needs "
            "the extra viz, but no display.",
            show_default=False,
        ),
    ] = None,
    device: Device = "auto",
) -> None:
    """Measure a model on meshes whose quads are known.

    Prints the losses, angles and sizes of the network alone (`model`), of what `vhquad predict`
    makes of it (`model + curvature`), and of fields that need no learning: the one of `--method
    curvature`, the principal directions of curvature, and random ones. Then the directions once
    more as a remesh smooths the fields; how many singularities a remesh would find, against the
    artist's; and whether the model is right where it says that it is sure. A random field has a
    direction loss of 1 and is 22.5 degrees off; 0 is perfect.
    """
    if split not in SPLITS:
        raise ConfigError(f"--split takes {', '.join(SPLITS[:-1])} or {SPLITS[-1]}, not {split!r}")
    check_outputs([("--json", json_file(json), (".json",))])
    if maps is not None:
        check_folder("--maps", maps)
    shell: Shell = ctx.obj
    from vhquad.cli.progress import Progress
    from vhquad.cli.show_evaluation import publish_evaluation

    with Progress(shell.quiet, "loading libraries") as progress:
        from vhquad.learn.evaluate import evaluate as measure
        from vhquad.nn.checkpoint import load_model
        from vhquad.picture import check_viz

        if maps is not None:
            check_viz()
        loaded = load_model(model)

        def on_sample(done: int, count: int) -> None:
            progress("measuring", done / count, f"{done} of {count} samples")

        with _prepared(datasets, loaded, progress) as ready:
            result = measure(loaded, ready, split, device, maps, on_sample)  # type: ignore[arg-type]
    publish_evaluation(shell, json, result, model, datasets)


@contextmanager
def _prepared(folders: list[Path], model: Model, progress: Progress) -> Iterator[list[Path]]:
    """Datasets as they are, and folders of meshes as datasets that last as long as the context."""
    from tempfile import TemporaryDirectory

    from vhquad.learn.samples import PreprocessSettings

    settings = PreprocessSettings(
        triangulations=1,
        val=0.0,
        test=1.0,
        features=model.settings.features,
        turned=model.settings.turned,
        k=model.settings.k,
    )
    with TemporaryDirectory(prefix="vhquad-") as scratch:
        yield [
            prepare(folder, Path(scratch) / f"{place}", settings, progress)
            if holds_meshes(folder)
            else folder
            for place, folder in enumerate(folders)
        ]

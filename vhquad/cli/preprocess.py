"""`vhquad preprocess`: a folder of meshes to a dataset for training."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

import typer

from vhquad.cli.guard import Shell, complain, guarded
from vhquad.cli.outputs import check_folder
from vhquad.errors import ConfigError

__all__ = ["preprocess"]


@guarded
def preprocess(
    ctx: typer.Context,
    folder: Annotated[
        Path,
        typer.Argument(
            metavar="FOLDER",
            help="Holds quad meshes (OBJ, PLY, OFF), triangle meshes with a field file of the same "
            "name or quads (NAME_quads.obj) beside them, or plain triangle meshes; subfolders too.",
            show_default=False,
        ),
    ],
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            "-o",
            metavar="DATASET",
            help="The dataset's folder; what is in it already and still fits is kept.  "
            "[default: FOLDER_dataset]",
            show_default=False,
        ),
    ] = None,
    jobs: Annotated[
        int | None,
        typer.Option(
            "--jobs", "-j", min=1, help="Processes.  [default: all cores]", show_default=False
        ),
    ] = None,
    triangulations: Annotated[
        int, typer.Option("--triangulations", help="Samples made of each quad mesh.")
    ] = 2,
    vertices: Annotated[
        tuple[int, int],
        typer.Option("--vertices", metavar="LOW HIGH", help="Vertices of a sample."),
    ] = (2000, 4000),
    crops: Annotated[
        float, typer.Option("--crops", help="Share of the further samples that are cropped.")
    ] = 0.75,
    deform: Annotated[
        float, typer.Option("--deform", help="Share of the further samples that are deformed.")
    ] = 0.0,
    rough: Annotated[
        float, typer.Option("--rough", help="Share of the further samples with a scan's noise.")
    ] = 0.2,
    decimated: Annotated[
        float,
        typer.Option(
            "--decimated", help="Share of all samples with triangles as decimation leaves them."
        ),
    ] = 0.3,
    val: Annotated[
        float, typer.Option("--val", help="Share of the shapes kept for validation.")
    ] = 0.1,
    test: Annotated[
        float, typer.Option("--test", help="Share of the shapes kept for testing.")
    ] = 0.0,
    features: Annotated[
        str, typer.Option("--features", help="Input features: local, hks, gaussian, mean or pcd.")
    ] = "local",
    k: Annotated[int, typer.Option("--k", help="Eigenvectors.")] = 128,
    seed: Annotated[int, typer.Option("--seed", help="Of all random choices.")] = 0,
) -> None:
    """Turn a folder of meshes into a dataset that `vhquad train` takes."""
    target = Path(f"{folder.as_posix().rstrip('/')}_dataset") if out is None else out
    if target.exists() and folder.exists() and target.samefile(folder):
        raise ConfigError(f"--out {target} is the input folder; name another")
    check_folder("--out", target)
    shell: Shell = ctx.obj
    from vhquad.cli.progress import Progress

    with Progress(shell.quiet, "loading libraries") as progress:
        from vhquad.learn.preprocess import PreprocessSettings
        from vhquad.learn.preprocess import preprocess as run

        settings = PreprocessSettings(
            triangulations=triangulations,
            vertices=vertices,
            crops=crops,
            deform=deform,
            rough=rough,
            decimated=decimated,
            val=val,
            test=test,
            features=features,
            k=k,
            seed=seed,
        )

        def on_source(name: str, done: int, count: int) -> None:
            progress("preparing", done / count, f"{done} of {count}, last {name}")

        try:
            dataset = run(folder, target, settings, jobs or os.cpu_count() or 1, on_source)
        except KeyboardInterrupt:
            complain(f"stopped; the same command goes on from what is in {target}")
            raise
    for source, reason in dataset.skipped:
        complain(f"skipped {source}: {reason}")
    from vhquad.cli.show import show_dataset

    show_dataset(shell, dataset)

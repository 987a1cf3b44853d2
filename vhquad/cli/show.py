"""Reports as tables on stdout, or as JSON; figures come from the library, words from here."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from vhquad.cli.guard import Shell, complain
from vhquad.jsonable import plain, write_json
from vhquad.report import CheckReport, FieldReport, MeshCounts, RemeshReport

if TYPE_CHECKING:
    from rich.table import Table

    from vhquad.learn.dataset import Dataset
    from vhquad.learn.train import TrainResult
    from vhquad.mesh.quality import QualityReport

__all__ = ["publish", "show_dataset", "show_training"]

Report = RemeshReport | FieldReport | CheckReport


def publish(shell: Shell, file: Path | None, report: Report, target: str | None) -> None:
    """Write the JSON that was asked for, and the table unless stdout is taken or --quiet."""
    if file is not None and str(file) == "-":
        content = report.to_dict() if isinstance(report, RemeshReport) else plain(report)
        typer.echo(json.dumps(content, indent=2, ensure_ascii=False))
        return
    if file is not None:
        write_json(file, report)
    if shell.quiet:
        return
    if isinstance(report, RemeshReport):
        table = _remesh_table(report, target)
    elif isinstance(report, FieldReport):
        table = _field_table(report, target)
    else:
        table = _check_table(report)
    _print(table)
    if isinstance(report, CheckReport):
        for line in report.shortfalls():
            complain(line)


def show_dataset(shell: Shell, dataset: Dataset) -> None:
    """What a dataset holds."""
    if shell.quiet:
        return
    table = _table(f"{dataset.folder}")
    truth = [entry for entry in dataset.samples if entry.truth]
    shapes = {entry.shape for entry in dataset.samples}
    table.add_row("samples", f"{len(dataset.samples)} of {len(shapes)} shapes")
    table.add_row("with ground truth", f"{len(truth)}")
    for name in ("train", "val", "test"):
        table.add_row(f"  {name}", f"{sum(entry.split == name for entry in truth)}")
    table.add_row("skipped", f"{len(dataset.skipped)}")
    table.add_row("features", f"{dataset.features}, {dataset.in_channels} channels, k {dataset.k}")
    _print(table)


def show_training(shell: Shell, run: Path, result: TrainResult) -> None:
    """How a training run ended."""
    if shell.quiet:
        return
    table = _table(f"{run}")
    table.add_row("model", f"{result.model}")
    table.add_row("steps", f"{result.steps:,}")
    if result.validation is not None:
        table.add_row("validation: direction loss", f"{result.validation.direction:.4f}")
        table.add_row("validation: magnitude loss", f"{result.validation.magnitude:.4f}")
    table.add_row("time", _time(result.seconds))
    _print(table)


# ---- the tables -----------------------------------------------------------------------------


def _remesh_table(report: RemeshReport, target: str | None) -> Table:
    table = _table(target)
    _repair_rows(table, report.repair)
    table.add_row("quads", f"{report.made:,}  (asked {report.asked:,}{_off(report)})")
    if report.quality is not None:
        _quality_rows(table, report.quality, report.input)
    if report.symmetry is not None:
        found = report.symmetry
        table.add_row("mirror plane", found.plane if found.made else "not symmetric")
    if report.stand_in is not None:
        table.add_row("mapped on a copy of", f"{report.stand_in:,} triangles")
    cancelled = sum(part.cancelled for part in report.components)
    if cancelled:
        table.add_row("singularity pairs cancelled", f"{cancelled}")
    methods = [part.method for part in report.components]
    for method in dict.fromkeys(methods):
        share = f"  ({methods.count(method)} components)" if len(methods) > 1 else ""
        table.add_row("made by", f"{method}{share}")
    for reason in dict.fromkeys(part.reason for part in report.components if part.reason):
        table.add_row("  because", reason)
    _seconds_rows(table, report.seconds)
    return table


def _check_table(report: CheckReport) -> Table:
    table = _table("valid quad mesh" if report.is_valid else "not a valid quad mesh")
    table.add_row("quads", f"{report.quality.quads:,}")
    _quality_rows(table, report.quality, report.input)
    return table


def _field_table(report: FieldReport, target: str | None) -> Table:
    table = _table(target)
    _repair_rows(table, report.repair)
    counts = report.input
    table.add_row("mesh", f"{counts.vertices:,} vertices, {counts.faces:,} triangles")
    table.add_row("singularities", _indices(report.singularities))
    rest = (
        " (closed: must agree)" if counts.boundary_loops == 0 else " (the boundary takes the rest)"
    )
    table.add_row(
        "index sum / Euler characteristic",
        f"{report.index_sum:g} / {counts.euler_characteristic}{rest}",
    )
    if report.size is not None:
        low, middle, high = (report.size[name] for name in ("least", "median", "largest"))
        table.add_row("quad edge length", f"{low:.4g} to {high:.4g}, median {middle:.4g}")
    if report.quads is not None:
        table.add_row("quads these sizes make", f"{report.quads:,}")
    if report.trust is not None:
        mean, low = report.trust["mean"], report.trust["below_half"]
        table.add_row("clear directions", f"{mean:.0%}  (under half: {low:.0%} of the area)")
    if report.lost:
        table.add_row("this format", report.lost)
    _seconds_rows(table, report.seconds)
    return table


def _quality_rows(table: Table, quality: QualityReport, surface: MeshCounts | None) -> None:
    table.add_row("non-quads", f"{quality.non_quads}")
    topology = (quality.components, quality.euler_characteristic, quality.boundary_loops)
    names = ("components", "Euler characteristic", "boundary loops")
    for i, name in enumerate(names):
        before = "" if surface is None else f"{surface.topology[i]} → "
        table.add_row(name, f"{before}{topology[i]}")
    table.add_row("irregular vertices inside", _tally(quality.irregular_interior))
    if quality.boundary_loops:
        table.add_row("irregular vertices on the boundary", _tally(quality.irregular_boundary))
    table.add_row(
        "scaled Jacobian min / mean",
        f"{quality.scaled_jacobian_min:.3f} / {quality.scaled_jacobian_mean:.3f}",
    )
    table.add_row("folded quads", f"{quality.folded_quads}")
    table.add_row("self-intersections", f"{quality.self_intersections}")
    if quality.flipped_quads is not None:
        table.add_row("quads facing the wrong way", f"{quality.flipped_quads}")
    if quality.distance is not None:
        table.add_row(
            "distance to the input, max / mean",
            f"{quality.distance.hausdorff:.3f} / {quality.distance.mean:.4f} % of the diagonal",
        )


def _repair_rows(table: Table, lines: Iterable[str]) -> None:
    for line in lines:
        text, _, count = line.rpartition(": ")
        table.add_row(f"repair: {text}" if text else "repair", count)


def _seconds_rows(table: Table, seconds: Mapping[str, float]) -> None:
    if seconds:
        steps = ", ".join(f"{name} {value:.1f}" for name, value in seconds.items() if value >= 0.05)
        table.add_row("seconds", f"{sum(seconds.values()):.1f}" + (f"  ({steps})" if steps else ""))


def _indices(by_quads: Mapping[int, int]) -> str:
    if not by_quads:
        return "0"
    parts = []
    for quads, count in sorted(by_quads.items()):
        parts.append(f"{count} of {4 - quads:+d}/4")
    return f"{sum(by_quads.values())}  ({', '.join(parts)})"


def _tally(valences: Mapping[int, int]) -> str:
    if not valences:
        return "0"
    parts = ", ".join(f"{count} of valence {v}" for v, count in sorted(valences.items()))
    return f"{sum(valences.values())}  ({parts})"


def _off(report: RemeshReport) -> str:
    return f", {100.0 * (report.made / report.asked - 1.0):+.1f} %" if report.asked else ""


def _time(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{rest:02d}"


def _table(title: str | None) -> Table:
    from rich import box
    from rich.table import Table

    table = Table(
        box=box.SIMPLE, show_header=False, title=title, title_justify="left", pad_edge=False
    )
    table.add_column(style="bold", no_wrap=True)
    table.add_column(overflow="fold")
    return table


def _print(table: Table) -> None:
    from rich.console import Console  # here, not above: --quiet and --json do without rich

    Console(markup=False, highlight=False).print(table)

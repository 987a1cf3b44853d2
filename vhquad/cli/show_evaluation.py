"""What `vhquad evaluate` found, as tables on stdout or as JSON."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer
from rich import box
from rich.console import Console
from rich.table import Table

from vhquad.cli.guard import Shell
from vhquad.jsonable import plain, write_json

if TYPE_CHECKING:
    from vhquad.learn.evaluate import Evaluation
    from vhquad.learn.scores import EvaluationRow

__all__ = ["publish_evaluation"]


def publish_evaluation(
    shell: Shell, file: Path | None, found: Evaluation, model: str, datasets: list[Path]
) -> None:
    """Write the JSON that was asked for, and the tables unless stdout is taken or --quiet."""
    content: dict[str, Any] = {"model": model, "datasets": plain(datasets), **plain(found)}
    if file is not None and str(file) == "-":
        typer.echo(json.dumps(content, indent=2, ensure_ascii=False))
        return
    if file is not None:
        write_json(file, content)
    if shell.quiet:
        return
    console = Console(markup=False, highlight=False)
    for table in (
        _losses(found.rows, f"directions, {_samples(len(found.samples))}"),
        _losses(found.polished, "directions, as a remesh smooths the field"),
        _sizes(found),
        _singularities(found),
        _calibration(found),
    ):
        console.print(table)


def _losses(rows: Sequence[EvaluationRow], title: str) -> Table:
    names = ("loss", "±", "mean", "median", "95 %", "over 15°")
    table = _table(title, "", *names)
    group = None
    for row in rows:
        group = _section(table, group, row.group, row.meshes)
        table.add_row(
            row.method,
            f"{row.direction:.3f}",
            f"{row.direction_spread:.3f}",
            f"{row.mean_angle:.2f}°",
            f"{row.median_angle:.2f}°",
            f"{row.p95_angle:.1f}°",
            f"{100.0 * row.over_15:.1f} %",
        )
    return table


def _sizes(found: Evaluation) -> Table:
    table = _table("sizes", "", "loss", "±", "too large by", "spread of the logarithm")
    group = None
    for row in found.rows:
        if row.magnitude is None or row.size_bias is None:
            continue
        group = _section(table, group, row.group, row.meshes)
        table.add_row(
            row.method,
            f"{row.magnitude:.3f}",
            f"{row.magnitude_spread:.3f}",
            f"{100.0 * row.size_bias:+.1f} %",
            f"{row.size_spread:.3f}",
        )
    return table


def _singularities(found: Evaluation) -> Table:
    names = ("found", "artist's", "ratio", "of the artist's, in place")
    table = _table("singularities, as a remesh smooths the field", "", *names)
    group = None
    for row in found.singularities:
        group = _section(table, group, row.group, row.meshes)
        table.add_row(
            row.method,
            f"{row.count:,}",
            f"{row.artists:,}",
            _share(row.count, row.artists),
            _share(row.matched, row.artists),
        )
    return table


def _calibration(found: Evaluation) -> Table:
    methods = list(found.calibration[0].losses) if found.calibration else []
    table = _table("direction loss by stated confidence", "confidence", "share", *methods)
    for one in found.calibration:
        text = f"{one.low:g}" if one.low == one.high else f"{one.low:g} to {one.high:g}"
        losses = (f"{one.losses[method]:.3f}" for method in methods)
        table.add_row(text, f"{100.0 * one.share:.1f} %", *losses)
    return table


def _table(title: str, first: str, *columns: str) -> Table:
    table = Table(box=box.SIMPLE, title=title, title_justify="left", pad_edge=False)
    table.add_column(first, overflow="fold")  # where there is no room; figures have theirs
    for name in columns:
        table.add_column(name, justify="right", no_wrap=True)
    return table


def _section(table: Table, before: str | None, group: str, meshes: int) -> str:
    """Start a section of the table where the group changes."""
    if group != before and (before is not None or group != "all"):
        table.add_section()
    if group != before:
        table.add_row(f"{group} ({_samples(meshes)})", style="bold")
    return group


def _samples(count: int) -> str:
    return f"{count} sample{'s' if count != 1 else ''}"


def _share(part: int, whole: int) -> str:
    return f"{100.0 * part / whole:.0f} %" if whole else ""

"""Folders of meshes where a dataset is wanted: prepared on the way, as `vhquad preprocess` does."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING

from vhquad.cli.guard import complain

if TYPE_CHECKING:
    from vhquad.cli.progress import Progress
    from vhquad.learn.samples import PreprocessSettings

__all__ = ["holds_meshes", "prepare"]


def holds_meshes(folder: Path) -> bool:
    """Whether a folder is no dataset, and may hold the meshes for one."""
    return folder.is_dir() and not (folder / "index.json").exists()


def prepare(folder: Path, out: Path, settings: PreprocessSettings, progress: Progress) -> Path:
    """Make a dataset of a folder's meshes, name those that are skipped, and return ``out``."""
    from vhquad.learn.preprocess import preprocess

    def on_source(name: str, done: int, count: int) -> None:
        progress(f"preparing {folder}", done / count, f"{done} of {count}, last {name}")

    dataset = preprocess(folder, out, settings, os.cpu_count() or 1, on_source)
    for source, reason in dataset.skipped:
        complain(f"skipped {source}: {reason}")
    return out

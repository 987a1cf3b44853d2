"""Checks of output files before the long work starts: format, folder, and no input overwritten."""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path

from vhquad.errors import ConfigError

__all__ = ["MESHES", "check_folder", "check_outputs", "json_file"]

MESHES = (".obj", ".ply", ".off")


def check_outputs(
    wanted: Iterable[tuple[str, Path | None, tuple[str, ...]]], inputs: Iterable[Path | None] = ()
) -> None:
    """Refuse output files that could not be written in the end, or would destroy an input.

    Parameters
    ----------
    wanted : iterable of (option, path or None, suffixes)
        What the option is called, the file it names if it was given, and the formats it takes.
    inputs : iterable of path or None
        Files that are read.

    Raises
    ------
    ConfigError
        If a suffix is another, a folder cannot be made or written, a name is a folder's, two
        options name one file, or an input would be overwritten.
    """
    sources = [path for path in inputs if path is not None]
    seen: dict[Path, str] = {}
    for option, path, suffixes in wanted:
        if path is None:
            continue
        if path.suffix.lower() not in suffixes:
            kinds = " or ".join(
                [", ".join(suffixes[:-1]), suffixes[-1]] if suffixes[1:] else suffixes
            )
            found = f"the suffix {path.suffix!r}" if path.suffix else "no suffix"
            raise ConfigError(f"{option} {path} has {found}; name a file that ends in {kinds}")
        if path.is_dir():
            raise ConfigError(f"{option} {path} is a folder; name a file in it")
        check_folder(option, path.parent)
        if any(_same(path, source) for source in sources):
            raise ConfigError(f"{option} {path} would overwrite an input; name another file")
        other = seen.setdefault(path.absolute(), option)
        if other != option:
            raise ConfigError(f"{other} and {option} both name {path}; give each its own file")


def check_folder(option: str, folder: Path) -> None:
    """Refuse a folder that neither exists nor can be made, or cannot be written to.

    Raises
    ------
    ConfigError
    """
    nearest = folder.absolute()
    while not nearest.exists() and nearest != nearest.parent:
        nearest = nearest.parent
    if not nearest.is_dir():
        raise ConfigError(f"{option}: {nearest} is a file, so {folder} cannot be made")
    if not os.access(nearest, os.W_OK | os.X_OK):
        raise ConfigError(f"{option}: no right to write in {nearest}; choose another folder")


def json_file(path: Path | None) -> Path | None:
    """The file of --json; None if there is none, or it is - for the standard output."""
    return None if path is None or str(path) == "-" else path


def _same(path: Path, source: Path) -> bool:
    return path.exists() and source.exists() and path.samefile(source)

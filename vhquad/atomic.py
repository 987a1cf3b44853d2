"""Files written whole or not at all: beside the target under another name, then renamed."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

__all__ = ["atomic_path", "write_atomic"]


@contextmanager
def atomic_path(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Give a temporary path to write to; on leaving without an exception it becomes `path`.

    Whatever goes wrong inside, Ctrl-C included, the temporary file is removed and an earlier file
    at `path` stays as it was. The temporary name keeps the suffix, for writers that look at it.

    Parameters
    ----------
    path : str or PathLike
        The file wanted; missing parent folders are made.

    Yields
    ------
    Path
        An existing empty file in the same folder.

    Raises
    ------
    OSError
        If the folder cannot be made or written, or `path` is a folder.
    """
    target = Path(path)
    if target.is_dir():
        raise IsADirectoryError(f"{target} is a folder; name a file to write")
    target.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(
        prefix=f".{target.stem[:40]}-", suffix=target.suffix, dir=target.parent
    )
    temporary = Path(name)
    try:
        os.close(handle)
        yield temporary
        os.chmod(temporary, _mode(target))
        os.replace(temporary, target)
    finally:
        temporary.unlink(missing_ok=True)


def write_atomic(path: str | os.PathLike[str], data: bytes | str) -> None:
    """Write bytes, or text as UTF-8 with ``\\n`` line ends, whole or not at all."""
    with atomic_path(path) as temporary:
        temporary.write_bytes(data.encode("utf-8") if isinstance(data, str) else data)


def _mode(target: Path) -> int:
    """Permissions of the file replaced, else those a new file gets (mkstemp gives 0600)."""
    try:
        return target.stat().st_mode & 0o777
    except OSError:
        mask = os.umask(0)
        os.umask(mask)
        return 0o666 & ~mask

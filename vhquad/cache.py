"""Results kept in files, found again by content: what they were made of, and the code itself.

An entry that is damaged or of another shape is never used; a folder that cannot be written to is no
error, only slower. Beyond ``MOST_BYTES``, what has not been used for the longest time goes.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import sys
import zipfile
from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vhquad.atomic import atomic_path

__all__ = ["code_digest", "content_key", "default_cache_dir", "read_arrays", "write_arrays"]

MOST_BYTES = 4 * 2**30
ENTRY = re.compile(r"([a-z-]+-)?[0-9a-f]{40}\.npz")  # nothing else in the folder is ours


def default_cache_dir() -> Path:
    """``VHQUAD_CACHE`` if set, else ``vhquad`` in the system's cache folder of the user."""
    if chosen := os.environ.get("VHQUAD_CACHE"):
        return Path(chosen).expanduser()
    if sys.platform == "win32":
        base = os.environ.get("LOCALAPPDATA", "~/AppData/Local")
    elif sys.platform == "darwin":
        base = "~/Library/Caches"
    else:
        base = os.environ.get("XDG_CACHE_HOME") or "~/.cache"
    return Path(base).expanduser() / "vhquad"


def content_key(*parts: Any) -> str:
    """40 hexadecimal digits of all parts: arrays by shape and bytes, the rest as JSON."""
    digest = hashlib.sha256()
    for part in parts:
        if isinstance(part, np.ndarray):
            digest.update(str(part.shape).encode())
            digest.update(np.ascontiguousarray(part).tobytes())
        elif isinstance(part, bytes):
            digest.update(part)
        else:
            digest.update(json.dumps(part, sort_keys=True).encode())
    return digest.hexdigest()[:40]


@cache
def code_digest() -> str:
    """Of this package's source, so that results of other code are not taken for those of this."""
    folder = Path(__file__).resolve().parent
    digest = hashlib.sha256()
    for path in sorted(folder.rglob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()


def read_arrays(path: Path, names: Sequence[str]) -> list[NDArray[Any]] | None:
    """The arrays of an entry in the order of the names; None if it is absent or damaged."""
    try:
        with open(path, "rb") as handle, np.load(handle, allow_pickle=False) as data:
            found = [data[name] for name in names]
        with suppress(OSError):
            os.utime(path)  # used just now
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
        return None
    finite = all(np.isfinite(a).all() for a in found if a.dtype.kind in "fc")
    return found if finite else None


def write_arrays(path: Path, arrays: Mapping[str, NDArray[Any]]) -> None:
    """Keep an entry, whole or not at all; a full or read-only disk is ignored."""
    with suppress(OSError):
        with atomic_path(path) as temporary:
            np.savez(temporary, **arrays)  # type: ignore[arg-type]
        _forget_oldest(path.parent)


def _forget_oldest(folder: Path) -> None:
    """Remove the entries used longest ago until the folder keeps to its size."""
    entries = []
    for path in folder.iterdir():
        if ENTRY.fullmatch(path.name):
            with suppress(OSError):  # another process may have removed it
                about = path.stat()
                entries.append((about.st_mtime, about.st_size, path))
    total = sum(size for _, size, _ in entries)
    for _, size, path in sorted(entries)[:-1]:
        if total <= MOST_BYTES:
            break
        with suppress(OSError):
            path.unlink()
        total -= size

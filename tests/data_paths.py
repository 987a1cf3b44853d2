"""Where the optional test meshes lie: folder VHQUAD_DATA, else ../shared/data."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
DATA = Path(os.environ.get("VHQUAD_DATA") or ROOT.parent / "shared" / "data")


def data_file(*parts: str) -> Path:
    """Path of a data file such as ``data_file("tris", "fish.obj")``; skips the test without it."""
    path = DATA.joinpath(*parts)
    if not path.exists():
        pytest.skip(f"needs {'/'.join(parts)} of the test data (set VHQUAD_DATA)")
    return path


def data_files(folder: str) -> list[Path]:
    """The OBJ files of a data folder ("tris" or "quads"), sorted; empty without the data."""
    return sorted((DATA / folder).glob("*.obj"))


needs_data = pytest.mark.skipif(not DATA.is_dir(), reason="needs the test data (set VHQUAD_DATA)")

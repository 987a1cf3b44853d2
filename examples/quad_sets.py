"""Sets of quad meshes on disk: numbered OBJ files, and which are for training, validation, test."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

__all__ = ["Drawn", "write_obj", "write_set"]

Drawn = tuple[str, NDArray[np.float64], NDArray[np.int64]]
"""What a mesh is, its vertices and faces."""


def write_obj(path: Path, drawn: Drawn) -> None:
    """Write positions (seven decimals) and faces; the file appears whole or not at all."""
    about, vertices, faces = drawn
    lines = [f"# {about}, CC0 1.0"]
    lines += [f"v {x:.7f} {y:.7f} {z:.7f}" for x, y, z in vertices]
    lines += ["f " + " ".join(map(str, face)) for face in (faces + 1).tolist()]
    partial = path.with_suffix(".partial")
    partial.write_text("\n".join(lines) + "\n", encoding="ascii")
    partial.replace(path)


def write_set(folder: Path, kind: str, count: int, draw: Callable[[int], Drawn]) -> None:
    """Write KIND_0000.obj ... and the split into ``folder``; files that are there are kept."""
    folder.mkdir(parents=True, exist_ok=True)
    listed = folder / "split.json"  # may list others
    split = json.loads(listed.read_text(encoding="ascii")) if listed.exists() else {}
    for identity in range(count):
        name = f"{kind}_{identity:04d}"
        split[name] = {3: "val", 7: "test", 12: "test"}.get(identity % 15, "train")
        path = folder / f"{name}.obj"
        if not path.exists():
            write_obj(path, draw(identity))
    listed.write_text(json.dumps(split, indent=1) + "\n", encoding="ascii")

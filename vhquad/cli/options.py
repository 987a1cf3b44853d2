"""Options and parsers that several commands share."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated

import typer

from vhquad.errors import ConfigError

__all__ = ["Device", "FullResolution", "JsonFile", "Mesh", "ModelFile", "NoCache", "parse_crease"]

Mesh = Annotated[
    Path,
    typer.Argument(
        metavar="MESH",
        help="The surface: OBJ, PLY, STL, OFF or GLB; triangles, or polygons that get cut.",
        show_default=False,
    ),
]
ModelFile = Annotated[
    str | None,
    typer.Option(
        "--model",
        metavar="FILE",
        help="A trained model (.safetensors) or its folder.  [default: the shipped one]",
        show_default=False,
    ),
]
Device = Annotated[
    str,
    typer.Option(
        "--device", metavar="NAME", help="auto (CUDA where there is one), cpu, cuda, cuda:1 ..."
    ),
]
FullResolution = Annotated[
    bool,
    typer.Option(
        "--full-resolution",
        help="Work on the mesh itself, however large, not on decimated copies.",
    ),
]
NoCache = Annotated[
    bool, typer.Option("--no-cache", help="Neither use nor keep anything in the cache folder.")
]
JsonFile = Annotated[
    Path | None,
    typer.Option(
        "--json",
        metavar="FILE",
        help="Write the report as JSON; - prints it instead of the table.",
        show_default=False,
    ),
]


def parse_crease(text: str) -> float | None:
    """The value of --crease: degrees, or None for "off".

    Raises
    ------
    ConfigError
        If it is neither.
    """
    if text.strip().lower() in ("off", "none"):
        return None
    if re.fullmatch(r"\s*\d+(\.\d*)?\s*(°|deg)?\s*", text):
        degrees = float(re.sub(r"[^\d.]", "", text))
        if 0.0 < degrees <= 180.0:
            return degrees
    raise ConfigError(f"--crease takes degrees above 0 and up to 180, or off, not {text!r}")

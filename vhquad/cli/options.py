"""Options and parsers that several commands share."""

from __future__ import annotations

import os
import re
import sys
from pathlib import Path
from typing import Annotated

import typer

from vhquad.errors import ConfigError

__all__ = [
    "Device",
    "FullResolution",
    "JsonFile",
    "Mesh",
    "ModelFile",
    "NoCache",
    "Threads",
    "limit_threads",
    "parse_crease",
]

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
        help="Work on the mesh itself, not on a copy whose triangles suit the quads.",
    ),
]
NoCache = Annotated[
    bool, typer.Option("--no-cache", help="Neither use nor keep anything in the cache folder.")
]
Threads = Annotated[
    int | None,
    typer.Option(
        "--threads",
        metavar="N",
        min=1,
        help="Threads for linear algebra, no more than there are cores.  [default: what the "
        "libraries choose, by OMP_NUM_THREADS and the cores]",
        show_default=False,
    ),
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


def limit_threads(threads: int | None) -> None:
    """Have the libraries for linear algebra use so many threads, at most one for each core.

    They look at the environment when they are first imported, so this goes before numpy.
    """
    if threads is None:
        return
    own = getattr(os, "sched_getaffinity", None)  # the cores this process may use; Linux only
    cores = len(own(0)) if own is not None else os.cpu_count() or 1
    for library in ("OMP", "OPENBLAS", "MKL", "VECLIB"):
        name = "VECLIB_MAXIMUM_THREADS" if library == "VECLIB" else f"{library}_NUM_THREADS"
        os.environ[name] = str(min(threads, cores))
    if "torch" in sys.modules:
        sys.modules["torch"].set_num_threads(min(threads, cores))


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

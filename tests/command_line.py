"""Running vhquad's commands and scripts in tests: in this process, or as a program of its own."""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from numpy.typing import ArrayLike

from vhquad.cli.app import main

ROOT = Path(__file__).resolve().parents[1]


@dataclass(frozen=True)
class Run:
    """How a command ended."""

    code: int
    out: str
    err: str

    def refused(self, *words: str) -> bool:
        """Whether it ended with code 2 and one line on stderr that holds all the words."""
        lines = self.err.strip().splitlines()
        return (
            self.code == 2
            and len(lines) == 1
            and lines[0].startswith("vhquad: error: ")
            and all(word in lines[0] for word in words)
        )


Invoke = Callable[..., Run]


def invoke_with(capsys: pytest.CaptureFixture[str]) -> Invoke:
    """A function that runs a command in this process."""

    def invoke(*arguments: str | Path) -> Run:
        capsys.readouterr()
        with pytest.raises(SystemExit) as end:
            main([str(a) for a in arguments])
        captured = capsys.readouterr()
        return Run(int(end.value.code or 0), captured.out, captured.err)

    return invoke


@contextmanager
def program(*arguments: str | Path, cwd: Path | None = None) -> Iterator[subprocess.Popen[str]]:
    """`python -m vhquad ...` as a program of its own that heeds Ctrl-C; killed in the end.

    What was started in the background ignores Ctrl-C, and so would its children.
    """
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1"}
    start = (
        "import runpy, signal; signal.signal(signal.SIGINT, signal.default_int_handler); "
        "runpy.run_module('vhquad', run_name='__main__', alter_sys=True)"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", start, *map(str, arguments)],
        cwd=cwd,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


def load_script(path: str) -> ModuleType:
    """A script of the repository as a module, under the name of its file."""
    name = Path(path).stem
    spec = importlib.util.spec_from_file_location(name, ROOT / path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module  # dataclasses look their module up
    spec.loader.exec_module(module)
    return module


def write_obj(path: Path, vertices: ArrayLike, faces: ArrayLike) -> Path:
    """Faces of any size as OBJ, as they stand."""
    lines = ["v " + " ".join(map(repr, row)) for row in np.asarray(vertices).tolist()]
    lines += ["f " + " ".join(map(str, row)) for row in (np.asarray(faces) + 1).tolist()]
    path.write_text("\n".join(lines) + "\n", encoding="ascii")
    return path

"""Options that several commands share: threads are limited before any library looks."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.command_line import Invoke
from vhquad.cli.options import limit_threads


def test_threads_reach_the_libraries() -> None:
    code = (
        "import sys; from vhquad.cli.options import limit_threads;"
        "assert 'numpy' not in sys.modules;"
        "limit_threads(1); import torch; print(torch.get_num_threads())"
    )
    environment = {k: v for k, v in os.environ.items() if not k.endswith("_NUM_THREADS")}
    made = subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True
    )
    assert made.stdout.split() == ["1"]


def test_never_more_threads_than_cores(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "environ", {"OMP_NUM_THREADS": "3"})
    monkeypatch.delitem(sys.modules, "torch", raising=False)
    limit_threads(None)
    assert os.environ == {"OMP_NUM_THREADS": "3"}
    limit_threads(10**6)
    assert 1 <= int(os.environ["OMP_NUM_THREADS"]) <= (os.cpu_count() or 1)
    assert os.environ["OPENBLAS_NUM_THREADS"] == os.environ["MKL_NUM_THREADS"]


@pytest.mark.parametrize("command", ["remesh", "predict"])
def test_no_threads_are_refused(command: str, invoke: Invoke, tmp_path: Path) -> None:
    run = invoke(command, str(tmp_path / "x.obj"), "--threads", "0")
    assert run.code == 2
    assert "--threads" in run.err

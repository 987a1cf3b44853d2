"""The command line as a whole: start, global options, errors, signals."""

from __future__ import annotations

import io
import os
import signal
import sys
import time
from pathlib import Path

import pytest

from tests.command_line import Invoke, program, write_obj
from tests.meshes import blob, icosphere
from vhquad import __version__, api
from vhquad.cli.progress import Progress


def test_version(invoke: Invoke) -> None:
    assert invoke("--version").out == f"vhquad {__version__}\n"


def test_help_names_every_command(invoke: Invoke) -> None:
    run = invoke("--help")
    assert run.code == 0
    for name in ("remesh", "predict", "check", "preprocess", "train"):
        assert f"\n  {name} " in run.out
        assert invoke(name, "--help").code == 0


def test_help_starts_at_once() -> None:
    """Processor time, because the wall time depends on what else runs; CI measures that."""
    resource = pytest.importorskip("resource")
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    with program("--help") as process:
        process.communicate(timeout=30)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    assert process.returncode == 0
    assert after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime < 0.4


def test_unknown_command_and_option(invoke: Invoke) -> None:
    assert invoke("remsh").code == 2
    run = invoke("remesh", "a.obj", "--target", "5")
    assert run.code == 2
    assert "--target" in run.err


def test_missing_mesh_is_named(invoke: Invoke, tmp_path: Path) -> None:
    run = invoke("remesh", "--out", tmp_path / "quad.obj")
    assert run.code == 2
    assert "Missing argument 'MESH'" in run.err
    assert "Traceback" not in run.err


def fail_with(error: BaseException, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(path: object) -> None:
        raise error

    monkeypatch.setattr(api, "load_kept", broken)


def test_unexpected_error_is_one_line(invoke: Invoke, monkeypatch: pytest.MonkeyPatch) -> None:
    fail_with(RuntimeError("a bug\nin two lines"), monkeypatch)
    run = invoke("remesh", "a.obj")
    assert run.code == 1
    expected = "unexpected error: RuntimeError: a bug in two lines (run with --debug for the"
    assert run.err == f"vhquad: {expected} traceback)\n"


@pytest.mark.parametrize("place", [0, 1, 3])
def test_debug_shows_the_traceback(
    invoke: Invoke, monkeypatch: pytest.MonkeyPatch, place: int
) -> None:
    """Wherever --debug stands."""
    fail_with(RuntimeError("a bug"), monkeypatch)
    arguments = ["remesh", "a.obj", "--seed=1"]
    run = invoke(*arguments[:place], "--debug", *arguments[place:])
    assert run.code == 1
    assert "Traceback (most recent call last)" in run.err
    assert run.err.endswith("vhquad: unexpected error: RuntimeError: a bug\n")


def test_interrupt(invoke: Invoke, monkeypatch: pytest.MonkeyPatch) -> None:
    fail_with(KeyboardInterrupt(), monkeypatch)
    run = invoke("remesh", "a.obj")
    assert (run.code, run.err) == (130, "vhquad: interrupted\n")


def test_out_of_memory(invoke: Invoke, monkeypatch: pytest.MonkeyPatch) -> None:
    fail_with(MemoryError(), monkeypatch)
    run = invoke("remesh", "a.obj")
    assert run.code == 1
    assert "out of memory" in run.err


def test_library_warnings_are_one_line(invoke: Invoke, tmp_path: Path) -> None:
    source = write_obj(tmp_path / "a.obj", *mesh_arrays())
    run = invoke("remesh", source, "--method", "curvature", "--target-quads", "50", "--quiet")
    assert (run.code, run.out) == (0, "")


def mesh_arrays() -> tuple[object, object]:
    mesh = icosphere(2)
    return mesh.vertices, mesh.faces


def test_without_a_terminal_progress_is_silent(capsys: pytest.CaptureFixture[str]) -> None:
    with Progress(False, "starting") as progress:
        progress("working", 0.5)
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_leaves_nothing(tmp_path: Path, number: signal.Signals) -> None:
    """Stopped in the middle of a long remesh, a program of its own leaves its input only.

    The input is a pipe, so the test knows when it has been read.
    """
    if not hasattr(os, "mkfifo"):
        pytest.skip("needs named pipes")
    mesh = blob(6)
    pipe = tmp_path / "blob.obj"
    os.mkfifo(pipe)
    options = ("--method", "curvature", "--out", tmp_path / "q.obj")
    with program("remesh", pipe, *options) as process:
        write_obj(pipe, mesh.vertices, mesh.faces)
        time.sleep(1.0)
        assert process.poll() is None, "the remesh was over before the signal"
        process.send_signal(number)
        out, err = process.communicate(timeout=60)
    assert process.returncode == 128 + number
    assert "Traceback" not in err
    assert out == ""
    assert [p.name for p in tmp_path.iterdir()] == ["blob.obj"]


def test_progress_on_a_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    """What runs, how far, and a clock that goes on after a step is done."""

    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    screen = Terminal()
    monkeypatch.setattr(sys, "stderr", screen)
    monkeypatch.setenv("TERM", "xterm")
    with Progress(False, "starting") as progress:
        progress("first step", 1.0, "note")
        time.sleep(1.1)
        progress("second step")
        time.sleep(0.3)
    text = screen.getvalue()
    assert "second step" in text
    assert "note" in text
    assert text.rindex("0:00:01") > text.rindex("first step")

"""The README: its commands run, its options exist, its messages are those of the code."""

from __future__ import annotations

import re
import runpy
import shlex
import shutil
import sys
from pathlib import Path

import pytest

from tests.command_line import ROOT, Invoke, write_obj
from tests.meshes import half_sphere
from tests.quad_meshes import cube_sphere, quad_torus

README = (ROOT / "README.md").read_text(encoding="utf-8")
START = """\
pip install . && vhquad remesh examples/head.obj --out quad.obj
pip install '.[test]' && pytest
"""
# What is added to a command so that a test need not wait; the rest is run as it stands.
SHORTER = {
    "preprocess": [
        "--vertices",
        "300",
        "350",
        "--triangulations",
        "1",
        "--val",
        "0",
        "--jobs",
        "1",
    ],
    "train": ["--steps", "1"],
    "evaluate": ["--split", "all"],  # nothing was put aside
}
SKIPPED = ("pip", "pytest", "python examples/make_")  # CI runs the first line itself


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", README, flags=re.DOTALL)


def commands() -> list[str]:
    """Every command of the README, in order."""
    lines = [line.strip() for block in blocks("sh") for line in block.splitlines()]
    parts = [part.strip() for line in lines for part in line.split("&&")]
    return [part for part in parts if part and not part.startswith(SKIPPED)]


@pytest.fixture
def checkout(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder like the checkout, with small meshes in place of the head and the heads."""
    shutil.copytree(
        ROOT / "examples", tmp_path / "examples", ignore=shutil.ignore_patterns("*.obj")
    )
    bowl = half_sphere(3)
    write_obj(tmp_path / "examples" / "head.obj", bowl.vertices, bowl.faces)
    (tmp_path / "quads").mkdir()
    write_obj(tmp_path / "quads" / "torus.obj", *quad_torus())
    write_obj(tmp_path / "quads" / "ball.obj", *cube_sphere())
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_the_start_stands_word_for_word() -> None:
    assert blocks("sh")[0] == START


def test_commands_run(invoke: Invoke, checkout: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In the order in which they stand, each with the files that those before have made."""
    assert len(commands()) >= 9
    for command in commands():
        words = shlex.split(command)
        if words[0] == "vhquad":
            if "--preview" in words:
                pytest.importorskip("pyvista")
            run = invoke(*words[1:], *SHORTER.get(words[1], []))
            assert run.code == 0, f"{command}\n{run.err}"
        else:
            assert words[0] == "python", command
            monkeypatch.setattr(sys, "argv", words[1:])
            runpy.run_path(str(checkout / words[1]), run_name="__main__")
    made = ["quad.obj", "head.rawfield", "dataset/index.json", "run/model.safetensors"]
    for name in [*made, "quadwild/head.obj", "quadwild/head.rosy", "quadwild/head.sharp"]:
        assert (checkout / name).exists(), name


def test_python_runs(
    checkout: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("VHQUAD_CACHE", str(checkout / "cache"))
    for block in blocks("python"):
        exec(compile(block, "README.md", "exec"), {})
    assert (checkout / "quad.obj").exists()
    assert len(capsys.readouterr().out.split()) == 2


def test_options_are_explained_and_exist(invoke: Invoke) -> None:
    """Every option of remesh and predict is in the README; it names no option that is not there."""
    known: set[str] = set()
    for name in ("remesh", "predict", "check", "preprocess", "train", "evaluate"):
        options = set(re.findall(r"(?<![\w-])--[a-z][a-z-]*", invoke(name, "--help").out))
        if name in ("remesh", "predict"):
            missing = {o for o in options - {"--help"} if not re.search(rf"{o}\b", README)}
            assert not missing, f"README does not explain {missing} of {name}"
        known |= options
    known |= set(re.findall(r"--[a-z][a-z-]*", invoke("--help").out))
    known |= {"--force-reinstall", "--count", "--quads", "--picture"}  # of pip, of the examples
    text = re.sub(r"\]\([^)]*\)", "", README)
    named = set(re.findall(r"(?<![\w-])--[a-z][a-z-]*", text))
    assert named <= known, f"README names unknown options {named - known}"


def test_messages_are_those_of_the_code() -> None:
    """Each text in the table of messages stands in the code, so that searching for it helps."""
    table = README.split("By the text of the message:")[1].split("## Limits")[0]
    table = table[: table.index("\n\n", table.index("|---"))]
    code = "\n".join(p.read_text(encoding="utf-8") for p in (ROOT / "vhquad").rglob("*.py"))
    code = re.sub(r'"\s*\n\s*f?"', "", code)  # joined literals
    rows = [row.split("|")[1] for row in table.strip().splitlines()[2:]]
    assert len(rows) > 15
    own = ("Missing argument", "components ... no area")  # typer's; counted in two places
    for row in rows:
        for message in re.findall(r"`([^`]+)`", row):
            if message.startswith(own):
                continue
            for part in re.split(r"\s*\.\.\.\s*|cuda |\(|\)|, | '[^']*'", message):
                assert part.strip() in code, f"{part!r} of {message!r}"


def test_linked_files_exist() -> None:
    for target in re.findall(r"\]\(([^)#]+)\)", README):
        if not target.startswith("http"):
            assert (ROOT / target).exists(), target
    for name in re.findall(r"examples/\w+\.\w+", README):
        assert (ROOT / name).exists(), name

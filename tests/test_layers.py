"""Imports go downwards only, quad and learn do not know each other, the commands start light."""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1] / "vhquad"

# A module may import from its own package and from those of a lower level.
LEVELS = {
    "errors": 0,
    "atomic": 0,
    "cache": 1,
    "jsonable": 1,
    "watch": 1,
    "mesh": 2,
    "report": 3,
    "geometry": 3,
    "nn": 3,
    "field": 4,
    "picture": 5,
    "learn": 6,
    "quad": 6,
    "api": 7,
    "preview": 7,
    "cli": 8,
    "__main__": 9,
}
HEAVY = ("numpy", "scipy", "torch", "trimesh", "igl", "rich", "safetensors", "pymeshlab")


def part_of(module: str) -> str:
    """The package or module directly under vhquad; "" for vhquad itself."""
    return module.split(".")[1] if "." in module else ""


def imports() -> Iterator[tuple[str, str]]:
    """(importing file, imported module) for every import of vhquad in vhquad, however deep."""
    for file in sorted(ROOT.rglob("*.py")):
        name = file.relative_to(ROOT.parent).as_posix()
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Import):
                yield from ((name, a.name) for a in node.names if a.name.split(".")[0] == "vhquad")
            elif isinstance(node, ast.ImportFrom):
                assert node.level == 0, f"{name} has a relative import"
                module = node.module or ""
                if module == "vhquad":  # from vhquad import api
                    yield from ((name, f"vhquad.{a.name}") for a in node.names)
                elif module.startswith("vhquad."):
                    yield name, module


def test_imports_go_downwards() -> None:
    wrong = []
    for file, module in imports():
        source = file.removeprefix("vhquad/").split("/")[0].removesuffix(".py")
        target = part_of(module)
        if source == "__init__" or source == target or target in ("", "__version__"):
            continue
        if LEVELS[target] >= LEVELS[source]:
            wrong.append(f"{file} imports {module}")
    assert not wrong, "\n".join(wrong)


def test_every_part_has_a_level() -> None:
    parts = {p.stem for p in ROOT.iterdir() if p.suffix == ".py" or (p / "__init__.py").exists()}
    assert parts - {"__init__"} == set(LEVELS)


def test_package_files_hold_a_docstring_only() -> None:
    for file in ROOT.glob("*/__init__.py"):
        body = ast.parse(file.read_text(encoding="utf-8")).body
        assert len(body) <= 1, f"{file} holds code"


@pytest.mark.parametrize("module", ["vhquad", "vhquad.cli.app"])
def test_light_modules_import_nothing_heavy(module: str) -> None:
    code = f"import sys, {module}; print([m for m in {HEAVY} if m in sys.modules])"
    run = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=60
    )
    assert run.stdout.strip() == "[]"

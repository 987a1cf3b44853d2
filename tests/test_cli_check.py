"""`vhquad check`: verdict, figures and exit code for quad meshes from anywhere."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from tests.command_line import Invoke, write_obj
from tests.meshes import icosphere, quad_cube, quad_grid


def test_valid_quads(invoke: Invoke, tmp_path: Path) -> None:
    cube = quad_cube(3)
    path = write_obj(tmp_path / "cube.obj", cube.vertices, cube.quads)
    run = invoke("check", path)
    assert (run.code, run.err) == (0, "")
    assert "valid quad mesh" in run.out
    assert "8 of valence 3" in run.out


def test_against_its_surface(invoke: Invoke, tmp_path: Path) -> None:
    """A cube against its own triangles: no distance, the same topology."""
    cube = quad_cube(3)
    path = write_obj(tmp_path / "cube.obj", cube.vertices, cube.quads)
    surface = write_obj(tmp_path / "surface.obj", cube.vertices, cube.triangles())
    run = invoke("check", path, "--against", surface, "--json", "-")
    report = json.loads(run.out)
    assert report["quality"]["distance"]["hausdorff"] < 1e-9
    assert report["quality"]["flipped_quads"] == 0
    assert report["input"]["euler_characteristic"] == 2


def test_other_topology_is_told(invoke: Invoke, tmp_path: Path) -> None:
    flat = quad_grid()
    path = write_obj(tmp_path / "flat.obj", flat.vertices, flat.quads)
    ball = icosphere(1)
    surface = write_obj(tmp_path / "ball.obj", ball.vertices, ball.faces)
    run = invoke("check", path, "--against", surface)
    assert run.code == 0
    assert "(1, 1, 1), those of the surface (1, 2, 0)" in run.err


def test_triangles_are_not_valid(invoke: Invoke, tmp_path: Path) -> None:
    """Exit code 3, and the count of what is no quad."""
    ball = icosphere(1)
    run = invoke("check", write_obj(tmp_path / "ball.obj", ball.vertices, ball.faces))
    assert run.code == 3
    assert "80 faces that are not quads" in run.err


def test_nonmanifold_quads_are_not_valid(invoke: Invoke, tmp_path: Path) -> None:
    """Three quads on one edge."""
    vertices = [[0, 0, 0], [0, 0, 1], [1, 0, 0], [1, 0, 1], [0, 1, 0], [0, 1, 1], [-1, 0, 0]]
    vertices += [[-1, 0, 1]]
    quads = [[0, 2, 3, 1], [0, 4, 5, 1], [0, 6, 7, 1]]
    path = write_obj(tmp_path / "fins.obj", np.array(vertices, dtype=float), quads)
    run = invoke("check", path)
    assert run.code == 3
    assert "1 edges with more than two quads" in run.err


def test_unreadable(invoke: Invoke, tmp_path: Path) -> None:
    assert invoke("check", tmp_path / "no.obj").refused("no.obj")

"""The judge of the benchmarks, on meshes whose faults are known; the bars on results made up."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.meshes import grid, quad_cube, quad_grid, quad_torus
from vhquad.mesh.io import write_quad_mesh
from vhquad.mesh.quad import QuadMesh
from vhquad.mesh.triangle import TriMesh

sys.path.insert(0, str(Path(__file__).parents[1] / "benchmarks"))

import bars
import exported
import judge
import remesh_folder
import summary


def judged(quads: QuadMesh, surface: TriMesh, folder: Path) -> dict[str, Any]:
    write_quad_mesh(folder / "quads.obj", quads)
    lines = ["v {} {} {}".format(*p) for p in surface.vertices.tolist()]
    lines += ["f {} {} {}".format(*f) for f in (surface.faces + 1).tolist()]
    (folder / "surface.obj").write_text("\n".join(lines) + "\n")
    return judge.judge(folder / "quads.obj", folder / "surface.obj")


def triangles(quads: QuadMesh) -> TriMesh:
    return TriMesh(quads.vertices, quads.triangles())


def test_sound_torus(tmp_path: Path) -> None:
    torus = quad_torus()
    found = judged(torus, triangles(torus), tmp_path)
    assert (found["components"], found["euler"], found["loops"]) == (1, 0, 0)
    assert found["kept"]
    assert found["folded"] == found["non_quads"] == found["nonmanifold_vertices"] == 0
    assert found["irregular"] == {}


def test_cube_has_eight_corners_on_its_creases(tmp_path: Path) -> None:
    cube = quad_cube(4)
    found = judged(cube, triangles(cube), tmp_path)
    assert found["irregular"] == {"3": 8}
    assert found["irregular_off_creases"] == {}
    assert found["crease_off"] < 1e-12  # edges lie on the creases: rounding only
    moved = QuadMesh(cube.vertices * [1.0, 1.0, 0.9], cube.quads)
    found = judged(moved, triangles(cube), tmp_path)
    # The four creases at the top and at the bottom, 8 of 12, are 0.05 sides off, the other four
    # only where nothing is left beside them.
    assert found["crease_off"] == pytest.approx(100 * 0.05 / np.sqrt(3) * 8 / 12, rel=0.06)


def test_random_parts_are_closed_and_repeat() -> None:
    """But for how the triangles of a plane lie, which is up to the booleans."""
    for seed in range(3):
        vertices, faces = exported.random_part(np.random.default_rng(seed))
        mesh = TriMesh(vertices, faces)
        assert len(mesh.boundary_loops) == 0
        assert mesh.face_areas.max() > 10 * np.median(mesh.face_areas)
        again = TriMesh(*exported.random_part(np.random.default_rng(seed)))
        assert again.area == pytest.approx(mesh.area, rel=1e-9)
        assert again.n_faces == mesh.n_faces


def test_triangles_without_area_make_no_creases() -> None:
    square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, 0.5, 0]], dtype=float)
    # The last vertex lies on the diagonal: one triangle there has no area.
    flat = np.array([[0, 1, 2], [0, 2, 4], [0, 4, 3], [4, 2, 3]])
    assert len(judge.sharp_edges(square, flat)) == 0
    square[4, 2] = 0.5
    assert len(judge.sharp_edges(square, flat)) > 0


def test_border(tmp_path: Path) -> None:
    quads = quad_grid(4, 3)
    found = judged(quads, grid(8, 6), tmp_path)
    assert (found["euler"], found["loops"], found["kept"]) == (1, 1, True)
    assert found["border_off"] < 1e-12
    found = judged(QuadMesh(quads.vertices * 0.5, quads.quads), grid(8, 6), tmp_path)
    # Half the size, about a corner at 0: the far corner is half a side off.
    assert found["border_off"] > 10


def test_a_hole_changes_topology(tmp_path: Path) -> None:
    torus = quad_torus()
    found = judged(QuadMesh(torus.vertices, torus.quads[1:]), triangles(torus), tmp_path)
    assert (found["euler"], found["loops"], found["kept"]) == (-1, 1, False)


def test_fans_that_meet_at_a_vertex(tmp_path: Path) -> None:
    p = [[x, y, 0.0] for x in range(3) for y in range(3)]
    bowtie = QuadMesh(p, [[0, 3, 4, 1], [4, 7, 8, 5]])
    used = np.unique(bowtie.quads)
    renamed = QuadMesh(bowtie.vertices[used], np.searchsorted(used, bowtie.quads))
    found = judged(renamed, triangles(quad_grid(1, 1)), tmp_path)
    assert found["nonmanifold_vertices"] == 1
    assert found["loops"] == 2


def test_folded_quad(tmp_path: Path) -> None:
    quads = quad_grid(3, 3, 1.0, 1.0)
    bent = quads.vertices.copy()
    inside = np.flatnonzero((np.abs(bent[:, :2] - 0.5) < 0.3).all(axis=1))
    bent[inside[0]] += [0.5, 0.5, 0.0]  # across its opposite corner
    found = judged(QuadMesh(bent, quads.quads), triangles(quads), tmp_path)
    assert found["folded"] > 0
    assert found["jacobian_min"] < 0


def test_irregular_vertices_inside_only(tmp_path: Path) -> None:
    square = quad_cube(2)
    top = square.quads[(square.vertices[square.quads][:, :, 2] > 0).any(axis=1)]
    used = np.unique(top)
    part = QuadMesh(square.vertices[used], np.searchsorted(used, top))
    found = judged(part, triangles(part), tmp_path)
    assert found["irregular"] == {"3": 4}


def run(**changes: Any) -> dict[str, Any]:
    figures = {
        **dict.fromkeys(bars.FAULTS, 0),
        "faces": 2000,
        "kept": True,
        "folded": 0,
        "flipped": 0,
        "irregular": {"3": 8},
        "input": {"loops": 0},
        "jacobian_mean": 0.9,
        **changes,
    }
    part = {"method": "integer-grid map", "reason": "", "singularities": {"3": 8}}
    return {
        "folder": "made",
        "mesh": "ball",
        "tool": "learned",
        "target": 2000,
        "commit": "abc",
        "exit": 0,
        "cpu": 1.0,
        "mb": 300,
        "parts": [part],
        "figures": figures,
    }


def test_irregular_vertices_must_be_those_of_the_field_each_valence_by_itself() -> None:
    sound = run(irregular={"3": 10, "5": 2}, irregular_off_creases={"3": 8})
    sound["parts"][0]["crease_corners"] = {"3": 2, "5": 2}
    assert bars.extra_irregular(sound) == 0
    for corners, extra in (({"3": 2}, 2), ({"3": 3, "5": 2}, 1), ({"3": 2, "5": 1, "6": 1}, 2)):
        sound["parts"][0]["crease_corners"] = corners
        assert bars.extra_irregular(sound) == extra
    # A report that does not name corners is held to what is off sharp edges.
    del sound["parts"][0]["crease_corners"]
    assert bars.extra_irregular(sound) == 0
    sound["figures"]["irregular_off_creases"] = {"3": 9, "5": 1}
    assert bars.extra_irregular(sound) == 2


def test_bars_hold_for_a_sound_run() -> None:
    assert all(bar.held(run()) for bar in bars.BARS if bar.applies(run()))
    assert not remesh_folder.missed(run())


@pytest.mark.parametrize(
    "change",
    [
        {"non_quads": 1},
        {"kept": False},
        {"folded": 3},
        {"flipped": 1},
        {"faces": 1700},
        {"irregular": {"3": 9, "5": 1}},
        {"input": {"loops": 1}, "border_off": 0.01},
        {"faces": 0},
    ],
)
def test_bars_notice(change: dict[str, Any]) -> None:
    bad = run(**change)
    assert not all(bar.held(bad) for bar in bars.BARS if bar.applies(bad))


def test_results_are_found_again_and_the_last_counts(tmp_path: Path) -> None:
    first, last = run(folded=1), run()
    path = tmp_path / "results.jsonl"
    path.write_text("\n".join(json.dumps(r) for r in (first, last)) + '\n{"cut sho')
    assert list(remesh_folder.load(path).values()) == [last]


def test_tables(tmp_path: Path) -> None:
    lines = summary.bars([run(), run(folded=3) | {"mesh": "bad"}])
    assert any("1 of 2" in line and "bad 2000" in line for line in lines)
    other = run() | {"tool": "quadriflow", "parts": []}
    assert any("1 meshes" in line for line in summary.peers([run(), other]))

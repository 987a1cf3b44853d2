"""Creatures by box modelling: quads only, closed manifolds of the genus built, mirrored."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from tests.command_line import load_script
from vhquad.learn.subdivide import catmull_clark
from vhquad.mesh.intersections import self_intersections
from vhquad.mesh.io import read_polygons
from vhquad.mesh.quad import QuadMesh

KINDS = (
    "quadruped", "upright", "bird", "fish", "many_legged", "plant", "hand", "pot", "swim_ring",
    "furniture", "anything",
)  # fmt: skip
UP = np.array([0.0, 1.0, 0.0])


@pytest.fixture(scope="module")
def tool() -> Iterator[ModuleType]:
    yield load_script("examples/box_model.py")
    del sys.modules["box_model"]


@pytest.fixture(scope="module")
def maker(tool: ModuleType) -> Iterator[ModuleType]:
    beside = ("quad_sets", "creature_parts", "creature_kinds")
    for name in beside:
        load_script(f"examples/{name}.py")
    yield load_script("examples/make_creatures.py")
    for name in (*beside, "make_creatures"):
        del sys.modules[name]


def checked(model) -> QuadMesh:  # type: ignore[no-untyped-def]
    """The mesh, if it is closed, in one piece, its outside outside, and of the genus built."""
    mesh = QuadMesh(model.vertices, model.quads)
    assert mesh.is_manifold
    assert mesh.n_boundary_loops == 0
    assert mesh.n_components == 1
    assert (mesh.valence > 0).all()
    assert mesh.euler_characteristic == 2 - 2 * model.genus
    a, b, c, d = (model.vertices[model.quads[:, k]] for k in range(4))
    volume = np.einsum("ij,ij->i", np.cross(c - a, d - b), a + b + c + d).sum() / 24.0
    assert volume > 0
    return mesh


def columns(tool: ModuleType, half: bool):  # type: ignore[no-untyped-def]
    """A box of 4 x 4 x 4 cells, or half of it; and the face or two in the middle of its top."""
    cage = tool.box((2 if half else 4, 4, 4), half)
    return cage, cage.pick("vertex", UP, UP)


@pytest.mark.parametrize("half", [False, True])
def test_an_extrusion_has_poles_at_its_root_and_tip(tool: ModuleType, half: bool) -> None:
    """1. Valence 5 where the limb begins, 3 at its end as at the corners of the box, else 4."""
    cage, region = columns(tool, half)
    assert len(region) == (2 if half else 4)
    before = len(cage.faces)
    spine = np.linspace([0.0, 1.4, 0.0], [0.0, 2.2, 0.0], 3)
    limb = cage.sweep(region, spine, np.array([0.9, 0.8, 0.7]))
    around = len(cage.rim(region))
    assert around == (4 if half else 8)
    assert [len(ring) for ring in limb.rings] == [around] * 3
    assert len(cage.faces) == before + 3 * around
    tips = np.array([cage.vertices[v] for v in cage.corners(limb.cap)])
    np.testing.assert_allclose(tips[:, 1], 2.2, atol=1e-12)
    model = cage.finished(2)
    mesh = checked(model)
    assert mesh.irregular_interior == {3: 8 + 4, 5: 4}
    assert mesh.n_quads == 16 * (6 * 16 + 3 * 8)


@pytest.mark.parametrize("half", [False, True])
def test_what_the_tools_do_to_the_topology(tool: ModuleType, half: bool) -> None:
    """2. Tips, sockets, cuts change nothing, handles count: two where a half gets one aside."""
    cage, region = columns(tool, half)
    limb = cage.sweep(region, np.array([[0.0, 1.5, 0.0], [0.0, 2.0, 0.0]]), np.array([0.9, 0.5]))
    cage.close_to_point(limb)
    fan = checked(cage.finished(1))
    assert fan.irregular_interior[8] == 1  # the tip
    front = np.array([0.0, 0.0, 1.0])
    cage.sink(cage.pick("vertex", front, front), [0.0, 0.2], [0.7, 0.5])
    quads = len(checked(cage.finished(1)).quads)
    # 1. A cut adds one quad for each that it runs through.
    edge = next(
        (a, b)
        for a, b in cage.edges()
        if np.ptp([cage.vertices[v][2] for v in (a, b)]) == 0.5
        and cage.vertices[a][1] == -1.0
        and cage.vertices[a][0] > 0
    )
    assert cage.cut(edge, 0.3)
    assert len(checked(cage.finished(1)).quads) > quads
    # 2. Handles.
    out = np.array([1.0, 0.0, 0.0])
    ends = [cage.pick("face", np.array([1.0, y, -0.4]), out) for y in (0.8, -0.8)]
    a, b = (cage.centre(end) for end in ends)
    spine = np.stack([a + 0.6 * out, 0.5 * (a + b) + 0.9 * out, b + 0.6 * out])
    cage.bridge(*ends, spine, np.full(3, 0.7))
    model = cage.finished(2)
    assert model.genus == (2 if half else 1)
    checked(model)


def test_a_handle_on_the_mirror_plane_is_one(tool: ModuleType) -> None:
    """3. Its halves make one tube."""
    cage = tool.box((2, 4, 4), True)
    ends = [cage.pick("vertex", np.array([0, 1, z]), UP) for z in (0.5, -0.5)]
    a, b = (cage.centre(end) for end in ends)
    spine = np.stack([a + 0.6 * UP, 0.5 * (a + b) + UP, b + 0.6 * UP])
    with pytest.raises(tool.Unfit):  # they have an edge in common
        cage.copy().bridge(*ends, spine, np.full(3, 0.5))
    cage = tool.box((2, 4, 6), True)
    ends = [cage.pick("vertex", np.array([0, 1, z]), UP) for z in (2 / 3, -2 / 3)]
    cage.bridge(*ends, spine, np.full(3, 0.5))
    model = cage.finished(2)
    assert model.genus == 1
    checked(model)


@pytest.mark.parametrize("half", [False, True])
def test_a_ring_is_a_torus(tool: ModuleType, half: bool) -> None:
    """4. Genus 1, every vertex regular."""
    mesh = checked(tool.ring(6 if half else 12, 5, half, 2.0).finished(2))
    assert mesh.genus == 1
    assert mesh.irregular_interior == {}


def test_what_would_not_be_a_manifold_is_refused(tool: ModuleType) -> None:
    """5. Regions with two rims or none, a limb of a face that touches the plane in a corner."""
    cage = tool.box((2, 3, 3), True)
    side = [f for f in range(len(cage.faces)) if abs(cage.normal([f])[1]) < 0.5]
    with pytest.raises(tool.Unfit):
        cage.extrude(side)  # a belt: a rim above and one below
    with pytest.raises(tool.Unfit):
        cage.extrude(range(len(cage.faces)))
    cage.sweep(cage.pick("edge", UP, UP), np.array([[0, 2.0, 0]]), np.array([1.0]))
    corner = [
        [f] for f, face in enumerate(cage.faces) if sum(v in cage.plane for v in face) == 1 and face
    ]
    for region in corner:
        with pytest.raises(tool.Unfit):
            cage.extrude(region)


def test_strips_that_are_too_wide_are_cut(tool: ModuleType) -> None:
    """6. A long box of few cells becomes one near square."""
    cage = tool.box((1, 2, 2), False)
    for v in cage.vertices:
        v[:] *= [1.0, 1.0, 8.0]
    cage.even_out(8, 1.5)
    mesh = checked(cage.finished(1))
    assert mesh.n_quads == 4 * 2 * (2 + 2 * 8 + 8)  # 1, 2 and 8 cells, of 2, 1 and 2
    deep = np.sort([v[2] for v in cage.vertices])
    np.testing.assert_allclose(np.unique(deep), np.arange(-8.0, 9.0, 2.0))


def test_the_step_for_polygons_is_that_for_quads(tool: ModuleType) -> None:
    """7. On quads it agrees with ``vhquad.learn.subdivide``; a pentagon becomes five quads."""
    cage, region = columns(tool, False)
    cage.sweep(region, np.array([[0.2, 1.7, 0.1]]), np.array([0.6]))
    vertices, quads = np.array(cage.vertices), np.array(cage.faces)
    fine = catmull_clark(vertices, quads)
    again, same = tool.polygon_step(vertices, cage.faces)
    np.testing.assert_allclose(again, fine.vertices, atol=1e-12)
    np.testing.assert_array_equal(same, fine.quads)
    ngon = np.exp(2j * np.pi * np.arange(5) / 5)
    flat = np.stack([ngon.real, ngon.imag, np.zeros(5)], axis=1)
    prism = np.concatenate([flat, flat + UP[[0, 2, 1]]])
    faces = [(4, 3, 2, 1, 0), (5, 6, 7, 8, 9)]
    faces += [(i, (i + 1) % 5, 5 + (i + 1) % 5, 5 + i) for i in range(5)]
    points, made = tool.polygon_step(prism, faces)
    mesh = QuadMesh(points, made)
    assert mesh.n_quads == 5 + 5 + 20
    assert mesh.is_manifold
    assert mesh.irregular_interior == {3: 10, 5: 2}


@pytest.mark.parametrize("kind", KINDS)
def test_every_kind_is_a_closed_mesh_of_quads(maker: ModuleType, kind: str) -> None:
    """8. Topology as built; mirrored ones are their own mirror image, vertex for vertex."""
    rng = np.random.default_rng([7, KINDS.index(kind)])
    chosen = list(maker.KINDS)[KINDS.index(kind)]
    done = 0
    while done < 2:
        try:
            model = maker.draw_kind(rng, chosen)
        except maker.Unfit:
            continue
        done += 1
        mesh = checked(model)
        assert 300 < mesh.n_quads < 12_000
        assert np.ptp(model.vertices, axis=0).max() == pytest.approx(2.0)
        if (model.mate != np.arange(mesh.n_vertices)).any():
            mirrored = model.vertices[model.mate] * [-1.0, 1.0, 1.0]
            np.testing.assert_array_equal(mirrored, model.vertices)
            other = np.sort(model.mate[model.quads], axis=1)
            own = np.sort(model.quads, axis=1)
            np.testing.assert_array_equal(np.unique(other, axis=0), np.unique(own, axis=0))


def test_kinds_are_those_tested(maker: ModuleType) -> None:
    """9. Their chances sum to one."""
    assert tuple(kind.__name__ for kind in maker.KINDS) == KINDS
    assert sum(maker.KINDS.values()) == pytest.approx(1.0)


def test_an_identity_is_always_the_same(maker: ModuleType) -> None:
    """10. Other identities and seeds give others; none cuts through itself much."""
    model, kind = maker.draw(4)
    again, named = maker.draw(4)
    assert named == kind
    np.testing.assert_array_equal(again.vertices, model.vertices)
    np.testing.assert_array_equal(again.quads, model.quads)
    for other, _ in (maker.draw(5), maker.draw(4, seed=1)):
        assert other.vertices.shape != model.vertices.shape
        mesh = QuadMesh(other.vertices, other.quads)
        assert len(self_intersections(mesh)) <= maker.MOST_SELF_INTERSECTIONS * mesh.n_quads


def test_a_set_has_files_and_a_split(
    maker: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """11. Files hold quads only and say what they are; what is there stays."""
    folder = tmp_path / "creatures"
    folder.mkdir()
    (folder / "split.json").write_text('{"other": "val"}')
    (folder / "creature_0001.obj").write_text("kept")
    monkeypatch.setattr(sys, "argv", ["make_creatures.py", str(folder), "--count", "4"])
    maker.main()
    split = json.loads((folder / "split.json").read_text())
    assert split.pop("other") == "val"
    assert list(split.values()) == ["train", "train", "train", "val"]
    assert (folder / "creature_0001.obj").read_text() == "kept"
    for identity in (0, 2, 3):
        path = folder / f"creature_{identity:04d}.obj"
        model, kind = maker.draw(identity)
        assert path.read_text().startswith(f"# random {kind}, box modelled, CC0 1.0\n")
        soup = read_polygons(path)
        assert (soup.sizes == 4).all()
        np.testing.assert_array_equal(soup.of_size(4)[0], model.quads)
        np.testing.assert_allclose(soup.vertices, model.vertices, atol=1e-7)

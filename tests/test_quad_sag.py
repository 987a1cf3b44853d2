"""Sizes and pulls for curved creases: edges become short enough for their sag, elsewhere none."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.map_stages import made
from tests.meshes import cone, cube, open_cylinder
from vhquad.field.cross import CrossField
from vhquad.mesh.triangle import TriMesh
from vhquad.quad.pipeline import RemeshResult, RemeshSettings, remesh_mesh
from vhquad.quad.sag import FINEST, SAG, UNSEEN, chord_sags, sizes_for_creases
from vhquad.quad.seamless_map import solve_seamless_map


def capped(side: TriMesh) -> TriMesh:
    """A surface of revolution with a flat cap on each of its rims."""
    vertices, faces = [side.vertices], [side.faces]
    for i, loop in enumerate(side.boundary_loops):
        middle = np.full(len(loop), side.n_vertices + i)
        faces.append(np.stack([side.head[loop], side.tail[loop], middle], axis=1))
        vertices.append(side.vertices[side.tail[loop]].mean(axis=0)[None])
    return TriMesh(np.vstack(vertices), np.vstack(faces))


def closed_cone() -> TriMesh:
    """A cone of radius 1 with a base: its one crease is the rim, a 48-gon."""
    return capped(cone(nu=48, nv=12))


def closed_cylinder() -> TriMesh:
    """Radius 1, height 2; its creases are two rims, 48-gons."""
    return capped(open_cylinder(nu=48, nv=16))


def test_the_sag_of_a_circle_is_known() -> None:
    turn = np.linspace(0.0, 2 * np.pi, 721)
    circle = 3.0 * np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1)
    circle[-1] = circle[0]
    # 1. all round: s^2 / 8R; the next term is smaller by (s / R)^2 / 50
    sag = chord_sags(circle, np.full(721, 0.5))
    np.testing.assert_allclose(sag, 0.25 / 24, rtol=0.02)
    # 2. on an arc, up to its ends
    np.testing.assert_allclose(chord_sags(circle[:200], np.full(200, 0.5)), 0.25 / 24, rtol=0.02)
    # 3. on an arc shorter than the chord, what a longer one would have
    np.testing.assert_allclose(chord_sags(circle[:20], np.full(20, 0.5)), 0.25 / 24, rtol=0.02)


def test_a_zigzag_is_hardly_curved() -> None:
    x = np.linspace(0.0, 1.0, 101)
    zigzag = np.stack([x, 0.002 * (-1.0) ** np.arange(101), 0 * x], axis=1)
    straight = np.stack([x, x, 0 * x], axis=1)
    assert chord_sags(straight, np.full(101, 0.2)).max() < 1e-12
    assert chord_sags(zigzag, np.full(101, 0.21)).max() < 0.0005  # a quarter of its height


def test_sizes_are_bounded_by_the_sag_at_the_same_count() -> None:
    s = made(closed_cone(), quads=200)
    bent = sizes_for_creases(s.aligned)
    area = s.aligned.mesh.face_areas
    assert bent.aligned.size is not None
    # 1. the count stays
    assert (area / bent.aligned.size**2).sum() == pytest.approx(200, rel=1e-9)
    # 2. densities are on the rim alone, those of edges whose sag is the share allowed
    rim = bent.density > 0
    np.testing.assert_array_equal(rim.nonzero()[0] // 3, np.unique(rim.nonzero()[0] // 3))
    assert rim.sum() == 48  # one halfedge of each edge
    scale = bent.aligned.size.max() / s.edge
    allowed = np.sqrt(8 * SAG * s.edge)
    np.testing.assert_allclose(1 / bent.density[rim], allowed, rtol=0.05)
    # 3. the smallest size is at the rim, above the least
    smallest = int(bent.aligned.size.argmin())
    on_rim = np.hypot(*s.aligned.mesh.vertices[s.aligned.mesh.faces[smallest], :2].T) > 0.99
    assert on_rim.sum() >= 1
    assert scale * s.edge / FINEST < bent.aligned.size[smallest] < 0.7 * scale * s.edge


def test_no_edge_need_be_nearer_than_anyone_sees() -> None:
    """Of quads of a twenty-fifth of the radius a hundredth is less than that."""
    s = made(capped(cone(nu=384, nv=12)), quads=200)
    assert s.aligned.size is not None
    fine = replace(s.aligned, size=s.aligned.size * (0.04 / s.edge))
    density = sizes_for_creases(fine).density
    allowed = np.sqrt(8 * UNSEEN * s.aligned.mesh.diagonal)
    assert allowed > np.sqrt(8 * SAG * 0.04)
    np.testing.assert_allclose(1 / density[density > 0], allowed, rtol=0.05)


def test_straight_creases_change_nothing() -> None:
    s = made(cube(4))
    bent = sizes_for_creases(s.aligned)
    np.testing.assert_allclose(bent.aligned.size, s.aligned.size, rtol=1e-12)
    calm, pulled = (
        solve_seamless_map(s.aligned, least_density=density) for density in (None, bent.density)
    )
    np.testing.assert_allclose(calm.uv, pulled.uv, atol=4)  # rounding, of 2^20 a mean edge


def test_the_map_has_the_quads_that_the_rim_needs() -> None:
    s = made(closed_cone(), quads=200)
    bent = sizes_for_creases(s.aligned)
    rim = np.flatnonzero(bent.density > 0)

    def around(density: np.ndarray | None) -> float:
        """Quad edges around the rim."""
        m = solve_seamless_map(bent.aligned, least_density=density)
        assert m.is_valid
        p = m.uv.reshape(-1, 2) * m.unit
        following = rim - rim % 3 + (rim + 1) % 3
        return float(np.abs(p[following] - p[rim]).sum())

    wanted = (bent.density * s.aligned.mesh.edge_lengths.reshape(-1)).sum()
    assert around(None) < 0.5 * wanted
    assert around(bent.density) > 1.5 * around(None)


def test_adaptivity_decides() -> None:
    mesh = closed_cylinder()

    def run(adaptivity: float) -> RemeshResult:
        field = CrossField("faces", np.zeros(mesh.n_faces))
        return remesh_mesh(mesh, field, RemeshSettings(target_quads=400, adaptivity=adaptivity))

    def around(result: RemeshResult) -> int:
        """Vertices on the rims."""
        p = result.quads.vertices
        middle = 0.5 * (p[:, 2].min() + p[:, 2].max())
        rim = (np.hypot(p[:, 0], p[:, 1]) > 0.99) & (np.abs(p[:, 2] - middle) > 0.99)
        return int(rim.sum())

    even, bent = run(0.0), run(1.0)
    assert around(bent) > 1.2 * around(even)
    assert abs(bent.report.made - 400) <= 40
    assert bent.report.quality.folded_quads == 0

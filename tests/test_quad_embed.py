"""Positions of layouts: regular lattices on flat shapes, special vertices kept, on the surface."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from tests.map_stages import NAMES, made, noisy, stages
from tests.meshes import torus
from vhquad.mesh.closest import ClosestPoints
from vhquad.mesh.quad import QuadMesh
from vhquad.mesh.quality import scaled_jacobians
from vhquad.quad.embed import embed_layout


@cache
def embedded(name: str, target: int) -> QuadMesh:
    s = stages(name)
    layout = s.quantise(target).layout
    return QuadMesh(embed_layout(layout, s.aligned, s.seamless), layout.quads)


@pytest.mark.parametrize("target", [20, 300])
@pytest.mark.parametrize("name", NAMES)
def test_special_vertices_and_features_stay(name: str, target: int) -> None:
    s = stages(name)
    layout, quads = s.quantise(target).layout, embedded(name, target)
    tmesh, mesh = layout.tmesh, s.aligned.mesh
    assert np.isfinite(quads.vertices).all()
    # 1. irregular vertices are where the field has them
    nodes = np.flatnonzero(tmesh.node_vertex >= 0)
    plain = nodes[(tmesh.node_feature[nodes] < 0) | tmesh.node_fixed[nodes]]
    np.testing.assert_allclose(
        quads.vertices[layout.vertex_of[plain]],
        mesh.vertices[tmesh.node_vertex[plain]],
        atol=1e-12 * mesh.diagonal,
    )
    # 2. the rim of the quads lies on the rim of the mesh
    rim = quads.vertices[quads.is_boundary_vertex]
    if len(rim):
        border = np.flatnonzero(mesh.twin < 0)
        a, d = mesh.vertices[mesh.tail[border]], mesh.vertices[mesh.head[border]]
        d = d - a
        t = np.einsum("pei,ei->pe", rim[:, None] - a[None], d) / (d * d).sum(axis=1)
        foot = a[None] + np.clip(t, 0, 1)[..., None] * d[None]
        off = np.linalg.norm(rim[:, None] - foot, axis=2).min(axis=1)
        assert off.max() < 1e-9 * mesh.diagonal
    # 3. the rest on the surface, or near it where points fell together
    off = ClosestPoints(mesh).query(quads.vertices).distance
    assert np.median(off) < 1e-9 * mesh.diagonal
    assert off.max() < (0.15 if target == 20 else 0.05) * mesh.diagonal


@pytest.mark.parametrize(("name", "target"), [("grid", 48), ("grid", 300), ("hole", 200)])
def test_flat_shapes_get_square_lattices(name: str, target: int) -> None:
    quads = embedded(name, target)
    assert np.abs(quads.vertices[:, 2]).max() == 0
    # 1 x 0.75 in 8 x 6 or 20 x 15, a square with a hole in 225 less 25: all quads squares
    assert quads.n_quads == target
    lengths = quads.edge_lengths
    np.testing.assert_allclose(lengths, lengths.mean(), rtol=1e-4)
    np.testing.assert_allclose(scaled_jacobians(quads), 1.0, atol=1e-6)


def test_a_cube_gets_square_lattices() -> None:
    quads = embedded("cube", 300)  # 6 times 7 x 7
    assert quads.n_quads == 294
    np.testing.assert_allclose(quads.edge_lengths, 1 / 7, rtol=1e-4)
    assert np.abs(np.abs(quads.vertices).max(axis=1) - 0.5).max() < 1e-12


def test_a_cylinder_gets_rings() -> None:
    quads = embedded("cylinder", 300)
    z = quads.vertices[:, 2]
    levels = np.unique(np.round(z, 6))
    np.testing.assert_allclose(np.diff(levels), np.diff(levels).mean(), rtol=1e-3)
    assert len(quads.vertices) % len(levels) == 0


@pytest.mark.parametrize("name", ["sphere", "torus", "blob", "cylinder", "half_sphere", "plate"])
def test_quads_are_well_shaped_before_any_polish(name: str) -> None:
    jacobians = scaled_jacobians(embedded(name, 300))
    # Folds at the crowded ends of T-mesh arcs are few, and the bulk is near square.
    assert (jacobians.min(axis=1) <= 0).mean() < 0.02
    assert np.median(jacobians) > 0.9


def test_sizes_are_even() -> None:
    # Uniform sizes were asked for: the middle half of the edges is within 40 % of the mean.
    s = stages("bad_torus")
    quads = embedded("bad_torus", 1000)
    low, high = np.quantile(quads.edge_lengths, [0.25, 0.75])
    wanted = np.sqrt(s.mesh.area / quads.n_quads)
    assert 0.6 * wanted < low < high < 1.4 * wanted


def test_noisy_fields(rng: np.random.Generator) -> None:
    mesh = torus(32, 16)
    s = made(mesh, quads=600, z=noisy(mesh, 0.8, rng))
    layout = s.quantise(600).layout
    quads = QuadMesh(embed_layout(layout, s.aligned, s.seamless), layout.quads)
    off = ClosestPoints(mesh).query(quads.vertices).distance
    assert np.quantile(off, 0.95) < 1e-3 * mesh.diagonal
    assert (scaled_jacobians(quads).min(axis=1) <= 0).mean() < 0.1

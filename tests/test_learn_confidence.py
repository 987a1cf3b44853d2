"""Confidence of predictions, and the blend with the curvature-aligned field."""

from __future__ import annotations

import numpy as np
import pytest

from tests.data_paths import ROOT
from tests.meshes import blob, cube, icosphere, merge, moved, random_rigid, relabel, torus
from vhquad import api
from vhquad.errors import ModelError
from vhquad.field.baseline import curvature_field
from vhquad.field.cross import SURE, CrossField
from vhquad.field.transport import to_vertices
from vhquad.geometry.frames import to_3d, vertex_axes
from vhquad.learn.baselines import curvature
from vhquad.learn.blend import blend, lean_on_curvature
from vhquad.learn.confidence import FULL, NONE, agreement, confidence
from vhquad.learn.predict import predict_field
from vhquad.learn.proxy import carry_back, make_proxy
from vhquad.mesh.triangle import TriMesh
from vhquad.nn.checkpoint import Model, load_model


@pytest.fixture(scope="module")
def shipped() -> Model:
    """The shipped model."""
    try:
        return load_model()
    except ModelError:
        pytest.skip("no model is shipped")


def mean(mesh: TriMesh, field: CrossField) -> float:
    assert field.confidence is not None
    return float(mesh.vertex_areas @ field.confidence / mesh.area)


def test_agreement_by_hand() -> None:
    """1. The cosine whatever the moduli; nothing agrees with nothing."""
    own = np.array([2.0, 1j, -1.0, 0.0])
    np.testing.assert_allclose(agreement(own, np.array([3.0, 1.0, 1.0, 1.0])), [1.0, 0.0, -1.0, 0])


@pytest.mark.parametrize("level", [-1.0, 0.0, NONE - 0.05, FULL + 0.01, 1.0])
def test_even_agreement(level: float) -> None:
    """2. In [0, 1], nothing up to the lower bound, all of it from the upper one."""
    mesh = blob(2)
    c = confidence(mesh, np.full(mesh.n_vertices, level))
    np.testing.assert_allclose(c, float(level > FULL), atol=1e-9)


def test_more_agreement_is_more_confidence() -> None:
    """3. Monotone, and doubt stays near where it arises."""
    mesh = icosphere(3)
    agreed = np.full(mesh.n_vertices, FULL)
    agreed[mesh.vertices[:, 2] > 0.8] = 0.0
    c = confidence(mesh, agreed)
    assert (c >= 0).all()
    assert (c <= 1).all()
    assert c[mesh.vertices[:, 2] > 0.95].mean() < 0.3 * c[mesh.vertices[:, 2] < 0].mean()
    assert (confidence(mesh, agreed + 0.02) >= c - 1e-12).all()


def test_heads_are_known_balls_are_not(shipped: Model) -> None:
    """4. The head in examples/ against a ball, on which nothing tells; of a cube its edges tell."""
    head = api.load(ROOT / "examples" / "head.obj").mesh
    assert mean(head, predict_field(head, shipped)) > 0.95
    ball, block = icosphere(3), cube(12)
    assert mean(ball, predict_field(ball, shipped, cache=False)) < 0.05
    field = predict_field(block, shipped, cache=False)
    assert 0.1 < mean(block, field) < 0.5
    on_faces = (np.abs(np.abs(block.vertices) - 0.5) < 1e-9).sum(axis=1) == 1
    arm = to_3d(np.exp(0.25j * np.angle(field.z)), vertex_axes(block))[on_faces]
    assert np.degrees(np.arccos(np.abs(arm).max(axis=1))).mean() < 8.0  # 22.5 by chance


def test_a_torus_is_as_its_curvature_says(shipped: Model) -> None:
    """5. Every direction is known there."""
    ring = torus(48, 24)
    field, other = (
        predict_field(ring, shipped, cache=False),
        to_vertices(ring, curvature_field(ring)),
    )
    cosine = (field.z * other.z.conj()).real / np.abs(field.z * other.z)
    assert ring.vertex_areas @ (1.0 - cosine) / ring.area < 0.05


def test_on_blobs_it_is_sure_where_it_is_right(shipped: Model) -> None:
    """6. No artist ever made these: the truth is their curvature, where that is sure of itself."""
    weights, losses, trust = [], [], []
    for seed in range(8):
        mesh = blob(3, seed)
        field, truth = predict_field(mesh, shipped, cache=False), curvature(mesh)
        assert field.confidence is not None
        assert truth.confidence is not None
        told = truth.confidence > 0.5
        turn = np.angle(field.z[told] * truth.z[told].conj())
        weights.append(mesh.vertex_areas[told] / mesh.area)
        losses.append(1.0 - np.cos(turn))
        trust.append(field.confidence[told])
    weight, loss, sure = (np.concatenate(parts) for parts in (weights, losses, trust))
    level = np.digitize(sure, [0.5, 0.8])
    of = [np.average(loss[level == i], weights=weight[level == i]) for i in range(3)]
    assert of[0] > 2.0 * of[2]
    assert of[0] > of[1] > of[2]
    assert of[2] < 0.05


def test_invariance(shipped: Model) -> None:
    """7. Neither motion, scale nor labels matter."""
    rng = np.random.default_rng(3)
    head = api.load(ROOT / "examples" / "head.obj").mesh
    mesh = make_proxy(head, 1500) or head
    first = predict_field(mesh, shipped, cache=False).confidence
    assert first is not None
    assert first.max() > 0.05  # not all clipped away
    rigid = random_rigid(rng)
    away = TriMesh(3.0 * rigid.points(mesh.vertices), mesh.faces)
    second = predict_field(away, shipped, cache=False).confidence
    np.testing.assert_allclose(second, first, atol=1e-3)
    other = relabel(mesh, rng)
    third = predict_field(other.mesh, shipped, cache=False).confidence
    assert third is not None
    np.testing.assert_allclose(third[other.vertex], first, atol=1e-3)


def test_limits_of_the_blend() -> None:
    """8. Certain: the prediction, untouched. In doubt: the curvature's field, sizes evened."""
    mesh = blob(3)
    n = mesh.n_vertices
    rng = np.random.default_rng(0)
    z, size = np.exp(2j * np.pi * rng.random(n)), np.exp(rng.normal(size=n))
    sure = CrossField("vertices", z, size, np.ones(n))
    assert lean_on_curvature(mesh, sure) is sure
    unsure = CrossField("vertices", z, size, np.zeros(n))
    found = lean_on_curvature(mesh, unsure)
    other = to_vertices(mesh, curvature_field(mesh))
    np.testing.assert_allclose(found.z, other.z, atol=1e-9)
    assert found.confidence is not None
    assert found.size is not None
    assert other.confidence is not None
    assert other.confidence.max() <= SURE
    np.testing.assert_allclose(
        found.confidence, np.minimum(other.confidence / SURE, SURE), atol=1e-9
    )
    area = mesh.vertex_areas
    middle = area @ np.log(size) / area.sum()
    np.testing.assert_allclose(np.log(found.size) - middle, 0.5 * (np.log(size) - middle))


def test_blend_between() -> None:
    """9. By hand; what was not predicted stays unknown; components have their own mean size."""
    mesh = merge(icosphere(0), moved(icosphere(0), (5.0, 0.0, 0.0)))
    n = mesh.n_vertices
    z = np.ones(n, dtype=complex)
    z[0] = 0.0
    size = np.where(np.arange(n) < 12, 1.0, 3.0)
    half = np.full(n, 0.5)
    found = blend(
        mesh,
        CrossField("vertices", z, size, half),
        CrossField("vertices", np.full(n, 1j), None, SURE * half),
    )
    assert found.z[0] == 0
    np.testing.assert_allclose(found.z[1:], (0.5 + 0.25j) / abs(0.5 + 0.25j))
    assert found.confidence is not None
    np.testing.assert_allclose(found.confidence[1:], abs(0.5 + 0.25j))
    assert found.size is not None
    np.testing.assert_allclose(found.size, size)


def test_proxies_carry_confidence() -> None:
    """10. Back from the proxy, still in [0, 1]."""
    mesh = icosphere(3)
    proxy = make_proxy(mesh, 300)
    assert proxy is not None
    c = (1.0 + proxy.vertices[:, 2] / np.abs(proxy.vertices[:, 2]).max()) / 2.0
    back = carry_back(proxy, CrossField("vertices", np.ones(len(c)), None, c), mesh).confidence
    assert back is not None
    assert back.min() >= 0
    assert back.max() <= 1
    np.testing.assert_allclose(back, (1.0 + mesh.vertices[:, 2]) / 2.0, atol=0.08)

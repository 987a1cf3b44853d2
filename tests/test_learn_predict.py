"""Prediction: components, proxies, symmetry, meshes of any size."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import torch

from tests.meshes import blob, disk, icosphere, merge, moved, one_triangle
from tests.nn_inputs import LOCAL, random_network, small_settings
from vhquad.errors import ConfigError, ModelError
from vhquad.field.cross import CrossField
from vhquad.geometry.frames import build_frames, from_3d, vertex_axes
from vhquad.learn import predict as predict_module
from vhquad.learn import proxy as proxy_module
from vhquad.learn.predict import predict_field
from vhquad.learn.proxy import by_components, carry_back, make_proxy
from vhquad.mesh.triangle import TriMesh
from vhquad.nn.checkpoint import Model
from vhquad.nn.network import FieldOutput


@pytest.fixture(scope="module")
def model() -> Model:
    """Random weights."""
    return Model(random_network(small_settings(), torch.float32))


def test_components_are_predicted_one_by_one(model: Model) -> None:
    """1. A part's field does not depend on what stands beside it; progress is told."""
    a, b = blob(3), moved(blob(2, seed=1), (5.0, 0.0, 0.0), 0.4)
    seen: list[tuple[int, int]] = []
    both = predict_field(
        merge(a, b), model, cache=False, on_component=lambda *args: seen.append(args)
    )
    assert seen == [(1, 2), (2, 2)]
    alone = [predict_field(part, model, cache=False) for part in (a, b)]
    z = np.concatenate([field.z for field in alone])
    assert np.abs(both.z - z).max() < 1e-3  # float32
    assert both.size is not None
    assert all(field.size is not None for field in alone)
    size = np.concatenate([field.size for field in alone if field.size is not None])
    np.testing.assert_allclose(both.size, size, rtol=1e-3)


def test_symmetric_shapes_get_symmetric_fields(model: Model) -> None:
    """2. The mirror image of a mesh gets the mirrored field: averaging makes it exact."""
    mesh = blob(3)
    flipped = TriMesh(mesh.vertices * [-1.0, 1.0, 1.0], mesh.faces[:, ::-1])
    z = predict_field(mesh, model, cache=False).z
    z2 = predict_field(flipped, model, cache=False).z
    angle, angle2 = build_frames(mesh).halfedge_angle, build_frames(flipped).halfedge_angle
    seen = z[mesh.tail] * np.exp(-4j * angle)
    seen2 = z2[flipped.tail] * np.exp(-4j * angle2)
    first = dict(zip(zip(mesh.tail, mesh.head, strict=True), seen, strict=True))
    second = dict(zip(zip(flipped.tail, flipped.head, strict=True), seen2, strict=True))
    error = [abs(first[e].conjugate() - second[e]) for e in first]
    assert np.median(error) < 1e-3  # float32; vertices where z nearly vanishes amplify rounding


def test_the_cache_changes_nothing(model: Model, tmp_path: Path) -> None:
    """3. First built, then read: the same answer."""
    mesh = blob(2)
    first = predict_field(mesh, model, cache_dir=tmp_path)
    assert list(tmp_path.glob("*.npz"))
    second = predict_field(mesh, model, cache_dir=tmp_path)
    np.testing.assert_array_equal(first.z, second.z)


def test_tiny_and_flat_parts_do_not_break_it(model: Model) -> None:
    """4. One triangle, and a component without area: finite, zero where nothing is known."""
    flat = TriMesh(np.zeros((3, 3)), [[0, 1, 2]])
    mesh = merge(one_triangle(), flat, moved(icosphere(1), (4.0, 0.0, 0.0)))
    field = predict_field(mesh, model, cache=False)
    assert field.size is not None
    assert np.isfinite(field.z).all()
    assert (field.z[3:6] == 0).all()
    assert (field.size[3:6] == 0).all()
    assert (field.size[6:] > 0).all()


def test_large_meshes_by_proxy(model: Model, monkeypatch: pytest.MonkeyPatch) -> None:
    """5. Above the limit a proxy is used; full resolution can be asked for."""
    mesh = blob(4)
    monkeypatch.setattr(proxy_module, "PROXY_ABOVE", 2000)
    monkeypatch.setattr(proxy_module, "PROXY_VERTICES", 1300)
    asked: list[int] = []
    build = predict_module.load_or_build

    def spy(surface: TriMesh, *rest: object) -> object:
        asked.append(surface.n_vertices)
        return build(surface, *rest)  # type: ignore[arg-type]

    monkeypatch.setattr(predict_module, "load_or_build", spy)
    proxied = predict_field(mesh, model, cache=False)
    full = predict_field(mesh, model, resolution="full", cache=False)
    assert asked[0] == pytest.approx(1300, rel=0.1)
    assert asked[1] == mesh.n_vertices
    angle = np.degrees(np.abs(np.angle(proxied.z * full.z.conj()))) / 4.0
    assert np.median(angle) < 12.0  # 8 with random weights on so coarse a proxy; chance is 22.5
    assert proxied.size is not None
    assert full.size is not None
    assert np.median(np.abs(np.log(proxied.size / full.size))) < 0.2


def test_stand_ins_share_the_proxies_of_what_they_stand_for(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """5. Component by component; small components are answered as the stand-in has them."""
    monkeypatch.setattr(proxy_module, "PROXY_ABOVE", 2000)
    monkeypatch.setattr(proxy_module, "PROXY_VERTICES", 900)
    ball, small = icosphere(4), moved(icosphere(3), (4.0, 0.0, 0.0))
    whole = merge(ball, small)
    coarse = make_proxy(ball, 1500)
    assert coarse is not None
    asked: list[tuple[str, TriMesh]] = []

    def answer(kind: str, surface: TriMesh) -> CrossField:
        asked.append((kind, surface))
        n = surface.n_vertices
        return CrossField("vertices", np.ones(n), np.full(n, 0.1), np.full(n, 0.7))

    for copy in (merge(ball, small), merge(coarse, small)):
        field = by_components(
            copy, lambda part: answer("part", part), lambda part: answer("proxy", part), of=whole
        )
        assert len(field) == copy.n_vertices
        np.testing.assert_allclose(np.abs(field.z), 1.0)
        np.testing.assert_allclose(field.confidence, 0.7)
    assert [kind for kind, _ in asked] == ["proxy", "part"] * 2
    assert asked[0][1].n_vertices == pytest.approx(900, rel=0.1)
    np.testing.assert_array_equal(asked[0][1].vertices, asked[2][1].vertices)
    np.testing.assert_array_equal(asked[1][1].vertices, small.vertices)


def test_what_cannot_be_decimated_so_far_takes_its_stand_in(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """5. A proxy of the stand-in then, or the stand-in itself."""
    monkeypatch.setattr(proxy_module, "PROXY_ABOVE", 1000)
    monkeypatch.setattr(proxy_module, "PROXY_VERTICES", 500)
    ball = icosphere(4)
    copy = make_proxy(ball, 1500)
    assert copy is not None
    for refused, kind in (((ball,), "proxy"), ((ball, copy), "part")):
        monkeypatch.setattr(
            proxy_module,
            "make_proxy",
            lambda mesh, n, refused=refused: (
                None if any(mesh is one for one in refused) else make_proxy(mesh, n)
            ),
        )
        asked: list[str] = []

        def answer(how: str, surface: TriMesh, asked: list[str] = asked) -> CrossField:
            asked.append(how)
            n = surface.n_vertices
            return CrossField("vertices", np.ones(n), np.full(n, 0.1), np.ones(n))

        by_components(copy, partial(answer, "part"), partial(answer, "proxy"), of=ball)
        assert asked == [kind]


def test_carrying_back_loses_little() -> None:
    """6. A field known in closed form, from a proxy to the mesh: about a degree."""
    mesh = icosphere(4, 2.0)
    proxy = make_proxy(mesh, 900)
    assert proxy is not None

    def parallels(surface: TriMesh) -> np.ndarray:
        p = surface.vertices
        along = np.stack([-p[:, 1], p[:, 0], np.zeros(len(p))], axis=1)
        z = from_3d(along, vertex_axes(surface))
        return np.asarray((z / np.maximum(np.abs(z), 1e-12)) ** 4)

    height = 1.0 + 0.1 * proxy.vertices[:, 2]
    back = carry_back(proxy, CrossField("vertices", parallels(proxy), height), mesh)
    away = np.abs(mesh.vertices[:, 2]) < 1.7
    angle = np.degrees(np.abs(np.angle(back.z * parallels(mesh).conj())))[away] / 4.0
    assert angle.mean() < 1.0
    assert back.size is not None
    np.testing.assert_allclose(back.size, 1.0 + 0.1 * mesh.vertices[:, 2], atol=0.02)


def test_no_proxy_where_topology_would_change() -> None:
    """7. A mesh that is small already is used as it is."""
    assert make_proxy(blob(1), 500) is None


def test_shapes_without_features_get_a_common_size() -> None:
    """9. Curvature says nothing of a disk: without training sizes would be nearly 0."""
    mesh = disk(8)
    blank = Model(random_network(small_settings(**LOCAL), torch.float32))
    with torch.no_grad():
        for name, parameter in blank.network.named_parameters():
            if name.endswith("bias"):
                parameter.zero_()
    size = predict_field(mesh, blank, cache=False).size
    assert size is not None
    np.testing.assert_allclose(size, 0.02 * np.sqrt(mesh.area), rtol=1e-5)


def test_sizes_have_a_bound() -> None:
    """10. A region where the network loses all measure does not take the quads from the rest."""
    mesh = blob(2)
    wild = random_network(small_settings(), torch.float32)

    def blow_up(_network: object, _given: object, output: FieldOutput) -> FieldOutput:
        size = torch.linspace(0.01, 0.03, mesh.n_vertices)
        size[:5] = 20.0
        return replace(output, size=size)

    wild.register_forward_hook(blow_up)
    size = predict_field(mesh, Model(wild), cache=False).size
    assert size is not None
    given = np.linspace(0.01, 0.03, mesh.n_vertices)
    given[:5] = 10.0 * np.median(np.append(given[5:], np.full(5, np.inf)))
    np.testing.assert_allclose(size, given * np.sqrt(mesh.area), rtol=1e-5)


def test_wrong_options_are_refused(model: Model) -> None:
    """8. Resolution, device, order."""
    with pytest.raises(ConfigError, match="resolution"):
        predict_field(blob(1), model, resolution="half")  # type: ignore[arg-type]
    with pytest.raises(ConfigError, match="--device"):
        predict_field(blob(1), model, device="nowhere")
    vectors = Model(random_network(small_settings(order=1), torch.float32))
    with pytest.raises(ModelError, match="order 1"):
        predict_field(blob(1), vectors)

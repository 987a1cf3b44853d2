"""The network commutes with everything that should not matter to it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import torch

from tests.meshes import blob, random_rigid, relabel, sheet
from tests.nn_inputs import (
    LOCAL,
    K,
    answer,
    as_input,
    blob_operators,
    from_halfedges,
    operators_of,
    random_network,
    small_settings,
)
from vhquad.errors import ConfigError, ModelError
from vhquad.field.cross import CrossField
from vhquad.learn.proxy import carry_back
from vhquad.learn.targets import isotropic_remesh
from vhquad.mesh.triangle import TriMesh
from vhquad.nn.deepen import deepened
from vhquad.nn.inputs import network_input
from vhquad.nn.network import VectorHeatNet
from vhquad.nn.settings import PRESETS

TIGHT = 1e-9  # float64 through eigenvectors that ARPACK gives to about 1e-12


@pytest.mark.parametrize("features", ["hks", "local"])
@pytest.mark.parametrize("head", ["paper", "mixed"])
@pytest.mark.parametrize("order", [1, 2, 4])
@pytest.mark.parametrize(
    ("dtype", "tolerance"), [(torch.float64, TIGHT), (torch.float32, 1e-4)], ids=["f64", "f32"]
)
def test_tangent_bases_do_not_matter(
    features: str,
    head: str,
    order: int,
    dtype: torch.dtype,
    tolerance: float,
    rng: np.random.Generator,
) -> None:
    """1. Turning the basis of every vertex at random turns the answer along, N-fold."""
    o = blob_operators(features)
    chosen = small_settings(head=head, order=order, **(LOCAL if features == "local" else {}))
    network = random_network(chosen, dtype)
    turn = np.exp(2j * np.pi * rng.random(len(o.mass)))
    turned = replace(
        o,
        eigenvectors=o.eigenvectors * turn[:, None],
        features=o.features * turn[:, None],
        lines=o.lines * turn[:, None] ** 2,
    )
    z, size = answer(network, as_input(o, dtype))
    z2, size2 = answer(network, as_input(turned, dtype))
    assert np.abs(z2 - z * turn**order).max() < tolerance
    # Sizes near 0 are lengths of vectors that cancel: their rounding is that of typical ones.
    np.testing.assert_allclose(size2, size, rtol=tolerance, atol=0.1 * tolerance * size.mean())


def test_eigenvector_phases_do_not_matter(rng: np.random.Generator) -> None:
    """2. Each eigenvector is known up to a unit factor only."""
    o = blob_operators()
    network = random_network(small_settings())
    phase = np.exp(2j * np.pi * rng.random(K))
    z, _ = answer(network, as_input(o))
    z2, _ = answer(network, as_input(replace(o, eigenvectors=o.eigenvectors * phase)))
    assert np.abs(z2 - z).max() < TIGHT


@pytest.mark.parametrize("features", ["hks", "local"])
def test_rigid_motion_and_scale_do_not_matter(features: str, rng: np.random.Generator) -> None:
    """3. Frames ride along with the mesh; sizes scale with it."""
    mesh = blob(3)
    network = random_network(small_settings(**(LOCAL if features == "local" else {})))
    z, size = answer(network, as_input(blob_operators(features)))
    moved = random_rigid(rng).mesh(mesh)
    z2, size2 = answer(network, as_input(operators_of(moved, features)))
    assert np.abs(z2 - z).max() < TIGHT
    np.testing.assert_allclose(size2, size, rtol=TIGHT)
    scaled = TriMesh(mesh.vertices * 250.0, mesh.faces)
    z3, size3 = answer(network, as_input(operators_of(scaled, features)))
    assert np.abs(z3 - z).max() < TIGHT
    np.testing.assert_allclose(size3, 250.0 * size, rtol=TIGHT)


@pytest.mark.parametrize("order", [1, 4])
def test_labels_do_not_matter(order: int, rng: np.random.Generator) -> None:
    """4. Vertices, faces and corners in another order: the same field, seen from each halfedge."""
    mesh, network = blob(3), random_network(small_settings(order=order))
    other = relabel(mesh, rng)
    z, size = answer(network, as_input(blob_operators()))
    z2, size2 = answer(network, as_input(operators_of(other.mesh)))
    corner = (np.arange(3) + other.shift[:, None]) % 3
    where = (3 * other.face[:, None] + corner).reshape(-1)
    seen, seen2 = from_halfedges(z, mesh, order), from_halfedges(z2, other.mesh, order)
    assert np.abs(seen2[where] - seen).max() < TIGHT
    np.testing.assert_allclose(size2[other.vertex], size, rtol=TIGHT)


def test_isometric_deformation_does_not_matter() -> None:
    """5. A flat sheet and the same sheet rolled up by 300 degrees have the same field."""
    network = random_network(small_settings())
    flat, rolled = sheet(), sheet(turn=np.radians(300.0))
    assert np.abs(flat.vertices - rolled.vertices).max() > 0.3
    z, size = answer(network, as_input(operators_of(flat)))
    z2, size2 = answer(network, as_input(operators_of(rolled)))
    assert np.abs(z2 - z).max() < 1e-7  # eigenvectors close to one another amplify rounding
    np.testing.assert_allclose(size2, size, rtol=1e-7)


def test_retriangulation_changes_little(record_property: Callable[[str, object], None]) -> None:
    """6. The same shape with other triangles: a discretisation error, measured and bounded."""
    mesh, network = blob(4), random_network(small_settings())
    other = isotropic_remesh(np.array(mesh.vertices), np.array(mesh.faces), 1800)
    z, _ = answer(network, as_input(operators_of(mesh)))
    z2, size2 = answer(network, as_input(operators_of(other)))
    back = carry_back(other, CrossField("vertices", z2, size2), mesh)
    angle = np.degrees(np.abs(np.angle(back.z * z.conj()))) / 4.0
    record_property("median angle in degrees", float(np.median(angle)))
    assert np.median(angle) < 5.0, np.median(angle)  # 3.5 with random weights; chance is 22.5


@pytest.mark.parametrize("features", ["hks", "local"])
def test_mirror_image_is_the_conjugate(features: str) -> None:
    """7. What mirror_image() promises: nothing needs to be built for the mirror image."""
    mesh = blob(3)
    network = random_network(small_settings(**(LOCAL if features == "local" else {})))
    flipped = TriMesh(mesh.vertices * [-1.0, 1.0, 1.0], mesh.faces[:, ::-1])
    z2, size2 = answer(network, as_input(operators_of(flipped, features)))
    z, size = answer(network, as_input(blob_operators(features)).mirror_image())
    assert np.abs(z - answer(network, as_input(blob_operators(features)))[0]).max() > 0.1
    # Seen from the edge to the same neighbour; angles turn the other way in the mirror.
    seen, seen2 = (
        _by_edge(from_halfedges(z, mesh, 4), mesh),
        _by_edge(from_halfedges(z2, flipped, 4), flipped),
    )
    assert seen.keys() == seen2.keys()
    assert max(abs(seen[e].conjugate() - seen2[e]) for e in seen) < TIGHT
    np.testing.assert_allclose(size, size2, rtol=TIGHT)


def _by_edge(seen: np.ndarray, mesh: TriMesh) -> dict[tuple[int, int], complex]:
    pairs = zip(mesh.tail.tolist(), mesh.head.tolist(), strict=True)
    return dict(zip(pairs, seen.tolist(), strict=True))


def test_small_meshes_are_padded() -> None:
    """8. A mesh of fewer than k vertices has a complete basis; empty vectors make up the number."""
    o = operators_of(blob(1))
    n = len(o.mass)
    assert o.eigenvectors.shape == (n, min(n, K))
    basis = np.linalg.qr(np.random.default_rng(0).standard_normal((n, n)))[0] + 0j
    arrays = (o.mass, np.linspace(0.0, 9.0, n), basis / np.sqrt(o.mass)[:, None], o.features)
    network = random_network(small_settings(k=64))
    with pytest.raises(ModelError, match="64 eigenvectors"):
        network(network_input(*arrays, dtype=torch.float64))
    z, _ = answer(network, network_input(*arrays, dtype=torch.float64, k=64))
    assert np.isfinite(z).all()


def test_features_of_another_kind_are_refused() -> None:
    """9. The message says both numbers."""
    network = random_network(small_settings(in_channels=2))
    message = "40 eigenvectors, 2 feature channels and 0 lines, the mesh comes with 40, 30 and 0"
    with pytest.raises(ModelError, match=message):
        network(as_input(blob_operators()))


def test_presets_have_the_documented_sizes() -> None:
    """10. The paper's: 6 blocks, 256 channels; the starter's: about half a million weights."""
    paper = PRESETS["paper"]
    assert (paper.blocks, paper.channels, paper.k, paper.dropout) == (6, 256, 128, 0.5)
    assert VectorHeatNet(PRESETS["starter"]).n_parameters < 520_000


@pytest.mark.parametrize("features", ["hks", "local"])
@pytest.mark.parametrize("blocks", [2, 3, 5])
def test_a_deeper_network_answers_the_same_and_learns(features: str, blocks: int) -> None:
    """Bit for bit at first; then every new block gets gradients."""
    mesh = as_input(blob_operators(features))
    chosen = small_settings(**(LOCAL if features == "local" else {}))
    network = random_network(chosen)
    deeper = deepened(network, blocks)
    before, after = network(mesh), deeper(mesh)
    assert torch.equal(before.z, after.z)
    assert torch.equal(before.size, after.size)
    assert len(deeper.blocks) == blocks
    after.z.square().sum().backward()
    for block in deeper.blocks:
        assert block.mlp.layers[-1].weight.grad.abs().max() > 0


def test_a_deeper_network_keeps_its_blocks() -> None:
    with pytest.raises(ConfigError, match="2 blocks"):
        deepened(random_network(small_settings(blocks=2)), 1)

"""Layers against complex arithmetic and numerical derivatives."""

from __future__ import annotations

import numpy as np
import torch

from tests.nn_inputs import as_input, blob_operators, random_network, small_settings
from vhquad.nn.diffusion import SpectralDiffusion, from_spectral, to_spectral
from vhquad.nn.heads import complex_power
from vhquad.nn.inputs import stack, unstack
from vhquad.nn.layers import VectorDropout, VectorMLP, magnitude_relu


def _random(shape: tuple[int, ...], seed: int = 0) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return rng.standard_normal(shape) + 1j * rng.standard_normal(shape)


def test_magnitude_relu_by_hand() -> None:
    """1. 3 + 4i has modulus 5: a bias of 2 leaves 3/5 of it, one of 6 nothing, -5 doubles it."""
    x = stack(np.array([[3 + 4j, 3 + 4j, 3 + 4j, 0j]]), torch.float64)
    out = unstack(magnitude_relu(x, torch.tensor([2.0, 6.0, -5.0, 1.0], dtype=torch.float64)))
    np.testing.assert_allclose(out, [[1.8 + 2.4j, 0, 6 + 8j, 0]], atol=1e-12)


def test_magnitude_relu_derivative() -> None:
    """2. The derivative written by hand is that of finite differences."""
    x = stack(_random((5, 3)), torch.float64).requires_grad_()
    bias = torch.tensor([0.3, -0.4, 1.0], dtype=torch.float64, requires_grad=True)
    assert torch.autograd.gradcheck(magnitude_relu, (x, bias))


def test_dropout_takes_whole_numbers() -> None:
    """3. Real and imaginary part fall together; the mean stays; nothing falls in evaluation."""
    x = stack(_random((400, 50)), torch.float64)
    layer = VectorDropout(0.3)
    torch.manual_seed(0)
    out = layer(x)
    gone = out == 0
    assert torch.equal(gone[0], gone[1])
    share = gone.double().mean().item()
    assert abs(share - 0.3) < 0.02
    torch.testing.assert_close(out[~gone], (x / 0.7)[~gone])
    assert layer.eval()(x) is x


def test_dropout_keeps_the_equivariance(rng: np.random.Generator) -> None:
    """4. With the same draw, turned inputs give turned outputs while training, too."""
    mlp = VectorMLP([4, 6, 2], dropout=0.5).double().train()
    x, turn = _random((30, 4)), np.exp(2j * np.pi * rng.random((30, 1)))
    results = []
    for value in (x, x * turn):
        torch.manual_seed(3)
        results.append(unstack(mlp(stack(value, torch.float64))))
    np.testing.assert_allclose(results[1], results[0] * turn, atol=1e-12)


def test_spectral_transforms_are_complex_products() -> None:
    """5. The stacked real products are Phi^H M X and Phi C."""
    o, given = blob_operators(), as_input(blob_operators())
    x = _random((len(o.mass), 2))
    c = unstack(to_spectral(stack(x, torch.float64), given))
    expected = o.eigenvectors.conj().T @ (o.mass[:, None] * x) / np.sqrt(o.area)
    np.testing.assert_allclose(c, expected, atol=1e-12)
    back = unstack(from_spectral(stack(c, torch.float64), given))
    np.testing.assert_allclose(back, o.eigenvectors @ c * np.sqrt(o.area), atol=1e-12)


def test_diffusion_before_the_map_or_inside_it() -> None:
    """6. Mapping in the spectral domain is diffusing to every time, joining, and mapping after."""
    o, given = blob_operators(), as_input(blob_operators())
    layer = SpectralDiffusion(2, 3, times=4, keep_input=True).double()
    x = _random((len(o.mass), 2))
    weights = layer.weight.detach().numpy()
    assert layer.own_weight is not None
    expected = x @ layer.own_weight.detach().numpy()
    for log_time, weight in zip(layer.log_times.tolist(), weights, strict=True):
        s = np.exp(log_time) * o.area / (4.0 * np.pi)
        decay = np.exp(-o.eigenvalues * s)
        coefficients = o.eigenvectors.conj().T @ (o.mass[:, None] * x)
        expected = expected + o.eigenvectors @ (decay[:, None] * coefficients) @ weight
    found = unstack(layer(stack(x, torch.float64), given))
    np.testing.assert_allclose(found, expected, atol=1e-11)


def test_complex_power() -> None:
    """7. N times the angle, the same length."""
    v = _random((20,))
    for order in (1, 2, 4):
        found = unstack(complex_power(stack(v, torch.float64), order))
        np.testing.assert_allclose(found, v**order / np.abs(v) ** (order - 1), rtol=1e-6)


def test_mixed_head_starts_as_the_papers() -> None:
    """8. With gates at zero only the first vector speaks."""
    torch.manual_seed(0)
    from vhquad.nn.network import VectorHeatNet

    mixed = VectorHeatNet(small_settings()).double()
    paper = VectorHeatNet(small_settings(head="paper")).double()
    state = {k: v for k, v in mixed.state_dict().items() if not k.startswith("head.")}
    state["head.vectors.weight"] = mixed.state_dict()["head.vectors.weight"][:, :1]
    paper.load_state_dict(state)
    given = as_input(blob_operators())
    with torch.no_grad():
        a, b = mixed(given), paper(given)
    torch.testing.assert_close(a.z, b.z)
    torch.testing.assert_close(a.size, b.size)


def test_bfloat16_products_are_near() -> None:
    """9. The training precision gives nearly the same field."""
    network = random_network(small_settings(), torch.float32)
    given = as_input(blob_operators(), torch.float32)
    with torch.no_grad():
        full = unstack(network(given).z)
        with torch.autocast("cpu", dtype=torch.bfloat16):
            low = unstack(network(given.low_precision()).z)
    error = np.degrees(np.abs(np.angle(low * full.conj())))
    assert np.median(error) < 5.0

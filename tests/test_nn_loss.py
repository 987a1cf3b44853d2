"""The loss by hand: exact, random, unweighted vertices, unknown sizes."""

from __future__ import annotations

import numpy as np
import torch

from vhquad.nn.inputs import stack
from vhquad.nn.loss import FieldTruth, field_loss
from vhquad.nn.network import FieldOutput


def _tensor(values: list[float]) -> torch.Tensor:
    return torch.tensor(values, dtype=torch.float64)


def test_by_hand() -> None:
    """1. Weights 3 and 1; angles of z off by 0 and 180 degrees; sizes off by 10 and 50 %."""
    output = FieldOutput(stack(np.array([2.0 + 0j, -5.0]), torch.float64), _tensor([1.1, 3.0]))
    truth = FieldTruth(
        stack(np.array([1.0 + 0j, 1.0]), torch.float64), _tensor([1.0, 2.0]), _tensor([3.0, 1.0])
    )
    loss = field_loss(output, truth)
    assert abs(float(loss.direction) - 2.0 / 4.0) < 1e-9
    assert abs(float(loss.magnitude) - (3.0 * 0.1 + 0.5) / 4.0) < 1e-9
    assert abs(float(loss.total) - float(loss.direction) - float(loss.magnitude)) < 1e-12


def test_vertices_without_truth_do_not_count() -> None:
    """2. No weight: neither term; no size: no magnitude term."""
    output = FieldOutput(stack(np.array([1j, 1.0 + 0j, 1.0]), torch.float64), _tensor([9, 9, 1.2]))
    truth = FieldTruth(
        stack(np.ones(3, dtype=complex), torch.float64), _tensor([1, 0, 1]), _tensor([0, 1, 1])
    )
    loss = field_loss(output, truth)
    assert float(loss.direction) < 1e-9
    assert abs(float(loss.magnitude) - 0.2) < 1e-9


def test_random_fields_score_one(rng: np.random.Generator) -> None:
    """3. The mean of 1 - cos of a uniform angle is 1; standard error 0.7 / sqrt(20000)."""
    z = np.exp(2j * np.pi * rng.random(20_000))
    ones = torch.ones(20_000, dtype=torch.float64)
    loss = field_loss(
        FieldOutput(stack(z, torch.float64), ones),
        FieldTruth(stack(np.ones(20_000, dtype=complex), torch.float64), ones, ones),
    )
    assert abs(float(loss.direction) - 1.0) < 0.02


def test_by_edges_weighs_by_area_over_size() -> None:
    """5. Areas 2, 3, 5 and 4 with sizes 1, 0.5, unknown and 2: edges 2, 6 and 2, 10 over 9 a unit
    of area for the unknown; the losses are the means by these."""
    z = stack(np.ones(4, dtype=complex), torch.float64)
    truth = FieldTruth(z, _tensor([1.0, 0.5, 0.0, 2.0]), _tensor([2.0, 3.0, 5.0, 4.0]))
    by_edges = truth.by_edges()
    torch.testing.assert_close(by_edges.weight, _tensor([2.0, 6.0, 50.0 / 9.0, 2.0]))
    assert by_edges.z is truth.z
    assert by_edges.size is truth.size
    off = stack(np.array([1.0, -1.0, 1.0, 1.0], dtype=complex), torch.float64)
    loss = field_loss(FieldOutput(off, _tensor([1.0, 1.0, 1.0, 2.0])), by_edges)
    assert abs(float(loss.direction) - 2.0 * 6.0 / (10.0 + 50.0 / 9.0)) < 1e-9
    assert abs(float(loss.magnitude) - 6.0 / 10.0) < 1e-9


def test_a_zero_answer_has_a_finite_gradient() -> None:
    """4. z = 0 has no direction: loss 1, gradient finite."""
    z = torch.zeros(2, 3, dtype=torch.float64, requires_grad=True)
    ones = torch.ones(3, dtype=torch.float64)
    truth = FieldTruth(stack(np.ones(3, dtype=complex), torch.float64), ones, ones)
    loss = field_loss(FieldOutput(z, ones), truth)
    loss.total.backward()
    assert float(loss.direction.detach()) == 1.0
    assert z.grad is not None
    assert bool(z.grad.isfinite().all())

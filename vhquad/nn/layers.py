"""Layers on complex features with real weights: linear, magnitude ReLU, dropout, vector MLP.

Complex features are one real tensor of shape ``(2, n, c)``: ``x[0]`` the real part, ``x[1]`` the
imaginary part. A real weight then is one ordinary matrix product on ``2 n`` rows, much faster
on a CPU than complex arithmetic. A change of a vertex's tangent basis rotates its ``c`` numbers by
one angle, and every layer here commutes with that (Gao et al. 2024, section 4.2).
"""

from __future__ import annotations

import itertools
import math
from typing import Any

import torch
from torch import Tensor, nn

__all__ = [
    "LineReflection",
    "MagnitudeReLU",
    "VectorDropout",
    "VectorLinear",
    "VectorMLP",
    "magnitude_relu",
]

TINY = 1e-12  # below this modulus a complex number has no direction


class VectorLinear(nn.Module):
    """Z = Y W with a real weight ``(c_in, c_out)``; an offset would be no tangent vector."""

    def __init__(self, c_in: int, c_out: int, gain: float = 1.0) -> None:
        super().__init__()
        self.weight = nn.Parameter(torch.zeros(c_in, c_out))
        bound = gain * math.sqrt(3.0 / c_in)
        nn.init.uniform_(self.weight, -bound, bound)

    def forward(self, x: Tensor) -> Tensor:
        """(2, n, c_in) -> (2, n, c_out)."""
        return x @ self.weight


class _MagnitudeReLUFunction(torch.autograd.Function):
    """relu(|z| - b) z / |z| with the derivative written out (half the time of autograd's)."""

    @staticmethod
    def forward(ctx: Any, x: Tensor, bias: Tensor) -> Tensor:
        modulus = torch.sqrt(x[0].square().addcmul_(x[1], x[1])).clamp_(min=TINY)
        ratio = bias.to(x.dtype) / modulus
        scale = (1.0 - ratio).clamp_(min=0.0)
        ctx.save_for_backward(x, modulus, ratio)
        return x * scale

    @staticmethod
    def backward(ctx: Any, *grads: Tensor) -> tuple[Tensor, Tensor]:
        (grad,) = grads
        x, modulus, ratio = ctx.saved_tensors
        active = ratio < 1.0
        # out = (1 - b / |z|) z, so d out = (1 - b / |z|) dz + b / |z| times dz's radial part
        radial = (grad[0] * x[0]).addcmul_(grad[1], x[1]).div_(modulus).mul_(active)
        grad_bias = -radial.sum(dim=0, dtype=torch.float32 if x.dtype.itemsize < 4 else x.dtype)
        scale = (1.0 - ratio).clamp_(min=0.0)
        grad_x = grad * scale
        grad_x.addcmul_(x, (radial * ratio).div_(modulus))
        return grad_x, grad_bias


def magnitude_relu(x: Tensor, bias: Tensor) -> Tensor:
    """Shorten each complex number by its channel's bias, to zero if it is shorter than that.

    Parameters
    ----------
    x : (2, n, c) Tensor
    bias : (c,) Tensor
        May be negative: the number then grows.

    Returns
    -------
    (2, n, c) Tensor
        ``relu(|z| - b) z / |z|`` (Gao et al. 2024, section 4.2).
    """
    return _MagnitudeReLUFunction.apply(x, bias)


class MagnitudeReLU(nn.Module):
    """:func:`magnitude_relu` with a learned bias a channel."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        # With every bias 0 the network would be linear; these make it differ from the first step.
        self.bias = nn.Parameter(torch.linspace(0.0, 0.2, channels))

    def forward(self, x: Tensor) -> Tensor:
        """(2, n, c) -> (2, n, c)."""
        return magnitude_relu(x, self.bias)


class LineReflection(nn.Module):
    """X + Q conj(X W): vectors also reflected at lines, Q a learned real mix of them a channel.

    A line q = e^(2ia) turns twice as fast as a vector v with the frame: q conj(v), the reflection
    of v at the line, turns like v. This is how a network of vectors makes use of lines.
    """

    def __init__(self, channels: int, lines: int) -> None:
        super().__init__()
        self.vectors = VectorLinear(channels, channels, gain=0.3)
        self.lines = VectorLinear(lines, channels, gain=0.3 * math.sqrt(lines))

    def forward(self, x: Tensor, lines: Tensor) -> Tensor:
        """(2, n, c) and (2, n, l) -> (2, n, c)."""
        q, y = self.lines(lines), self.vectors(x)
        re = torch.addcmul(q[0] * y[0], q[1], y[1])
        im = torch.addcmul(q[1] * y[0], q[0], y[1], value=-1.0)
        return x + torch.stack([re, im])


class VectorDropout(nn.Module):
    """Drop whole complex numbers while training, and scale the others up.

    Real and imaginary part fall together: dropping them apart would depend on the tangent basis.
    """

    def __init__(self, share: float) -> None:
        super().__init__()
        self.share = share

    def forward(self, x: Tensor) -> Tensor:
        """(2, n, c) -> (2, n, c)."""
        if not self.training or self.share == 0.0:
            return x
        keep = 1.0 - self.share
        mask = torch.empty(x.shape[1:], dtype=x.dtype, device=x.device).bernoulli_(keep)
        return x * (mask / keep)


class VectorMLP(nn.Module):
    """Linear maps with magnitude ReLU and dropout between them, none after the last.

    Parameters
    ----------
    sizes : list of int
        Channels in, of each hidden layer, out.
    dropout : float
        Share dropped at each hidden layer.
    last_gain : float
        Factor on the initial weights of the last map (small in a residual branch).
    """

    def __init__(self, sizes: list[int], dropout: float = 0.0, last_gain: float = 1.0) -> None:
        super().__init__()
        layers: list[nn.Module] = []
        for place, (c_in, c_out) in enumerate(itertools.pairwise(sizes)):
            last = place == len(sizes) - 2
            layers.append(VectorLinear(c_in, c_out, last_gain if last else 1.0))
            if not last:
                layers += [MagnitudeReLU(c_out), VectorDropout(dropout)]
        self.layers = nn.Sequential(*layers)

    def forward(self, x: Tensor) -> Tensor:
        """(2, n, sizes[0]) -> (2, n, sizes[-1])."""
        out: Tensor = self.layers(x)
        return out

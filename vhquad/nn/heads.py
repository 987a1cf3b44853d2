"""Output heads: from the last features to the N-th power z of the direction, and to a length.

- "paper": one vector u a vertex, z = u^N (Gao et al. 2024). For a cross, u has to jump by 90
  degrees somewhere around each singularity.
- "mixed": z = v_0^N / |v_0|^(N-1) + sum_c g_c v_c^N / |v_c|^(N-1), the gates g_c linear in the
  moduli of the last features and zero at first. Where one term has to jump another takes over. If
  the input has lines q (principal directions), their powers are further terms.

In both, the length is proportional to |u| or |v_0| and to the square root of the area.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn

from vhquad.nn.layers import VectorLinear

__all__ = ["LENGTH_UNIT", "MixedHead", "PaperHead", "complex_power"]

EPSILON = 1e-6  # softens v / |v| at 0; outputs are of the order of 1
LENGTH_UNIT = 0.02  # quad edge over sqrt(area) of about 2500 quads, so that |v| is about 1


def complex_power(x: Tensor, order: int) -> Tensor:
    """v^N / |v|^(N-1) of each complex number: the same length, N times the angle; (2, ...)."""
    length = torch.sqrt(x.square().sum(dim=0) + EPSILON**2)
    re, im = x[0], x[1]
    for _ in range({1: 0, 2: 1, 4: 2}[order]):
        re, im = (re.square() - im.square()) / length, 2.0 * re * im / length
    return torch.stack([re, im])


class PaperHead(nn.Module):
    """One vector u; z has the direction of u^N."""

    def __init__(self, channels: int, order: int) -> None:
        super().__init__()
        self.order = order
        self.vectors = VectorLinear(channels, 1)

    def forward(self, x: Tensor, lines: Tensor) -> tuple[Tensor, Tensor]:
        """(2, n, c) -> z (2, n), not normalised, and length over sqrt(A), (n,).

        Lines are not used.
        """
        u = self.vectors(x)[..., 0]
        size = LENGTH_UNIT * torch.sqrt(u.square().sum(dim=0) + EPSILON**2)
        return complex_power(u, self.order), size


class MixedHead(nn.Module):
    """Several vectors whose N-th powers are summed with learned gates."""

    def __init__(self, channels: int, order: int, terms: int, lines: int = 0) -> None:
        super().__init__()
        self.order = order
        self.lines = lines if order % 2 == 0 else 0  # of a line no sign is known
        self.vectors = VectorLinear(channels, 1 + terms)
        self.gates = nn.Linear(channels, terms + self.lines)
        nn.init.zeros_(self.gates.weight)
        nn.init.zeros_(self.gates.bias)

    def forward(self, x: Tensor, lines: Tensor) -> tuple[Tensor, Tensor]:
        """(2, n, c) and (2, n, l) -> z (2, n), not normalised, and length over sqrt(A), (n,)."""
        v = self.vectors(x)
        powers = complex_power(v, self.order)
        terms = powers[..., 1:]
        if self.lines:
            terms = torch.cat([terms, complex_power(lines, self.order // 2)], dim=-1)
        gates = self.gates(torch.sqrt(x.square().sum(dim=0) + EPSILON**2))
        z = powers[..., 0] + (terms * gates).sum(dim=-1)
        size = LENGTH_UNIT * torch.sqrt(v[..., 0].square().sum(dim=0) + EPSILON**2)
        return z, size

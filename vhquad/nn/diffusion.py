"""Learned vector heat diffusion and the linear map after it, both done in the spectral domain.

Diffusing X by each of m times s_i and mapping the results by W_i is (Gao et al. 2024, eq. 6 and
section 4.2)

    Z = sum_i Phi exp(-Lambda s_i) (Phi^H M X) W_i = Phi [sum_i exp(-Lambda s_i) (Phi^H M X) W_i]

The right side maps k spectral rows instead of n vertices, so that more times cost next to nothing.
"""

from __future__ import annotations

import math

import torch
from torch import Tensor, nn

from vhquad.nn.inputs import NetworkInput

__all__ = ["SpectralDiffusion", "from_spectral", "to_spectral"]

SHORTEST, LONGEST = 3e-3, 1.0  # initial times, in A / 4 pi


def to_spectral(x: Tensor, mesh: NetworkInput) -> Tensor:
    """Coefficients Phi^H M X: (2, n, c) -> (2, k, c)."""
    k = len(mesh.eigenvalues)
    re = mesh.weighted_basis.T @ x[0]  # rows: Re Phi, then Im Phi
    im = mesh.weighted_basis.T @ x[1]
    return torch.stack([re[:k] + im[k:], im[:k] - re[k:]])


def from_spectral(coefficients: Tensor, mesh: NetworkInput) -> Tensor:
    """Vertex values Phi C: (2, k, c) -> (2, n, c)."""
    re, im = coefficients[0], coefficients[1]
    return torch.stack([mesh.basis @ torch.cat([re, -im]), mesh.basis @ torch.cat([im, re])])


class SpectralDiffusion(nn.Module):
    """m learned diffusions of c channels followed by a real linear map to ``c_out`` channels.

    Parameters
    ----------
    c_in, c_out : int
        Channels.
    times : int
        How many diffusion times, m. They are multiples of the area, learned as logarithms:
        s_i = exp(log_times_i) A / 4 pi.
    keep_input : bool
        Whether the linear map also sees the undiffused channels.
    """

    def __init__(self, c_in: int, c_out: int, times: int, keep_input: bool) -> None:
        super().__init__()
        start = torch.linspace(math.log(SHORTEST), math.log(LONGEST), times)
        self.log_times = nn.Parameter(start)
        parts = times + int(keep_input)
        bound = math.sqrt(3.0 / (parts * c_in))
        self.weight = nn.Parameter(torch.zeros(times, c_in, c_out).uniform_(-bound, bound))
        self.own_weight: nn.Parameter | None = None
        if keep_input:
            self.own_weight = nn.Parameter(torch.zeros(c_in, c_out).uniform_(-bound, bound))

    def forward(self, x: Tensor, mesh: NetworkInput) -> Tensor:
        """(2, n, c_in) -> (2, n, c_out)."""
        decay = torch.exp(-mesh.eigenvalues[:, None] * self.log_times.exp())  # (k, m)
        coefficients = to_spectral(x, mesh)
        diffused = coefficients[None] * decay.T[:, None, :, None]  # (m, 2, k, c)
        mapped = torch.einsum("mpkc,mcd->pkd", diffused, self.weight)
        out = from_spectral(mapped, mesh)
        return out if self.own_weight is None else out + x @ self.own_weight

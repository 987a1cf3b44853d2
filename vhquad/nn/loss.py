"""The paper's loss (Gao et al. 2024, eq. 8): a direction and a magnitude term, apart.

Both are means over the surface, weighted by vertex area and, beyond the paper, by the coherence of
the ground truth: where the artist's quads have no single direction (at irregular vertices) neither
does the truth.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from vhquad.nn.network import FieldOutput

__all__ = ["FieldLoss", "FieldTruth", "field_loss"]

EPSILON = 1e-8


@dataclass(frozen=True, eq=False)
class FieldTruth:
    """Ground truth at the vertices of one mesh.

    Attributes
    ----------
    z : (2, n) Tensor
        N-th power of the direction, unit modulus.
    size : (n,) Tensor
        Length over the square root of the mesh's area; 0 where it is unknown.
    weight : (n,) Tensor
        Vertex area times coherence, not negative; 0 where there is no truth.
    """

    z: Tensor
    size: Tensor
    weight: Tensor

    def to(self, device: torch.device | str, dtype: torch.dtype | None = None) -> FieldTruth:
        """The same on another device or in another precision."""
        parts = (self.z, self.size, self.weight)
        return FieldTruth(*(part.to(device=device, dtype=dtype) for part in parts))

    def by_edges(self) -> FieldTruth:
        """With each vertex weighted by how long the artist's edges on its cell are, not by area.

        Half of a head's quads lie on the small part of it where they are smallest. Vertices of
        unknown size keep their share.
        """
        known = self.size > 0
        sized = torch.where(known, self.weight, torch.zeros_like(self.weight))
        edges = sized / torch.where(known, self.size, torch.ones_like(self.size))
        mean = edges.sum() / sized.sum().clamp(min=EPSILON)
        return FieldTruth(self.z, self.size, torch.where(known, edges, self.weight * mean))


@dataclass(frozen=True, eq=False)
class FieldLoss:
    """The two terms, scalars. A random field scores 1 in direction."""

    direction: Tensor
    magnitude: Tensor

    @property
    def total(self) -> Tensor:
        """Their sum, the paper's loss."""
        return self.direction + self.magnitude


def field_loss(output: FieldOutput, truth: FieldTruth) -> FieldLoss:
    """Compare a prediction with the truth.

    Returns
    -------
    FieldLoss
        direction: weighted mean of 1 - cos of N times the angle between them; magnitude: weighted
        mean of the relative error of the length, over the vertices whose length is known.
    """
    modulus = torch.sqrt(output.z.square().sum(dim=0) + EPSILON**2)
    cosine = (output.z * truth.z).sum(dim=0) / modulus
    total = truth.weight.sum().clamp(min=EPSILON)
    direction = (truth.weight * (1.0 - cosine)).sum() / total
    sized = torch.where(truth.size > 0, truth.weight, torch.zeros_like(truth.weight))
    relative = (output.size - truth.size).abs() / truth.size.clamp(min=EPSILON)
    magnitude = (sized * relative).sum() / sized.sum().clamp(min=EPSILON)
    return FieldLoss(direction, magnitude)

"""VectorHeatNet: the network of Gao et al. 2024, figure 3, on one screen.

features --in MLP--> X --[ diffusion at m times, vector MLP, + X ] x N--> out MLP --head--> z, size
"""

from __future__ import annotations

from dataclasses import dataclass

from torch import Tensor, nn

from vhquad.errors import ModelError
from vhquad.nn.diffusion import SpectralDiffusion
from vhquad.nn.heads import MixedHead, PaperHead
from vhquad.nn.inputs import NetworkInput
from vhquad.nn.layers import (
    LineReflection,
    MagnitudeReLU,
    VectorDropout,
    VectorLinear,
    VectorMLP,
)
from vhquad.nn.settings import ModelSettings

__all__ = ["DiffusionBlock", "FieldOutput", "VectorHeatNet"]


@dataclass(frozen=True, eq=False)
class FieldOutput:
    """What the network says at each vertex.

    Attributes
    ----------
    z : (2, n) Tensor
        N-th power of the direction in the vertex frame; only its argument has a meaning.
    size : (n,) Tensor
        Wanted length over the square root of the mesh's area.
    """

    z: Tensor
    size: Tensor

    def float(self) -> FieldOutput:
        """In single precision."""
        return FieldOutput(self.z.float(), self.size.float())


class DiffusionBlock(nn.Module):
    """X + MLP(diffused X); the MLP's first map is applied inside the diffusion.

    With lines, X is joined by its reflections at them first.
    """

    def __init__(self, settings: ModelSettings) -> None:
        super().__init__()
        c = settings.channels
        self.reflection = LineReflection(c, settings.in_lines) if settings.in_lines else None
        self.diffusion = SpectralDiffusion(c, c, settings.times, settings.keep_input)
        self.activation = MagnitudeReLU(c)
        self.dropout = VectorDropout(settings.dropout)
        self.mlp = VectorMLP([c] * (settings.hidden_layers + 1), settings.dropout, last_gain=0.5)

    def forward(self, x: Tensor, mesh: NetworkInput) -> Tensor:
        """(2, n, c) -> (2, n, c)."""
        if self.reflection is not None:
            x = self.reflection(x, mesh.lines)
        hidden = self.dropout(self.activation(self.diffusion(x, mesh)))
        out: Tensor = x + self.mlp(hidden)
        return out


class VectorHeatNet(nn.Module):
    """Tangent features of a mesh in, an N-RoSy field with lengths out."""

    def __init__(self, settings: ModelSettings) -> None:
        super().__init__()
        self.settings = settings
        c = settings.channels
        self.enter = VectorMLP([settings.in_channels, c, c], settings.dropout)
        self.blocks = nn.ModuleList(DiffusionBlock(settings) for _ in range(settings.blocks))
        self.leave = nn.Sequential(VectorLinear(c, c), MagnitudeReLU(c))
        self.head: PaperHead | MixedHead
        if settings.head == "paper":
            self.head = PaperHead(c, settings.order)
        else:
            self.head = MixedHead(c, settings.order, settings.head_terms, settings.in_lines)

    @property
    def n_parameters(self) -> int:
        """Number of learned real numbers."""
        return sum(p.numel() for p in self.parameters())

    def forward(self, mesh: NetworkInput) -> FieldOutput:
        """Predict the field of one mesh.

        Raises
        ------
        ModelError
            If the mesh was prepared with another number of eigenvectors, channels or lines.
        """
        own = self.settings
        k, c_in, lines = len(mesh.eigenvalues), mesh.features.shape[2], mesh.lines.shape[2]
        if (k, c_in, lines) != (own.k, own.in_channels, own.in_lines):
            raise ModelError(
                f"the model takes {own.k} eigenvectors, {own.in_channels} feature channels and "
                f"{own.in_lines} lines, the mesh comes with {k}, {c_in} and {lines}; prepare it "
                "again with the model's settings"
            )
        x = self.enter(mesh.features)
        for block in self.blocks:
            x = block(x, mesh)
        z, size = self.head(self.leave(x), mesh.lines)
        return FieldOutput(z, size)

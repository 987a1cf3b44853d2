"""NetworkInput: one mesh as the network sees it, tensors without units in two real halves."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import torch
from numpy.typing import ArrayLike, NDArray
from torch import Tensor

from vhquad.errors import ModelError

__all__ = ["NetworkInput", "network_input", "stack", "unstack"]


@dataclass(frozen=True, eq=False)
class NetworkInput:
    """Operators and features of one mesh, divided by its size.

    Scaling here, once, makes the network independent of units: areas become shares of the total
    area A, eigenvalues multiples of 4 pi / A.

    Attributes
    ----------
    basis : (n, 2k) Tensor
        Real, then imaginary parts of the eigenvectors times sqrt(A).
    weighted_basis : (n, 2k) Tensor
        The same times the vertex's share of the area.
    eigenvalues : (k,) Tensor
        Times A / 4 pi.
    features : (2, n, c) Tensor
    mass : (n,) Tensor
        Shares of the area; they sum to 1.
    length : float
        sqrt(A), in units of the mesh.
    """

    basis: Tensor
    weighted_basis: Tensor
    eigenvalues: Tensor
    features: Tensor
    mass: Tensor
    length: float

    def to(self, device: torch.device | str, dtype: torch.dtype | None = None) -> NetworkInput:
        """The same on another device or in another precision."""
        names = ("basis", "weighted_basis", "eigenvalues", "features", "mass")
        moved = {name: getattr(self, name).to(device=device, dtype=dtype) for name in names}
        return replace(self, **moved)

    def with_features(self, features: Tensor) -> NetworkInput:
        """The same operators with other features."""
        return replace(self, features=features)


def network_input(
    mass: ArrayLike,
    eigenvalues: ArrayLike,
    eigenvectors: ArrayLike,
    features: ArrayLike,
    dtype: torch.dtype = torch.float32,
) -> NetworkInput:
    """Make the network's input from a mesh's operators.

    Parameters
    ----------
    mass : (n,) array_like
        Vertex areas.
    eigenvalues : (k,) array_like
        Of the connection Laplacian (order 1), not negative.
    eigenvectors : (n, k) complex array_like
        Orthonormal with respect to ``mass``.
    features : (n, c) complex array_like
        Tangent vectors in the same frames, without units.

    Raises
    ------
    ModelError
        If the shapes do not fit each other.
    """
    m = np.asarray(mass, dtype=np.float64)
    values = np.asarray(eigenvalues, dtype=np.float64)
    phi, x = np.asarray(eigenvectors), np.asarray(features)
    if m.ndim != 1 or phi.shape != (len(m), len(values)) or x.ndim != 2 or len(x) != len(m):
        raise ModelError(
            f"operators do not fit: mass {m.shape}, eigenvalues {values.shape}, "
            f"eigenvectors {phi.shape}, features {x.shape}"
        )
    area = float(m.sum())
    if not area > 0:
        raise ModelError("the mesh has no area")
    length = math.sqrt(area)
    basis = np.concatenate([phi.real, phi.imag], axis=1) * length
    share = m / area
    return NetworkInput(
        basis=torch.as_tensor(basis, dtype=dtype),
        weighted_basis=torch.as_tensor(basis * share[:, None], dtype=dtype),
        eigenvalues=torch.as_tensor(values * area / (4.0 * math.pi), dtype=dtype),
        features=stack(x, dtype),
        mass=torch.as_tensor(share, dtype=dtype),
        length=length,
    )


def stack(values: ArrayLike, dtype: torch.dtype = torch.float32) -> Tensor:
    """Complex array of any shape as a real tensor (2, ...)."""
    v = np.asarray(values)
    return torch.as_tensor(np.stack([v.real, v.imag]), dtype=dtype)


def unstack(values: Tensor) -> NDArray[np.complex128]:
    """Real tensor (2, ...) as a complex128 array."""
    v = values.detach().cpu().double().numpy()
    return np.asarray(v[0] + 1j * v[1])

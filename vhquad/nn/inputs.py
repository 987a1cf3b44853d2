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
        Tangent vectors.
    lines : (2, n, l) Tensor
        Lines, e^(2ia); l may be 0.
    mass : (n,) Tensor
        Shares of the area; they sum to 1.
    length : float
        sqrt(A), in units of the mesh.
    """

    basis: Tensor
    weighted_basis: Tensor
    eigenvalues: Tensor
    features: Tensor
    lines: Tensor
    mass: Tensor
    length: float

    def to(self, device: torch.device | str, dtype: torch.dtype | None = None) -> NetworkInput:
        """The same on another device or in another precision."""
        names = ("basis", "weighted_basis", "eigenvalues", "features", "lines", "mass")
        moved = {name: getattr(self, name).to(device=device, dtype=dtype) for name in names}
        return replace(self, **moved)

    def low_precision(self) -> NetworkInput:
        """The same with the basis in bfloat16, for use under autocast."""
        basis, weighted = self.basis.bfloat16(), self.weighted_basis.bfloat16()
        return replace(self, basis=basis, weighted_basis=weighted)

    def mirror_image(self) -> NetworkInput:
        """The mirror image of the mesh, seen in the conjugate of its frames.

        Everything intrinsic is conjugate there, and real weights commute with that; only features
        that were turned by a right angle turn the other way. Hence the network, given this,
        answers the conjugate of what it would say of the mirror image: directly comparable, and
        nothing has to be built for it. Features are taken to hold turned copies if their second
        half is i times the first.
        """
        half = self.features.shape[2] // 2
        first, second = self.features[..., :half], self.features[..., half:]
        if first.shape != second.shape or not torch.allclose(
            second, torch.stack([-first[1], first[0]]), rtol=1e-4, atol=1e-6
        ):
            return self
        return replace(self, features=torch.cat([first, -second], dim=2))


def network_input(
    mass: ArrayLike,
    eigenvalues: ArrayLike,
    eigenvectors: ArrayLike,
    features: ArrayLike,
    lines: ArrayLike | None = None,
    dtype: torch.dtype = torch.float32,
    k: int | None = None,
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
    lines : (n, l) complex array_like, optional
        Lines, e^(2ia), in the same frames; none if not given.
    dtype : torch.dtype
        Precision of the result.
    k : int, optional
        Eigenvectors that the network wants. A mesh with fewer vertices than that has fewer; as its
        basis is complete, empty ones make up the number.

    Raises
    ------
    ModelError
        If the shapes do not fit each other.
    """
    m = np.asarray(mass, dtype=np.float64)
    values = np.asarray(eigenvalues, dtype=np.float64)
    phi, x = np.asarray(eigenvectors), np.asarray(features)
    q = np.zeros((len(x), 0), dtype=x.dtype) if lines is None else np.asarray(lines)
    if (
        m.ndim != 1
        or phi.shape != (len(m), len(values))
        or any(a.ndim != 2 or len(a) != len(m) for a in (x, q))
    ):
        raise ModelError(
            f"operators do not fit: mass {m.shape}, eigenvalues {values.shape}, "
            f"eigenvectors {phi.shape}, features {x.shape}, lines {q.shape}"
        )
    area = float(m.sum())
    if not area > 0:
        raise ModelError("the mesh has no area")
    length = math.sqrt(area)
    if k is not None and len(m) <= len(values) < k:
        empty = k - len(values)
        values = np.concatenate([values, np.zeros(empty)])
        phi = np.concatenate([phi, np.zeros((len(m), empty), dtype=phi.dtype)], axis=1)
    basis = np.concatenate([phi.real, phi.imag], axis=1) * length
    share = m / area
    return NetworkInput(
        basis=torch.as_tensor(basis, dtype=dtype),
        weighted_basis=torch.as_tensor(basis * share[:, None], dtype=dtype),
        eigenvalues=torch.as_tensor(values * area / (4.0 * math.pi), dtype=dtype),
        features=stack(x, dtype),
        lines=stack(q, dtype),
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

"""CrossField: one cross (four directions, 90 degrees apart) with a size at each vertex or face."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from vhquad.errors import FieldError

__all__ = ["SURE", "CrossField", "Domain"]

Domain = Literal["vertices", "faces"]

ROUNDING = 1e-15  # of a modulus of 1
SURE = 0.9  # confidence from which on directions count for more than even sizes and smoothness


@dataclass(frozen=True, eq=False)
class CrossField:
    """A cross field in the frames of ``vhquad.geometry.frames`` (conventions are said there).

    Attributes
    ----------
    domain : "vertices" or "faces"
        Where the crosses live, hence which frames ``z`` refers to.
    z : (n,) complex128
        Fourth power ``exp(4i a)`` of the unit directions, ``a`` the angle of any of the four in the
        element's frame. Unit modulus, or exactly 0 where no direction is known.
    size : (n,) float64 or None
        Edge length of the quads wanted there, in units of the mesh; None if the source has none.
    confidence : (n,) float64 or None
        Trust in each cross, in [0, 1]; None means 1 everywhere.
    """

    domain: Domain
    z: NDArray[np.complex128]
    size: NDArray[np.float64] | None = None
    confidence: NDArray[np.float64] | None = None

    def __post_init__(self) -> None:
        z = np.asarray(self.z, dtype=np.complex128)
        if z.ndim != 1:
            raise FieldError(f"z must have shape (n,), not {z.shape}")
        if not np.isfinite(z).all():
            bad = np.flatnonzero(~np.isfinite(z))
            raise FieldError(f"{len(bad)} crosses are NaN or infinite, the first at {bad[0]}")
        modulus = np.abs(z)
        # What is unit already stays to the bit, so that a field written and read again is the same.
        off = np.abs(modulus - 1.0) > ROUNDING
        z = np.divide(z, modulus, out=np.where(off, 0.0, z), where=off & (modulus > 0))
        object.__setattr__(self, "z", z)
        for name in ("size", "confidence"):
            value = getattr(self, name)
            if value is None:
                continue
            value = np.asarray(value, dtype=np.float64)
            if value.shape != z.shape:
                raise FieldError(f"{name} must have shape {z.shape}, not {value.shape}")
            if not np.isfinite(value).all() or (value < 0).any():
                raise FieldError(f"{name} must be finite and not negative")
            object.__setattr__(self, name, value)

    def __len__(self) -> int:
        return len(self.z)

    @property
    def trust(self) -> NDArray[np.float64]:
        """How far directions go before even sizes and smoothness, in [0, 1]; (n,).

        A field that does not say how sure it is earns none.
        """
        if self.confidence is None:
            return np.zeros(len(self))
        return np.clip((self.confidence - SURE) / (1.0 - SURE), 0.0, 1.0)

    @property
    def angle(self) -> NDArray[np.float64]:
        """Angle of one of the four directions in the element's frame, in (-pi/4, pi/4]; (n,)."""
        return np.asarray(np.angle(self.z) / 4.0)

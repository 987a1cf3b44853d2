"""MirrorPlane: heights above a plane, mirror images in it and nearest points on it, exactly."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vhquad.errors import MeshError

__all__ = ["MirrorPlane"]

Floats = NDArray[np.float64]

_AXES = "xyz"


@dataclass(frozen=True, eq=False)
class MirrorPlane:
    """The plane of points p with ``normal . p = offset``.

    Attributes
    ----------
    normal : (3,) float64
        Unit; of a plane across a coordinate axis exactly that axis, towards its positive side.
    offset : float
    """

    normal: Floats
    offset: float

    def __init__(self, normal: ArrayLike, offset: float) -> None:
        n = np.array(normal, dtype=np.float64)
        length = float(np.linalg.norm(n))
        if n.shape != (3,) or not np.isfinite(length) or length == 0 or not np.isfinite(offset):
            raise MeshError(f"a plane needs a normal of 3 numbers and an offset, not {n}, {offset}")
        n = n if np.count_nonzero(n) == 1 and n.max() == 1.0 else n / length
        n.flags.writeable = False
        object.__setattr__(self, "normal", n)
        object.__setattr__(self, "offset", float(offset))

    @property
    def axis(self) -> int | None:
        """0, 1 or 2 if the normal is exactly that coordinate axis, else None."""
        return int(self.normal.argmax()) if (np.sort(self.normal) == [0, 0, 1]).all() else None

    @property
    def name(self) -> str:
        """``x = 0``, or the equation of a plane that is not across an axis."""
        if self.axis is not None:
            return f"{_AXES[self.axis]} = {self.offset:.6g}"
        terms = " ".join(f"{n:+.4f} {a}" for n, a in zip(self.normal, _AXES, strict=True))
        return f"{terms} = {self.offset:.6g}"

    def height(self, points: Floats) -> Floats:
        """Signed distance of points (..., 3) from the plane, exact across a coordinate axis."""
        along = points @ self.normal if self.axis is None else points[..., self.axis]
        return np.asarray(along - self.offset)

    def reflect(self, points: Floats) -> Floats:
        """Mirror images of points (..., 3); across an axis with offset 0 only a sign changes."""
        if self.axis is None:
            return np.asarray(points - 2.0 * self.height(points)[..., None] * self.normal)
        image = np.array(points)
        image[..., self.axis] = 2.0 * self.offset - image[..., self.axis]
        return image

    def reflect_vectors(self, vectors: Floats) -> Floats:
        """Mirror images of directions (..., 3)."""
        along = np.asarray(vectors @ self.normal)
        return np.asarray(vectors - 2.0 * along[..., None] * self.normal)

    def project(self, points: Floats) -> Floats:
        """The nearest points (..., 3) of the plane."""
        if self.axis is None:
            once = points - self.height(points)[..., None] * self.normal
            return np.asarray(once - self.height(once)[..., None] * self.normal)
        image = np.array(points)
        image[..., self.axis] = self.offset
        return image

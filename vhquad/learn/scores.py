"""Figures that say how far fields are from the ground truth: losses, angles, sizes, calibration.

All are means over meshes of means over the surface, weighted by area times coherence. The spread is
the standard deviation over all vertices, weighted likewise, as in the paper's table. A random field
scores 1.0 and 22.5 degrees.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vhquad.errors import FieldError
from vhquad.field.cross import CrossField

__all__ = [
    "CalibrationBin",
    "EvaluationRow",
    "FieldErrors",
    "calibration",
    "compare",
    "evaluation_row",
]

Floats = NDArray[np.float64]

STEPS = (0.0, 0.05, 0.2, 0.5, 0.8, 1.0)  # of the confidence; 0 and 1 are bins of their own


@dataclass(frozen=True, eq=False)
class FieldErrors:
    """How far a field is from the truth at each vertex of one mesh.

    Attributes
    ----------
    weight : (n,) float64
        Area times coherence of the truth; sums to 1.
    cosine : (n,) float64
        cos of four times the angle between them; 0, as of a random field, where the field has no
        direction.
    ratio : (n,) float64 or None
        Size over true size, 0 where either is not known; None if the field has no sizes.
    """

    weight: Floats
    cosine: Floats
    ratio: Floats | None

    @property
    def angle(self) -> Floats:
        """Angle between the crosses in degrees, in [0, 45]; (n,)."""
        return np.asarray(np.degrees(np.arccos(self.cosine)) / 4.0)

    @property
    def direction(self) -> float:
        """The paper's direction loss."""
        return float(self.weight @ (1.0 - self.cosine))


@dataclass(frozen=True)
class EvaluationRow:
    """Figures of one method on one group of samples; those of sizes are None if it has none.

    Attributes
    ----------
    method, group : str
    meshes : int
    direction, direction_spread : float
        The paper's loss, mean of 1 - cos of four times the angle.
    magnitude, magnitude_spread : float or None
        The paper's loss, mean of the relative error of the size.
    mean_angle, median_angle, p95_angle : float
        Degrees.
    over_15 : float
        Share of the surface that is more than 15 degrees off.
    size_bias : float or None
        exp of the mean of log(size / true size), less 1: how much too large sizes are.
    size_spread : float or None
        Standard deviation of log(size / true size).
    """

    method: str
    group: str
    meshes: int
    direction: float
    direction_spread: float
    magnitude: float | None
    magnitude_spread: float | None
    mean_angle: float
    median_angle: float
    p95_angle: float
    over_15: float
    size_bias: float | None
    size_spread: float | None


@dataclass(frozen=True)
class CalibrationBin:
    """Direction losses where the stated confidence lies in (low, high], or is ``low == high``.

    Attributes
    ----------
    low, high : float
    share : float
        Of the surface.
    losses : dict of str to float
        Direction loss there, by method.
    """

    low: float
    high: float
    share: float
    losses: dict[str, float]


def compare(field: CrossField, truth: CrossField, mass: Floats) -> FieldErrors:
    """Errors of a field on vertices.

    Parameters
    ----------
    field : CrossField
    truth : CrossField
        Its confidence is the coherence; a zero cross is unknown.
    mass : (n,) float64
        Vertex areas.

    Raises
    ------
    FieldError
        If nothing of the truth is known.
    """
    coherence = np.ones(len(truth)) if truth.confidence is None else truth.confidence
    weight = mass * coherence * (truth.z != 0)
    if not weight.sum() > 0:
        raise FieldError("the ground truth is empty: no vertex has a direction")
    weight = weight / weight.sum()
    cosine = (field.z * truth.z.conj()).real.clip(-1.0, 1.0)
    ratio = None
    if field.size is not None and truth.size is not None:
        ratio = np.divide(field.size, truth.size, out=np.zeros(len(truth)), where=truth.size > 0)
    return FieldErrors(weight, cosine, ratio)


def evaluation_row(method: str, group: str, errors: Sequence[FieldErrors]) -> EvaluationRow:
    """The figures of one method over a group of meshes."""
    weight = np.concatenate([e.weight for e in errors]) / len(errors)
    direction, spread = _moments(1.0 - np.concatenate([e.cosine for e in errors]), weight)
    angle = np.concatenate([e.angle for e in errors])
    order = np.argsort(angle)
    below = np.cumsum(weight[order])
    last = len(order) - 1
    at = [min(int(np.searchsorted(below, q)), last) for q in (0.5, 0.95)]
    median, p95 = (float(a) for a in angle[order][at])
    magnitude = magnitude_spread = bias = size_spread = None
    ratios = [e.ratio for e in errors if e.ratio is not None]
    if len(ratios) == len(errors):
        ratio = np.concatenate(ratios)
        known = (ratio > 0) & (weight > 0)
        if known.any():
            sized = weight[known] / weight[known].sum()
            magnitude, magnitude_spread = _moments(np.abs(ratio[known] - 1.0), sized)
            mean, size_spread = _moments(np.log(ratio[known]), sized)
            bias = math.expm1(mean)
    return EvaluationRow(
        method=method,
        group=group,
        meshes=len(errors),
        direction=direction,
        direction_spread=spread,
        magnitude=magnitude,
        magnitude_spread=magnitude_spread,
        mean_angle=float(weight @ angle),
        median_angle=median,
        p95_angle=p95,
        over_15=float(weight[angle > 15.0].sum()),
        size_bias=bias,
        size_spread=size_spread,
    )


def calibration(
    confidence: Sequence[Floats], errors: dict[str, Sequence[FieldErrors]]
) -> tuple[CalibrationBin, ...]:
    """Direction losses by stated confidence; bins that hold nothing are left out.

    Parameters
    ----------
    confidence : list of (n,) float64
        Of each mesh, in [0, 1].
    errors : dict of str to list of FieldErrors
        By method, of the same meshes.
    """
    stated = np.concatenate(confidence)
    place = np.searchsorted(STEPS, stated, side="left")  # 0: none; i: in (STEPS[i-1], STEPS[i]]
    place[stated >= 1.0] = len(STEPS)
    count = len(confidence)
    weight = np.concatenate([e.weight for e in next(iter(errors.values()))]) / count
    loss = {m: np.concatenate([1.0 - e.cosine for e in found]) for m, found in errors.items()}
    bins = []
    for i in range(len(STEPS) + 1):
        inside = place == i
        share = float(weight[inside].sum())
        if share > 0:
            low, high = STEPS[max(i - 1, 0)], STEPS[min(i, len(STEPS) - 1)]
            losses = {m: float(weight[inside] @ loss[m][inside]) / share for m in loss}
            bins.append(CalibrationBin(low, high, share, losses))
    return tuple(bins)


def _moments(values: Floats, weight: Floats) -> tuple[float, float]:
    mean = float(weight @ values)
    return mean, math.sqrt(float(weight @ (values - mean) ** 2))

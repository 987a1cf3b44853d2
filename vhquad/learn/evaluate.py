"""Measure a model on a dataset's split: the paper's two losses, angles, and baselines beside it.

All figures are means over meshes of means over the surface, weighted by area times coherence, in
groups by the samples' variant ("whole", "cropped", ...). The spread is the standard deviation over
all vertices, weighted likewise, as in the paper's table. A random field scores 1.0 and
22.5 degrees. "model" is the network alone, "model + curvature" what `vhquad predict` answers.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vhquad.errors import DatasetError
from vhquad.field.cross import CrossField
from vhquad.learn.baselines import LENGTHS, curvature_aligned, principal, random_field
from vhquad.learn.blend import lean_on_curvature
from vhquad.learn.confidence import confidence
from vhquad.learn.dataset import Split, open_dataset
from vhquad.learn.device import choose_device
from vhquad.learn.predict import predict_input
from vhquad.mesh.triangle import TriMesh
from vhquad.nn.checkpoint import Model, load_model

__all__ = ["EvaluationRow", "compare", "evaluate"]

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class EvaluationRow:
    """Figures of one method on one group of samples; angles in degrees.

    ``magnitude`` is None for methods that predict no size.
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

    def to_dict(self) -> dict[str, Any]:
        """As plain JSON values."""
        return asdict(self)


@dataclass(frozen=True, eq=False)
class _Errors:
    weight: Floats  # sums to 1
    cosine: Floats
    relative_size: Floats | None


def evaluate(
    model: Model | Path | str | None,
    datasets: Path | str | Sequence[Path | str],
    split: Split = "test",
    baselines: bool = True,
    device: str = "auto",
    on_sample: Callable[[int, int], None] | None = None,
) -> list[EvaluationRow]:
    """Compare a model, and the baselines, with the ground truth of a split.

    Parameters
    ----------
    model : Model or path, optional
        The shipped one if None.
    datasets : path or list of paths
    split : "train", "val" or "test"
    baselines : bool
        Whether to measure the blend with curvature, and random, principal and curvature-aligned
        fields too. Of the latter's smoothing lengths the best on these very samples is kept.
    device : str
    on_sample : callable, optional
        Called with (samples done, samples).

    Returns
    -------
    list of EvaluationRow

    Raises
    ------
    DatasetError
        If the split is empty, or was prepared otherwise than the model needs.
    """
    chosen = model if isinstance(model, Model) else load_model(model)
    target = choose_device(device)
    network = chosen.network.to(target)
    paths = [datasets] if isinstance(datasets, (str, Path)) else list(datasets)
    items = [(d, e) for d in map(open_dataset, paths) for e in d.split(split)]
    if not items:
        raise DatasetError(f"no sample with ground truth is in the {split} split")
    errors: dict[str, list[tuple[str, _Errors]]] = {}
    for place, (dataset, entry) in enumerate(items):
        if (dataset.features, dataset.turned, dataset.k) != (
            chosen.settings.features,
            chosen.settings.turned,
            chosen.settings.k,
        ):
            raise DatasetError(
                f"{dataset.folder} was prepared with other features than the model's"
            )
        answer = predict_input(network, dataset.load(entry).input.to(target))
        fields = {"model": CrossField("vertices", answer.z, answer.size)}
        if baselines:
            mesh = dataset.mesh(entry)
            trust = confidence(mesh, answer.agreement)
            predicted = CrossField("vertices", answer.z, answer.size, trust)
            fields["model + curvature"] = lean_on_curvature(mesh, predicted)
            fields |= _baselines(mesh, place)
        truth, mass = dataset.truth_field(entry), dataset.archive(entry)["mass"]
        for method, field in fields.items():
            errors.setdefault(method, []).append((entry.variant, compare(field, truth, mass)))
        if on_sample is not None:
            on_sample(place + 1, len(items))
    rows = []
    for method, found in _best_length(errors).items():
        for group in sorted({variant for variant, _ in found}):
            rows.append(_row(method, group, [e for variant, e in found if variant == group]))
    return rows


def compare(field: CrossField, truth: CrossField, mass: Floats) -> _Errors:
    """Errors of a field at each vertex, with weights; where it has no direction, as random."""
    coherence = np.ones(len(truth)) if truth.confidence is None else truth.confidence
    weight = mass * coherence * (truth.z != 0)
    weight = weight / weight.sum()
    cosine = (field.z * truth.z.conj()).real.clip(-1.0, 1.0)
    relative = None
    if field.size is not None and truth.size is not None:
        known = truth.size > 0
        relative = np.zeros(len(truth))
        relative[known] = np.abs(field.size - truth.size)[known] / truth.size[known]
    return _Errors(weight, cosine, relative)


def _baselines(mesh: TriMesh, seed: int) -> dict[str, CrossField]:
    aligned = zip(LENGTHS, curvature_aligned(mesh), strict=True)
    return {
        "random": random_field(mesh, np.random.default_rng(seed)),
        "principal": principal(mesh),
        **{f"curvature-aligned {length}": field for length, field in aligned},
    }


def _best_length(
    errors: dict[str, list[tuple[str, _Errors]]],
) -> dict[str, list[tuple[str, _Errors]]]:
    """Keep the smoothing length with the least direction loss over everything."""
    tried = {m: found for m, found in errors.items() if m.startswith("curvature-aligned")}
    kept = {m: found for m, found in errors.items() if m not in tried}
    if tried:
        best = min(
            tried, key=lambda m: float(np.mean([e.weight @ (1 - e.cosine) for _, e in tried[m]]))
        )
        kept[best] = tried[best]
    return kept


def _row(method: str, group: str, errors: list[_Errors]) -> EvaluationRow:
    weight = np.concatenate([e.weight for e in errors]) / len(errors)
    cosine = np.concatenate([e.cosine for e in errors])
    direction, spread = _moments(1.0 - cosine, weight)
    angle = np.degrees(np.arccos(cosine)) / 4.0
    order = np.argsort(angle)
    below = np.cumsum(weight[order])
    last = len(order) - 1
    at = [min(int(np.searchsorted(below, q)), last) for q in (0.5, 0.95)]
    median, p95 = (float(a) for a in angle[order][at])
    magnitude = magnitude_spread = None
    if all(e.relative_size is not None for e in errors):
        relative = np.concatenate([e.relative_size for e in errors if e.relative_size is not None])
        magnitude, magnitude_spread = _moments(relative, weight)
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
    )


def _moments(values: Floats, weight: Floats) -> tuple[float, float]:
    mean = float(weight @ values)
    return mean, math.sqrt(float(weight @ (values - mean) ** 2))

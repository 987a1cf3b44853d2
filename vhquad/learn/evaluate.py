"""Measure a model on a dataset's split, with baselines beside it.

"model" is the network alone, "model + curvature" what ``vhquad predict`` answers; "curvature" is
``--method curvature``. These two and the ground truth are measured as a remesh smooths them, too.
What the figures mean: :mod:`vhquad.learn.scores`, :mod:`vhquad.learn.polished` and
:mod:`vhquad.learn.singularities`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from vhquad.errors import DatasetError, ModelError
from vhquad.field.cross import CrossField
from vhquad.learn.baselines import curvature, principal, random_field
from vhquad.learn.blend import lean_on_curvature
from vhquad.learn.confidence import confidence
from vhquad.learn.dataset import Dataset, SampleEntry, Split, open_dataset
from vhquad.learn.device import choose_device
from vhquad.learn.maps import draw_error_map
from vhquad.learn.polished import compare_polished, polished
from vhquad.learn.predict import predict_input
from vhquad.learn.scores import (
    CalibrationBin,
    EvaluationRow,
    FieldErrors,
    calibration,
    compare,
    evaluation_row,
)
from vhquad.learn.singularities import (
    ArtistsPoints,
    SingularityRow,
    SingularPoints,
    artists,
    singular_points,
    singularity_row,
)
from vhquad.learn.train import check_fit
from vhquad.mesh.triangle import TriMesh
from vhquad.nn.checkpoint import Model, load_model
from vhquad.picture import check_viz
from vhquad.report import versions

__all__ = ["ALL", "ANSWER", "Evaluation", "SampleScore", "evaluate"]

SPLITS: tuple[Split, ...] = ("train", "val", "test")
MODEL, ANSWER, CURVATURE = "model", "model + curvature", "curvature"
ARTIST = "ground truth"
ALL = "all"


@dataclass(frozen=True)
class SampleScore:
    """Losses on one sample, by method; magnitudes of those that have sizes.

    ``polished`` are direction losses after the smoothing that a remesh applies.
    """

    name: str
    shape: str
    variant: str
    split: str
    vertices: int
    direction: dict[str, float]
    magnitude: dict[str, float]
    polished: dict[str, float]


@dataclass(frozen=True)
class Evaluation:
    """What :func:`evaluate` found.

    Attributes
    ----------
    split : str
    rows : tuple of EvaluationRow
        A row for each method and group: all samples together, then each variant ("whole",
        "cropped" ...) if there are several.
    polished : tuple of EvaluationRow
        Likewise, after the smoothing that a remesh applies; "ground truth" is what that leaves of
        the artist's field itself.
    singularities : tuple of SingularityRow
        Likewise, after that smoothing.
    calibration : tuple of CalibrationBin
        Direction losses by stated confidence.
    samples : tuple of SampleScore
    versions : dict of str to str
        Of this package and the libraries that decide the result.
    """

    split: str
    rows: tuple[EvaluationRow, ...]
    polished: tuple[EvaluationRow, ...]
    singularities: tuple[SingularityRow, ...]
    calibration: tuple[CalibrationBin, ...]
    samples: tuple[SampleScore, ...]
    versions: dict[str, str] = field(default_factory=versions)

    def row(self, method: str, group: str = ALL) -> EvaluationRow:
        """The row of a method and group; KeyError if there is none."""
        return {(row.method, row.group): row for row in self.rows}[method, group]


@dataclass(frozen=True, eq=False)
class _Measured:
    entry: SampleEntry
    errors: dict[str, FieldErrors]
    polished: dict[str, FieldErrors]
    confidence: NDArray[np.float64]
    singular: dict[str, SingularPoints | None]
    artists: ArtistsPoints


def evaluate(
    model: Model | Path | str | None,
    datasets: Path | str | Sequence[Path | str],
    split: Split | Literal["all"] = "test",
    device: str = "auto",
    maps: Path | str | None = None,
    on_sample: Callable[[int, int], None] | None = None,
) -> Evaluation:
    """Compare a model, and the baselines, with the ground truth of a split.

    Parameters
    ----------
    model : Model or path, optional
        The shipped one if None.
    datasets : path or list of paths
        Prepared with the model's features and number of eigenvectors.
    split : "train", "val", "test" or "all"
    device : str
    maps : path, optional
        A folder for pictures of the errors, a PNG file a sample.
    on_sample : callable, optional
        Called with (samples done, samples).

    Returns
    -------
    Evaluation

    Raises
    ------
    DatasetError
        If the split is empty, or was prepared otherwise than the model needs.
    ModelError
        If the model cannot be read or does not predict crosses.
    ConfigError
        If the device does not exist, or maps are wanted without the extra viz.
    """
    if maps is not None:
        check_viz()
    chosen = model if isinstance(model, Model) else load_model(model)
    if chosen.settings.order != 4:
        raise ModelError(f"only crosses can be evaluated, not order {chosen.settings.order}")
    paths = [datasets] if isinstance(datasets, (str, Path)) else list(datasets)
    opened = [open_dataset(path) for path in paths]
    items = _items(opened, split)
    for dataset in opened:
        check_fit(chosen.settings, dataset)
    target = choose_device(device)
    network = chosen.network.to(target)
    found = []
    for place, (dataset, entry) in enumerate(items):
        mesh, truth = dataset.mesh(entry), dataset.truth_field(entry)
        answer = predict_input(network, dataset.load(entry).input.to(target))
        trust = confidence(mesh, answer.agreement)
        predicted = CrossField("vertices", answer.z, answer.size, trust)
        fields = {
            MODEL: predicted,
            ANSWER: lean_on_curvature(mesh, predicted),
            CURVATURE: curvature(mesh),
            "principal": principal(mesh),
            "random": random_field(mesh, np.random.default_rng(place)),
        }
        measured = _measure(entry, mesh, fields, truth, dataset.archive(entry)["mass"])
        found.append(measured)
        if maps is not None:
            path = Path(maps) / f"{entry.name}.png"
            errors = {name: measured.errors[name] for name in (ANSWER, CURVATURE)}
            draw_error_map(path, mesh, errors, trust)
        if on_sample is not None:
            on_sample(place + 1, len(items))
    return _summary(split, found)


def _items(datasets: list[Dataset], split: str) -> list[tuple[Dataset, SampleEntry]]:
    names = SPLITS if split == ALL else tuple(name for name in SPLITS if name == split)
    items = [(d, entry) for d in datasets for name in names for entry in d.split(name)]
    if not items:
        counts = {name: sum(len(d.split(name)) for d in datasets) for name in SPLITS}
        there = ", ".join(f"{count} in {name}" for name, count in counts.items() if count)
        raise DatasetError(
            f"no sample with ground truth is in the {split} split ({there or 'nor in any other'})"
        )
    return items


def _measure(
    entry: SampleEntry,
    mesh: TriMesh,
    fields: dict[str, CrossField],
    truth: CrossField,
    mass: NDArray[np.float64],
) -> _Measured:
    trust = fields[MODEL].confidence
    assert trust is not None
    wanted = artists(mesh, truth)
    after: dict[str, FieldErrors] = {}
    singular: dict[str, SingularPoints | None] = {}
    remeshed = {ANSWER: fields[ANSWER], CURVATURE: fields[CURVATURE], ARTIST: truth}
    for method, given in remeshed.items():
        aligned = polished(mesh, given, wanted.edge_length)
        singular[method] = None if aligned is None else singular_points(aligned)
        errors = None if aligned is None else compare_polished(aligned, mesh, truth)
        if errors is not None:
            after[method] = errors
    return _Measured(
        entry=entry,
        errors={method: compare(field, truth, mass) for method, field in fields.items()},
        polished=after,
        confidence=trust,
        singular=singular,
        artists=wanted,
    )


def _summary(split: str, found: list[_Measured]) -> Evaluation:
    variants = sorted({measured.entry.variant for measured in found})
    groups = {ALL: found}
    if len(variants) > 1:
        groups |= {v: [m for m in found if m.entry.variant == v] for v in variants}
    rows, polished_rows, singularities = [], [], []
    for group, members in groups.items():
        for method in found[0].errors:
            rows.append(evaluation_row(method, group, [m.errors[method] for m in members]))
        for method in found[0].singular:
            after = [m.polished[method] for m in members if method in m.polished]
            if after:
                polished_rows.append(evaluation_row(method, group, after))
            pairs = [(m.singular[method], m.artists) for m in members]
            singularities.append(singularity_row(method, group, pairs))
    binned = calibration(
        [m.confidence for m in found],
        {name: [m.errors[name] for m in found] for name in (MODEL, CURVATURE, ANSWER)},
    )
    samples = tuple(_score(measured) for measured in found)
    return Evaluation(
        split, tuple(rows), tuple(polished_rows), tuple(singularities), binned, samples
    )


def _score(measured: _Measured) -> SampleScore:
    entry = measured.entry
    rows = {m: evaluation_row(m, entry.name, [e]) for m, e in measured.errors.items()}
    return SampleScore(
        name=entry.name,
        shape=entry.shape,
        variant=entry.variant,
        split=entry.split,
        vertices=entry.vertices,
        direction={method: row.direction for method, row in rows.items()},
        magnitude={m: row.magnitude for m, row in rows.items() if row.magnitude is not None},
        polished={method: errors.direction for method, errors in measured.polished.items()},
    )

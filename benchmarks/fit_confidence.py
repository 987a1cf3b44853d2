"""Fit the constants of the confidence to a model: how far agreement with the mirror image is trust.

    python benchmarks/fit_confidence.py RUN dataset/ another/ --split val

Takes samples that training did not see, of shapes like and unlike those that it saw. Tries
constants on a grid, blends prediction and curvature-aligned field by them, prints the best: whose
loss, in ratio to the better of the two fields alone, is least on average over the groups of samples
(heads by variant, numbered shapes of a set together, others one by one), with no group much worse
than by the better field. Write them into ``vhquad/learn/confidence.py``, then measure with ``vhquad
evaluate`` on the test split.
"""

from __future__ import annotations

import argparse
import itertools
import re
import sys
from collections import defaultdict
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vhquad.geometry.delaunay import intrinsic_delaunay
from vhquad.geometry.frames import build_frames
from vhquad.geometry.laplacian import cotan_laplacian, diffuse, lumped_mass
from vhquad.learn.baselines import curvature
from vhquad.learn.confidence import LENGTH
from vhquad.learn.dataset import Dataset, SampleEntry, open_dataset
from vhquad.learn.predict import predict_input
from vhquad.nn.checkpoint import load_model
from vhquad.nn.network import VectorHeatNet

SHAPE = (0.0, 0.3, 0.5, 0.7)
NONE = (0.2, 0.4, 0.5, 0.6, 0.7, 0.8)
FULL = (0.85, 0.9, 0.95, 0.98)
POWER = (1, 2, 3)
NUMBER = re.compile(r"_\d{4}$")  # of a shape in a set that examples/ makes
DRAWN = 500  # vertices a sample, by weight
WORST = 0.5  # how much the worst group counts beside the mean

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]
Constants = tuple[float, float, float, int]


@dataclass(frozen=True, eq=False)
class Drawn:
    """Some vertices of one sample: unit crosses, the share of curvature, levels of agreement."""

    group: str
    model: Complexes
    other: Complexes
    truth: Complexes
    mean: float
    near: Floats

    def blended(self, constants: Constants) -> Complexes:
        """The blend of the two fields, as ``vhquad.learn.blend`` does it."""
        shape, none, full, power = constants
        level = shape * self.mean + (1.0 - shape) * self.near
        c = np.clip((level - none) / (full - none), 0.0, 1.0) ** power
        return np.asarray(c * self.model + (1.0 - c) * self.other)

    def loss(self, field: Complexes) -> float:
        """1 - cos of four times the angle, on average."""
        return float(1.0 - (_unit(field) * self.truth.conj()).real.mean())


def group(entry: SampleEntry) -> str:
    """Heads by variant, numbered shapes of other sets together, any other shape by itself."""
    kind = NUMBER.sub("", entry.shape)
    return f"{kind}, {entry.variant.split('+')[-1]}" if kind == "head" else kind


def draw(network: VectorHeatNet, dataset: Dataset, entry: SampleEntry) -> Drawn:
    """Predict one sample."""
    mesh, truth = dataset.mesh(entry), dataset.truth_field(entry)
    answer, other = predict_input(network, dataset.load(entry).input), curvature(mesh)
    tri = intrinsic_delaunay(mesh, build_frames(mesh))
    mass = lumped_mass(tri)
    near = diffuse(cotan_laplacian(tri), mass, LENGTH**2 * mass.sum(), answer.agreement)
    weight = mass * (1.0 if truth.confidence is None else truth.confidence)
    chosen = np.random.default_rng(0).choice(len(mass), DRAWN, p=weight / weight.sum())
    k = np.ones(len(mass)) if other.confidence is None else other.confidence
    return Drawn(
        group=group(entry),
        model=_unit(answer.z)[chosen],
        other=(k * _unit(other.z))[chosen],
        truth=_unit(truth.z)[chosen],
        mean=float(mass @ answer.agreement / mass.sum()),
        near=near[chosen],
    )


def ratios(samples: list[Drawn], constants: Constants) -> dict[str, tuple[float, float, float]]:
    """Losses of the model, the other field and the blend by group."""
    found = defaultdict(list)
    for s in samples:
        found[s.group].append((s.loss(s.model), s.loss(s.other), s.loss(s.blended(constants))))
    return {group: tuple(np.mean(losses, axis=0)) for group, losses in sorted(found.items())}


def cost(samples: list[Drawn], constants: Constants) -> float:
    """What the best constants make least."""
    ratio = np.array([b / min(m, o) for m, o, b in ratios(samples, constants).values()])
    return float(ratio.mean() + WORST * max(ratio.max() - 1.0, 0.0))


def _unit(z: Complexes) -> Complexes:
    modulus = np.abs(z)
    return np.divide(z, modulus, out=np.zeros_like(z), where=modulus > 0)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("model", help="a run's folder or a model")
    parser.add_argument("datasets", nargs="+")
    parser.add_argument("--split", default="val", choices=("train", "val", "test"))
    parser.add_argument("--without", nargs="*", default=[], help="shapes to leave out")
    arguments = parser.parse_args()
    network = load_model(arguments.model).network
    samples = [
        draw(network, dataset, entry)
        for dataset in map(open_dataset, arguments.datasets)
        for entry in dataset.split(arguments.split)
        if entry.shape not in arguments.without
    ]
    grid = itertools.product(SHAPE, NONE, FULL, POWER)
    ranked = sorted((cost(samples, constants), constants) for constants in grid)
    out = sys.stdout.write
    out("cost   SHAPE NONE FULL POWER\n")
    for value, (shape, none, full, power) in ranked[:5]:
        out(f"{value:.3f}  {shape:5} {none:4} {full:4} {power:5}\n")
    out("\nmodel  curvature  blend   by the first\n")
    for group, (own, other, blend) in ratios(samples, ranked[0][1]).items():
        out(f"{own:.3f}  {other:9.3f}  {blend:.3f}   {group}\n")


if __name__ == "__main__":
    main()

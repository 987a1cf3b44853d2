"""What the input features and the parts of the network are worth: the same small budget for each.

    python examples/make_heads.py heads/ --count 75
    python benchmarks/ablation.py heads/ --out benchmarks/ablation

Heads are prepared once, small (about 1,500 vertices, a whole and a varied sample each); every
variant then sees the same meshes with its own features, is trained with each seed from nothing, and
is judged on heads that no training saw. "features" are the paper's ablation (gradients of the heat
kernel signature, of Gaussian and of mean curvature; principal curvature directions) and the
features that ship, all with one network; the other variants change one thing about that network
with the shipped features. Writes OUT.md; what is trained already (below --work) is kept.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch

from vhquad.atomic import write_atomic
from vhquad.learn.dataset import Dataset, SampleEntry, open_dataset, write_index, write_sample
from vhquad.learn.preprocess import PreprocessSettings, preprocess
from vhquad.learn.samples import operator_arrays
from vhquad.learn.schedule import TrainSettings
from vhquad.learn.train import train
from vhquad.nn.checkpoint import load_model
from vhquad.nn.loss import field_loss
from vhquad.nn.settings import preset

VERTICES = (1200, 1800)
BASE = replace(preset("starter"), channels=64)
SHIPPED = "local"


@dataclass(frozen=True)
class Variant:
    """One row of the table: what differs from the base."""

    name: str
    features: str = SHIPPED
    turned: bool = True
    model: dict[str, Any] = field(default_factory=dict)
    training: dict[str, Any] = field(default_factory=dict)


FEATURES = (
    Variant("gradient of the heat kernel signature", "hks"),
    Variant("gradient of Gaussian curvature", "gaussian"),
    Variant("gradient of mean curvature", "mean"),
    Variant("principal curvature directions", "pcd"),
    Variant("local: curvatures over six radii, their gradients and lines (shipped)"),
)
PARTS = (
    Variant("128 channels (shipped)", model={"channels": 128}),
    Variant("two blocks", model={"blocks": 2}),
    Variant("six blocks", model={"blocks": 6}),
    Variant("one diffusion time a block", model={"times": 1}),
    Variant("two hidden layers a block", model={"hidden_layers": 2}),
    Variant("no undiffused input to a block", model={"keep_input": False}),
    Variant("the paper's head", model={"head": "paper", "head_terms": 0}),
    Variant("no copies turned by a right angle", turned=False),
    Variant("no averaged weights", training={"ema": 0.0}),
    Variant("no mirrored meshes", training={"mirror": False}),
    Variant("half the peak rate", training={"rate": 5e-4}),
    Variant("twice the peak rate", training={"rate": 2e-3}),
)


def with_features(base: Dataset, features: str, turned: bool, out: Path) -> Dataset:
    """The same samples with other inputs."""
    if (out / "index.json").exists():
        return open_dataset(out)
    settings = PreprocessSettings(features=features, turned=turned, k=base.k)
    (out / "samples").mkdir(parents=True, exist_ok=True)
    channels, lines = 0, 0
    for entry in base.samples:
        own = operator_arrays(base.mesh(entry), settings, keep=False)
        channels, lines = own["features"].shape[1], own["lines"].shape[1]
        write_sample(out, entry.name, base.archive(entry) | own)
    made = replace(
        base,
        folder=out,
        features=features,
        turned=turned,
        in_channels=channels,
        in_lines=lines,
    )
    write_index(made)
    return made


def losses(model: Path, dataset: Dataset, entries: list[SampleEntry]) -> tuple[float, float]:
    """Mean direction and magnitude loss of a model over some samples."""
    network = load_model(model).network
    found = []
    with torch.no_grad():
        for entry in entries:
            sample = dataset.load(entry)
            assert sample.truth is not None
            loss = field_loss(network(sample.input), sample.truth)
            found.append((float(loss.direction), float(loss.magnitude)))
    direction, magnitude = np.mean(found, axis=0)
    return float(direction), float(magnitude)


def measure(
    variant: Variant, dataset: Dataset, work: Path, steps: int, seed: int
) -> tuple[float, float]:
    """Train one variant with one seed, and its losses on the test split."""
    run = work / f"{variant.name.split(' (')[0].replace(' ', '_').replace(':', '')}_{seed}"
    kept = run / "test.json"
    if kept.exists():
        direction, magnitude = json.loads(kept.read_text())
        return direction, magnitude
    chosen = {"steps": steps, "seed": seed, "validate_every": steps, "weigh": "area"}
    chosen |= variant.training
    settings = TrainSettings(**chosen)
    resume = (run / "checkpoint.safetensors").exists()
    train(dataset.folder, run, settings, replace(BASE, **variant.model), resume=resume)
    found = losses(run / "model.safetensors", dataset, list(dataset.split("test")))
    write_atomic(kept, json.dumps(found))
    return found


def row(variant: Variant, found: list[tuple[float, float]]) -> str:
    """Means, with the range over the seeds."""
    cells = []
    for values in zip(*found, strict=True):
        low, high = min(values), max(values)
        spread = f" ({low:.3f} to {high:.3f})" if len(found) > 1 else ""
        cells.append(f"{np.mean(values):.3f}{spread}")
    return f"| {variant.name} | " + " | ".join(cells) + " |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, help="quad meshes, with a split.json")
    parser.add_argument("--steps", type=int, default=1000, help="of each training (1000)")
    parser.add_argument("--seeds", type=int, default=3, help="trainings of each variant (3)")
    parser.add_argument("--only", choices=("features", "parts"), help="one of the two tables")
    parser.add_argument("--work", type=Path, default=Path("ablation"), help="datasets and runs")
    parser.add_argument("--out", type=Path, required=True, help="stem of the .md file")
    options = parser.parse_args()
    settings = PreprocessSettings(triangulations=2, vertices=VERTICES, features=SHIPPED, val=0.0)
    base = preprocess(options.folder, options.work / SHIPPED, settings)
    count = {name: len(base.split(name)) for name in ("train", "test")}
    lines = [
        f"`python benchmarks/ablation.py {options.folder.name}/ --steps {options.steps} "
        f"--seeds {options.seeds} --out benchmarks/{options.out.name}`",
        "",
        f"{options.steps:,} steps from nothing on {count['train']} samples of heads, "
        f"{BASE.channels} channels unless said otherwise; losses on {count['test']} samples of "
        f"other heads, the mean and range of {options.seeds} seeds. A random field scores 1 in "
        "direction. The shipped model was trained many times as long: ranks, not figures, carry "
        "over.",
    ]
    tables = {"features": FEATURES, "parts": (FEATURES[-1], *PARTS)}
    for title, variants in tables.items():
        if options.only not in (None, title):
            continue
        lines += ["", f"| {title} | direction | magnitude |", "|---|---|---|"]
        for variant in variants:
            place = options.work / (variant.features + ("" if variant.turned else "_plain"))
            dataset = with_features(base, variant.features, variant.turned, place)
            runs = options.work / "runs"
            found = [
                measure(variant, dataset, runs, options.steps, seed)
                for seed in range(options.seeds)
            ]
            lines.append(row(variant, found))
            print(lines[-1], flush=True)
    write_atomic(options.out.with_suffix(".md"), "\n".join(lines) + "\n")


if __name__ == "__main__":
    main()

"""A test set of heads without a neck and of face masks, for ``vhquad evaluate``.

    python examples/make_heads.py quads/ --count 300
    python benchmarks/head_crops.py quads/ crops/ --count 24
    vhquad evaluate default crops/

Takes the first heads of the test split as ``examples/make_heads.py`` draws them (z up, y to the
back). "neck": what lies below a plane across the neck, 15 to 24 % up, is cut off. "mask": besides,
all but the front 40 to 50 % of the depth. Planes are tilted by about seven degrees at random.
"""

from __future__ import annotations

import argparse
import hashlib
import json
from functools import partial
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from vhquad.learn.dataset import Dataset, SampleEntry, write_index, write_sample
from vhquad.learn.samples import PreprocessSettings, operator_arrays, truth_arrays
from vhquad.learn.sources import read_source
from vhquad.learn.targets import leak, make_target

KINDS = ("neck", "mask")
VERTICES = (1800, 4200)

Floats = NDArray[np.float64]


def crop(vertices: Floats, areas: Floats, kind: str, rng: np.random.Generator) -> Floats:
    """What is below 0 is cut off; the heights are in units of the bounding box."""
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    x = (vertices - low) / (high - low) - 0.5
    up = np.array([0.0, 0.0, 1.0]) + 0.12 * rng.standard_normal(3)
    neck = x @ up - (rng.uniform(0.15, 0.24) - 0.5)
    if kind == "neck":
        return np.asarray(neck)
    front = np.array([0.0, -1.0, 0.0]) + 0.12 * rng.standard_normal(3)
    return np.minimum(neck, x @ front - (0.5 - rng.uniform(0.4, 0.5)))


def make_sample(path: Path, kind: str, out: Path, settings: PreprocessSettings) -> SampleEntry:
    """Write one sample."""
    name = f"{path.stem}.{kind}"
    rng = np.random.default_rng(int(hashlib.sha256(name.encode()).hexdigest()[:12], 16))
    (part,) = read_source(path)
    if part.vertices is None or part.quads is None:
        raise SystemExit(f"{path} holds no quads")
    count = round(float(np.exp(rng.uniform(*np.log(VERTICES)))))
    made = make_target(part.vertices, part.quads, count, rng, partial(crop, kind=kind, rng=rng))
    entry = SampleEntry(
        name=name,
        shape=path.stem,
        source=path.name,
        split="test",
        truth=True,
        vertices=made.mesh.n_vertices,
        leak=round(leak(made.mesh, made.field), 6),
        variant=kind,
        key=name,
    )
    write_sample(
        out, name, operator_arrays(made.mesh, settings, keep=False) | truth_arrays(made.field)
    )
    return entry


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, help="heads and split.json of make_heads.py")
    parser.add_argument("out", type=Path, help="the dataset's folder")
    parser.add_argument("--count", type=int, default=24, help="heads (24)")
    arguments = parser.parse_args()
    split = json.loads((arguments.folder / "split.json").read_text(encoding="utf-8"))
    heads = [name for name in sorted(split) if name.startswith("head_")]  # bodies may be there too
    test = [name for name in heads if split[name] == "test"][: arguments.count]
    settings = PreprocessSettings()
    (arguments.out / "samples").mkdir(parents=True, exist_ok=True)
    entries = tuple(
        make_sample(arguments.folder / f"{name}.obj", kind, arguments.out, settings)
        for name in test
        for kind in KINDS
    )
    with np.load(arguments.out / "samples" / f"{entries[0].name}.npz") as first:
        channels, lines = first["features"].shape[1], first["lines"].shape[1]
    write_index(
        Dataset(
            folder=arguments.out,
            features=settings.features,
            turned=settings.turned,
            k=settings.k,
            in_channels=channels,
            in_lines=lines,
            order=4,
            samples=entries,
        )
    )


if __name__ == "__main__":
    main()

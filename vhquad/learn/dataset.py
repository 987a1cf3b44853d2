"""A prepared dataset on disk: an index and one archive a sample.

Layout (version 4)::

    dataset/
      index.json          what follows, as JSON
      samples/NAME.npz    arrays, no pickle

``index.json``::

    {"format": "vhquad-dataset", "version": 4,
     "features": "local", "turned": true, "k": 128, "in_channels": 48, "in_lines": 6, "order": 4,
     "samples": [{"name": "head_0001.t0", "shape": "head_0001", "source": "head_0001.obj",
                  "split": "train", "truth": true, "vertices": 3066, "leak": 0.03,
                  "variant": "whole" | "deformed+cropped+rough+decimated" (in part)
                             | "pair" | "plain",
                  "key": hash of source and settings}],
     "skipped": [{"source": "broken.obj", "reason": "..."}]}

``NAME.npz``: ``vertices (n, 3) f64``, ``faces (m, 3) i64``, ``mass (n,) f64``, ``eigenvalues (k,)
f64``, ``eigenvectors (n, k) c64``, ``features (n, c) c64``, ``lines (n, l) c64``; with ground truth
also ``z (n,) c128``, ``size (n,) f64`` (0: unknown), ``coherence (n,) f64``. Frames are those of
``vhquad.geometry.frames`` for these vertices and faces.

The split goes by *shape*, never by triangulation: all samples of one shape are on one side.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any, Literal, get_args

import numpy as np
import torch
from numpy.typing import NDArray

from vhquad.atomic import atomic_path, write_atomic
from vhquad.errors import ConfigError, DatasetError
from vhquad.field.cross import CrossField
from vhquad.mesh.triangle import TriMesh
from vhquad.nn.inputs import NetworkInput, network_input, stack
from vhquad.nn.loss import FieldTruth

__all__ = [
    "Dataset",
    "Sample",
    "SampleEntry",
    "Split",
    "open_dataset",
    "write_index",
    "write_sample",
]

ARRAYS = (
    "vertices", "faces", "mass", "eigenvalues", "eigenvectors", "features", "lines",
    "z", "size", "coherence",
)  # fmt: skip
PER_VERTEX = frozenset(ARRAYS) - {"faces", "eigenvalues"}
FORMAT, VERSION = "vhquad-dataset", 4  # since 4, Laplacians are definite at borders
Split = Literal["train", "val", "test"]


@dataclass(frozen=True)
class SampleEntry:
    """One line of the index; see the module head."""

    name: str
    shape: str
    source: str
    split: Split
    truth: bool
    vertices: int
    leak: float | None
    variant: str
    key: str


@dataclass(frozen=True, eq=False)
class Sample:
    """What the network needs of one sample; ``truth`` is None for plain triangle meshes."""

    name: str
    input: NetworkInput
    truth: FieldTruth | None


@dataclass(frozen=True)
class Dataset:
    """A dataset's index; :meth:`load` reads a sample when it is needed.

    Attributes
    ----------
    folder : Path
    features : str
        Name of the input features.
    turned : bool
        Whether copies turned by a right angle are among them.
    k : int
        Eigenvectors of each sample.
    in_channels : int
        Vectors of the features.
    in_lines : int
        Lines of the features.
    order : int
        Symmetry of the ground truth (4: crosses).
    samples : tuple of SampleEntry
    skipped : tuple of (source, reason)
    """

    folder: Path
    features: str
    turned: bool
    k: int
    in_channels: int
    in_lines: int
    order: int
    samples: tuple[SampleEntry, ...]
    skipped: tuple[tuple[str, str], ...] = ()

    def split(self, name: Split) -> tuple[SampleEntry, ...]:
        """The samples of a split that have ground truth, in the order of the index."""
        return tuple(s for s in self.samples if s.split == name and s.truth)

    def archive(self, entry: SampleEntry) -> dict[str, NDArray[Any]]:
        """All arrays of a sample.

        Raises
        ------
        DatasetError
            If its file is missing, damaged or lacks an array.
        """
        return _read(self.folder, entry, ARRAYS if entry.truth else ARRAYS[:7])

    def mesh(self, entry: SampleEntry) -> TriMesh:
        """Its triangle mesh."""
        arrays = _read(self.folder, entry, ("vertices", "faces"))
        return TriMesh(arrays["vertices"], arrays["faces"])

    def truth_field(self, entry: SampleEntry) -> CrossField:
        """Its ground truth as a field on the vertices; ``confidence`` is the coherence.

        Raises
        ------
        DatasetError
            If the sample has none.
        """
        if not entry.truth:
            raise DatasetError(f"sample {entry.name} has no ground truth")
        arrays = _read(self.folder, entry, ("z", "size", "coherence"))
        return CrossField("vertices", arrays["z"], arrays["size"], arrays["coherence"])

    def load(self, entry: SampleEntry, dtype: torch.dtype = torch.float32) -> Sample:
        """Read what the network and the loss need.

        Raises
        ------
        DatasetError
            If its file is missing, damaged or does not fit the index.
        """
        wanted = ["mass", "eigenvalues", "eigenvectors", "features", "lines"]
        arrays = _read(
            self.folder, entry, (*wanted, "z", "size", "coherence") if entry.truth else wanted
        )
        mass, values, vectors, features, lines = (arrays[name] for name in wanted)
        mesh = network_input(mass, values, vectors, features, lines, dtype=dtype, k=self.k)
        truth = None
        if entry.truth:
            truth = FieldTruth(
                z=stack(arrays["z"], dtype),
                size=torch.as_tensor(arrays["size"] / mesh.length, dtype=dtype),
                weight=torch.as_tensor(arrays["coherence"], dtype=dtype) * mesh.mass,
            )
        return Sample(entry.name, mesh, truth)


def open_dataset(folder: Path | str) -> Dataset:
    """Read a dataset's index.

    Raises
    ------
    DatasetError
        If there is no index, or it is damaged or of another version.
    """
    folder = Path(folder)
    path = folder / "index.json"
    try:
        raw = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise DatasetError(
            f"{folder} has no index.json; make a dataset with: "
            f"vhquad preprocess FOLDER --out {folder}"
        ) from None
    except (OSError, ValueError) as error:
        raise DatasetError(f"{path} cannot be read: {error}") from None
    if not isinstance(raw, dict) or raw.get("format") != FORMAT:
        raise DatasetError(f"{path} is not the index of a vhquad dataset")
    if raw.get("version") != VERSION:
        raise DatasetError(
            f"{path} has version {raw.get('version')}, this vhquad reads {VERSION}; "
            "run vhquad preprocess again into the same folder"
        )
    try:
        return Dataset(
            folder=folder,
            features=str(raw["features"]),
            turned=bool(raw["turned"]),
            k=int(raw["k"]),
            in_channels=int(raw["in_channels"]),
            in_lines=int(raw["in_lines"]),
            order=int(raw["order"]),
            samples=tuple(_entry(item) for item in raw["samples"]),
            skipped=tuple((str(s["source"]), str(s["reason"])) for s in raw["skipped"]),
        )
    except (KeyError, TypeError, ValueError, ConfigError) as error:
        raise DatasetError(f"{path} is damaged: {error}") from None


def write_index(dataset: Dataset) -> None:
    """Write the index; it appears whole or not at all."""
    raw = {
        "format": FORMAT,
        "version": VERSION,
        "features": dataset.features,
        "turned": dataset.turned,
        "k": dataset.k,
        "in_channels": dataset.in_channels,
        "in_lines": dataset.in_lines,
        "order": dataset.order,
        "samples": [asdict(entry) for entry in dataset.samples],
        "skipped": [{"source": source, "reason": reason} for source, reason in dataset.skipped],
    }
    write_atomic(dataset.folder / "index.json", json.dumps(raw, indent=1) + "\n")


def write_sample(folder: Path, name: str, arrays: dict[str, Any]) -> None:
    """Write one archive; it appears whole or not at all."""
    with atomic_path(folder / "samples" / f"{name}.npz") as partial, partial.open("wb") as file:
        np.savez(file, **arrays)


def _entry(item: dict[str, Any]) -> SampleEntry:
    entry = SampleEntry(**{field.name: item[field.name] for field in fields(SampleEntry)})
    if entry.split not in get_args(Split):
        raise ConfigError(f"sample {entry.name} has split {entry.split!r}")
    if Path(entry.name).name != entry.name:
        raise ConfigError(f"sample name {entry.name!r} is no file name")
    return entry


def _read(folder: Path, entry: SampleEntry, names: Sequence[str]) -> dict[str, NDArray[Any]]:
    path = folder / "samples" / f"{entry.name}.npz"
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in names}
    except Exception as error:  # zipfile, zlib and numpy raise a dozen kinds
        raise DatasetError(f"sample {path} cannot be read: {error}; preprocess again") from None
    for name, value in arrays.items():
        if value.dtype.kind not in "iufc" or not np.isfinite(value).all():
            raise DatasetError(f"sample {path}: {name} holds NaN or infinite values, or no numbers")
        if name in PER_VERTEX and len(value) != entry.vertices:
            raise DatasetError(
                f"sample {path}: {name} has {len(value)} rows for {entry.vertices} vertices"
            )
    return arrays

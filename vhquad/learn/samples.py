"""PreprocessSettings, and how one sample is made: variation, truth, operators."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vhquad.errors import ConfigError
from vhquad.field.cross import CrossField
from vhquad.geometry.operators import OperatorSettings, build_operators, load_or_build
from vhquad.learn.augment import crop_height, deform, mirror, roughen
from vhquad.learn.sources import Part
from vhquad.learn.targets import make_target
from vhquad.mesh.triangle import TriMesh

__all__ = [
    "Made",
    "PreprocessSettings",
    "make_sample",
    "operator_arrays",
    "operator_settings",
    "truth_arrays",
]


@dataclass(frozen=True)
class PreprocessSettings:
    """How samples are made.

    Attributes
    ----------
    triangulations : int
        Samples a quad mesh. The first is the whole shape as it is; the others may be varied.
    vertices : (int, int)
        Range of the vertex count of a sample made from quads, drawn log-uniformly.
    crops : float
        Share of the further samples that are cropped.
    deform : float
        Share of the further samples that are deformed and perhaps mirrored.
    rough : float
        Share of the further samples with the noise of a scan.
    decimated : float
        Share of all samples with triangles as quadric decimation leaves them; the others have
        isotropic ones.
    val, test : float
        Share of the shapes put aside; ``split.json`` in the folder ({"shape": "test", ...}) goes
        first. A shape is named by its path in the folder without suffix, "-" between the folders,
        up to a double underscore.
    features : str
        Input features of the network.
    turned : bool
        With copies of the features turned by a right angle.
    k : int
        Eigenvectors.
    seed : int
    """

    triangulations: int = 2
    vertices: tuple[int, int] = (2000, 4000)
    crops: float = 0.75
    deform: float = 0.0
    rough: float = 0.2
    decimated: float = 0.3
    val: float = 0.1
    test: float = 0.0
    features: str = "local"
    turned: bool = True
    k: int = 128
    seed: int = 0

    def __post_init__(self) -> None:
        if self.triangulations < 1:
            raise ConfigError(f"--triangulations must be at least 1, not {self.triangulations}")
        low, high = self.vertices
        if not 100 <= low <= high:
            raise ConfigError(f"--vertices must be a range from 100 up, not {low} to {high}")
        for name in ("crops", "deform", "rough", "decimated", "val", "test"):
            value = getattr(self, name)
            if not 0.0 <= value <= 1.0:
                raise ConfigError(f"--{name} must lie between 0 and 1, not {value}")
        if self.k < 1:
            raise ConfigError(f"--k must be at least 1, not {self.k}")


@dataclass(frozen=True, eq=False)
class Made:
    """A sample's mesh, its truth on the vertices if there is any, and how it was varied."""

    mesh: TriMesh
    field: CrossField | None
    variant: str


def make_sample(
    part: Part, index: int, rng: np.random.Generator, settings: PreprocessSettings
) -> Made:
    """The mesh and the truth of one sample; quads are varied from the second sample on."""
    if part.mesh is not None:
        return Made(part.mesh, part.field, "plain" if part.field is None else "pair")
    assert part.vertices is not None
    assert part.quads is not None
    low, high = settings.vertices
    n_vertices = round(float(np.exp(rng.uniform(np.log(low), np.log(high)))))
    vertices, quads, variant = part.vertices, part.quads, []
    if index > 0 and rng.random() < settings.deform:
        variant.append("deformed")
        vertices = deform(vertices, rng)
        if rng.random() < 0.5:
            vertices, quads = mirror(vertices, quads)
    crop = None
    if index > 0 and rng.random() < settings.crops:
        variant.append("cropped")
        crop = partial(crop_height, rng=rng)
    change = None
    if index > 0 and rng.random() < settings.rough:
        variant.append("rough")
        change = partial(roughen, rng=rng)
    decimated = bool(rng.random() < settings.decimated)
    if decimated:
        variant.append("decimated")
    target = make_target(vertices, quads, n_vertices, rng, crop, change, decimated)
    return Made(target.mesh, target.field, "+".join(variant) or "whole")


def operator_settings(settings: PreprocessSettings) -> OperatorSettings:
    """The operators that go into a sample."""
    return OperatorSettings(k=settings.k, features=settings.features, turned=settings.turned)


def operator_arrays(
    mesh: TriMesh, settings: PreprocessSettings, keep: bool
) -> dict[str, NDArray[Any]]:
    """Arrays of a sample that every mesh has; ``keep``: in the cache of ``predict`` as well."""
    build = load_or_build if keep else build_operators
    operators = build(mesh, operator_settings(settings))
    return {
        "vertices": mesh.vertices,
        "faces": mesh.faces,
        "mass": operators.mass,
        "eigenvalues": operators.eigenvalues,
        "eigenvectors": operators.eigenvectors.astype(np.complex64),
        "features": operators.features.astype(np.complex64),
        "lines": operators.lines.astype(np.complex64),
    }


def truth_arrays(field: CrossField) -> dict[str, NDArray[Any]]:
    """Arrays of a sample that hold its ground truth."""
    coherence = np.abs(field.z) if field.confidence is None else field.confidence
    size = np.zeros(len(field)) if field.size is None else field.size
    return {"z": field.z, "size": size, "coherence": coherence}

"""The continuous map of a component: its field aligned, and the seamless map of that.

But for smoothing, both are linear in the size of quads. So they are made for a number of quads that
stands for its class (:mod:`vhquad.quad.counts`) and scaled, and another number of the same class
finds them in the cache.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vhquad.cache import code_digest, content_key, default_cache_dir, read_arrays, write_arrays
from vhquad.errors import MeshError
from vhquad.field.align import AlignedField, AlignReport, AlignSettings, align_field
from vhquad.field.cross import CrossField
from vhquad.mesh.triangle import TriMesh
from vhquad.quad.sag import sizes_for_creases
from vhquad.quad.seamless_map import SeamlessMap, solve_seamless_map
from vhquad.watch import Watch

__all__ = ["ContinuousMap", "MapInput"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

_LEAST_FACES = 1000  # below this a look into the cache takes as long as the map
_ALIGNED = (
    *("parent_face", "angle", "feature", "axis", "rotation"),
    *("sector", "sector_quads", "sector_vertex", "sector_is_feature", "trust"),
)
_SEAMLESS = ("uv", "turns", "translation")
_NUMBERS = ("unit", "flips", "wrong_angles", "solves")


@dataclass(frozen=True, eq=False)
class ContinuousMap:
    """An aligned field and its seamless map, not rounded to quads yet."""

    aligned: AlignedField
    seamless: SeamlessMap

    def scaled(self, factor: float) -> ContinuousMap:
        """The same for quads whose edges are ``factor`` times as long."""
        size = self.aligned.size
        return ContinuousMap(
            replace(self.aligned, size=None if size is None else size * factor),
            replace(self.seamless, unit=self.seamless.unit / factor),
        )


@dataclass(frozen=True, eq=False)
class MapInput:
    """What the continuous map of a component is made of.

    Attributes
    ----------
    mesh : TriMesh
    field : CrossField
        On its faces. Its sizes count up to a factor: the target says what that is.
    creases : (k, 2) int64
    target : int
        Quads.
    quads : float
        For which the map is made; it is scaled to the target.
    smoothing, cancel : float
        As in :class:`vhquad.field.align.AlignSettings`.
    seam : (3m,) bool or None
        As in :func:`vhquad.field.align.align_field`.
    size_weight : float
        As in :func:`vhquad.quad.seamless_map.solve_seamless_map`.
    curving : float
        How far sizes follow curved creases, 0 to 1.
    """

    mesh: TriMesh
    field: CrossField
    creases: Ints
    target: int
    quads: float
    smoothing: float
    cancel: float
    seam: Bools | None
    size_weight: float
    curving: float

    def solve(self, cache: bool, watch: Watch, tell: Callable[[str, float], None]) -> ContinuousMap:
        """The map for the target, scaled from the one that was made, or is kept.

        Raises
        ------
        FieldError
            If there is no legal field. A map with folds is no error: see its ``is_valid``.
        """
        if cache and self.mesh.n_faces >= _LEAST_FACES:
            with watch("map"):
                path = default_cache_dir() / f"map-{self._key()}.npz"
                found = _read(path)
            if found is None:
                found = self._made(watch, tell)
                with watch("map"):
                    write_arrays(path, _arrays(found))
        else:
            found = self._made(watch, tell)
        return found.scaled(float(np.sqrt(self.quads / self.target)))

    def _key(self) -> str:
        optional = [self.field.size, self.field.confidence, self.seam]
        numbers = [self.quads, self.smoothing, self.cancel]
        return content_key(
            [code_digest(), *numbers, self.size_weight, self.curving],
            [part is None for part in optional],
            *(self.mesh.vertices, self.mesh.faces, self.field.z, self.creases),
            *(part for part in optional if part is not None),
        )

    def _made(self, watch: Watch, tell: Callable[[str, float], None]) -> ContinuousMap:
        mesh, field, quads = self.mesh, self.field, self.quads
        length = float(np.sqrt(mesh.area / quads))
        if field.size is not None:
            count = float((mesh.face_areas / field.size**2).sum())
            field = replace(field, size=field.size * np.sqrt(count / quads))
        tell("align the field", 0.0)
        with watch("align"):
            settings = AlignSettings(length, self.smoothing, self.cancel)
            aligned = align_field(mesh, field, self.creases, settings, self.seam)
        tell("map", 0.15)
        with watch("map"):
            density: Floats | None = None
            if self.curving > 0:
                bent = sizes_for_creases(aligned, self.curving)
                aligned, density = bent.aligned, bent.density
            seamless = solve_seamless_map(
                aligned, size_weight=self.size_weight, least_density=density
            )
        return ContinuousMap(aligned, seamless)


def _arrays(made: ContinuousMap) -> dict[str, NDArray[Any]]:
    """An entry of the cache."""
    aligned, seamless = made.aligned, made.seamless
    arrays = {"vertices": aligned.mesh.vertices, "faces": aligned.mesh.faces}
    arrays |= {name: getattr(aligned, name) for name in _ALIGNED}
    arrays["size"] = np.zeros(0) if aligned.size is None else aligned.size
    parts = (seamless.uv, seamless.rotation, seamless.translation)
    arrays |= dict(zip(_SEAMLESS, parts, strict=True))
    arrays["numbers"] = np.array([getattr(seamless, name) for name in _NUMBERS], dtype=np.float64)
    arrays["report"] = np.array(json.dumps(asdict(aligned.report)))
    return arrays


def _read(path: Path) -> ContinuousMap | None:
    """An entry of the cache, None if it is absent or damaged."""
    names = ("vertices", "faces", *_ALIGNED, "size", *_SEAMLESS, "numbers", "report")
    found = read_arrays(path, names)
    if found is None:
        return None
    data = dict(zip(names, found, strict=True))
    try:
        mesh = TriMesh(data["vertices"], data["faces"])
        report = _report(json.loads(str(data["report"])))
        unit, *counts = data["numbers"].tolist()
    except (MeshError, ValueError, TypeError):
        return None
    parts: dict[str, Any] = {name: data[name] for name in _ALIGNED}
    size = data["size"] if len(data["size"]) else None
    aligned = AlignedField(mesh=mesh, report=report, size=size, **parts)
    flips, wrong_angles, solves = (int(count) for count in counts)
    seamless = SeamlessMap(
        data["uv"], unit, data["turns"], data["translation"], flips, wrong_angles, solves
    )
    return ContinuousMap(aligned, seamless)


def _report(raw: dict[str, Any]) -> AlignReport:
    """The report as JSON keeps it: keys of dictionaries are strings there."""
    values = {field.name: raw[field.name] for field in fields(AlignReport)}
    for name, value in values.items():
        if isinstance(value, dict):
            values[name] = {int(key): count for key, count in value.items()}
    return AlignReport(**values)

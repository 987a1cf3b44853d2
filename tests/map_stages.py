"""The stages from a mesh to a quantised layout on the analytic meshes, each made once a session."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np
from numpy.typing import NDArray

from tests import meshes
from vhquad.field.align import AlignedField, AlignSettings, align_field
from vhquad.field.cross import CrossField
from vhquad.field.features import find_creases
from vhquad.field.smooth import smoothest
from vhquad.geometry.frames import face_axes
from vhquad.mesh.triangle import TriMesh
from vhquad.quad.motorcycle import Tracing, trace
from vhquad.quad.quantize import Quantisation, quantise
from vhquad.quad.seamless import SeamlessSpace, seamless_space
from vhquad.quad.seamless_map import SeamlessMap, solve_seamless_map
from vhquad.quad.tmesh import TMesh, build_tmesh

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Stages:
    """A mesh, its aligned field, and what is made of it when asked for."""

    mesh: TriMesh
    aligned: AlignedField
    edge: float

    @cached_property
    def space(self) -> SeamlessSpace:
        return seamless_space(self.aligned)

    @cached_property
    def seamless(self) -> SeamlessMap:
        return solve_seamless_map(self.aligned)

    @cached_property
    def tracing(self) -> Tracing:
        return trace(self.aligned, self.seamless)

    @cached_property
    def tmesh(self) -> TMesh:
        return build_tmesh(self.aligned, self.seamless, self.tracing)

    @cached_property
    def quantised(self) -> dict[int, Quantisation]:
        return {}

    def quantise(self, target: int) -> Quantisation:
        if target not in self.quantised:
            self.quantised[target] = quantise(self.tmesh, target, self.seamless.area)
        return self.quantised[target]

    @property
    def euler(self) -> int:
        return self.mesh.euler_characteristic


def field_along(mesh: TriMesh, direction: Floats) -> NDArray[np.complex128]:
    """Crosses with one arm along the tangential part of given vectors; (m,)."""
    e1, e2 = face_axes(mesh)
    x, y = np.einsum("fi,fi->f", direction, e1), np.einsum("fi,fi->f", direction, e2)
    return np.exp(4j * np.arctan2(y, x))


def made(
    mesh: TriMesh,
    quads: int = 200,
    z: NDArray[np.complex128] | None = None,
    crease: float | None = 40.0,
) -> Stages:
    """Align a field (by default the smoothest) with uniform sizes for a number of quads."""
    edge = float(np.sqrt(mesh.area / quads))
    z = np.zeros(mesh.n_faces, dtype=np.complex128) if z is None else z
    sharp = np.zeros((0, 2), dtype=np.int64) if crease is None else find_creases(mesh, crease)
    field = CrossField("faces", z, np.full(mesh.n_faces, edge))
    return Stages(mesh, align_field(mesh, field, sharp, AlignSettings(edge_length=edge)), edge)


def _smooth_torus() -> Stages:
    """A torus whose crosses follow its circles: no singularity."""
    mesh = meshes.torus()
    middle = mesh.vertices[mesh.faces].mean(axis=1)
    around = np.stack([-middle[:, 1], middle[:, 0], np.zeros(mesh.n_faces)], axis=1)
    return made(mesh, z=field_along(mesh, around))


def noisy(mesh: TriMesh, strength: float, rng: np.random.Generator) -> NDArray[np.complex128]:
    """The smoothest field with every cross turned by a random angle, ``strength`` of 45 degrees."""
    z = smoothest(mesh)
    return z * np.exp(1j * np.pi * strength * rng.uniform(-1, 1, mesh.n_faces))


BUILDERS: dict[str, Callable[[], Stages]] = {
    "sphere": lambda: made(meshes.icosphere(2)),
    "blob": lambda: made(meshes.blob(3)),
    "torus": _smooth_torus,
    "bad_torus": lambda: made(meshes.torus()),
    "pretzel": lambda: made(meshes.pretzel(), crease=None),
    "cube": lambda: made(meshes.cube(4)),
    "plate": lambda: made(meshes.plate_with_holes(2, 2)),
    "plain_cube": lambda: made(meshes.cube(4), crease=None),
    "grid": lambda: made(meshes.grid()),
    "hole": lambda: made(meshes.grid(9, 9, 1.0, 1.0, hole=True)),
    "cylinder": lambda: made(meshes.open_cylinder()),
    "disk": lambda: made(meshes.disk(), quads=50),
    "cone": lambda: made(meshes.cone(), quads=50),
    "half_sphere": lambda: made(meshes.half_sphere()),
    "open_torus": lambda: made(meshes.punctured_torus()),
}
NAMES = sorted(BUILDERS)
CLOSED_PLAIN = {"sphere": 0, "blob": 0, "plain_cube": 0, "bad_torus": 1, "pretzel": 2}
"""Closed, without creases, singular: name and genus."""


@cache
def stages(name: str) -> Stages:
    """The stages of a named case, shared by all tests."""
    return BUILDERS[name]()

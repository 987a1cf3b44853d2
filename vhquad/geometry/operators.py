"""Operators: all that the network needs to know of a mesh, built once and cached by content."""

from __future__ import annotations

import os
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from vhquad.cache import content_key, default_cache_dir, read_arrays, write_arrays
from vhquad.errors import ConfigError, MeshError
from vhquad.geometry.delaunay import intrinsic_delaunay
from vhquad.geometry.features import FEATURES, ShapeContext, compute_features
from vhquad.geometry.frames import build_frames
from vhquad.geometry.laplacian import connection_laplacian, lumped_mass
from vhquad.geometry.spectral import smallest_eigenpairs
from vhquad.mesh.triangle import TriMesh

__all__ = [
    "OPERATORS_VERSION",
    "OperatorSettings",
    "Operators",
    "build_operators",
    "default_cache_dir",
    "load_or_build",
]

OPERATORS_VERSION = 5
"""Raised whenever the same mesh and settings give other operators; old cache entries then rest."""

_ARRAYS = ("mass", "eigenvalues", "eigenvectors", "features", "lines")


@dataclass(frozen=True)
class OperatorSettings:
    """What to build. A trained network is tied to all of it.

    Attributes
    ----------
    k : int
        Eigenpairs, of the connection Laplacian and of the heat kernel.
    features : str
        A name in ``vhquad.geometry.features.FEATURES``.
    turned : bool
        Append quarter-turned copies of the features.
    order : int
        Order of the connection: 1 for vectors (the network of the paper, whatever the order of
        the field it predicts), 2 or 4 for a network whose channels are lines or crosses.
    """

    k: int = 128
    features: str = "hks"
    turned: bool = True
    order: int = 1

    def __post_init__(self) -> None:
        if self.k < 1:
            raise ConfigError(f"k must be at least 1, not {self.k}")
        if self.features not in FEATURES:
            known = ", ".join(FEATURES)
            raise ConfigError(f"unknown features {self.features!r}; choose from {known}")
        if self.order not in (1, 2, 4):
            raise ConfigError(f"order must be 1, 2 or 4, not {self.order}")


@dataclass(frozen=True, eq=False)
class Operators:
    """Operators of one mesh, double precision, in the units and vertex frames of the mesh.

    Attributes
    ----------
    mesh : TriMesh
    settings : OperatorSettings
    mass : (n,) float64
        Vertex areas.
    eigenvalues : (k,) float64
        Of the connection Laplacian, ascending, 1 / length^2. Fewer if the mesh has fewer than k
        vertices; the basis is then complete.
    eigenvectors : (n, k) complex128
        ``Phi^H diag(mass) Phi = I``.
    features : (n, c) complex128
        Tangent vectors without units.
    lines : (n, l) complex128
        Features of order 2, if the chosen ones have any.
    """

    mesh: TriMesh
    settings: OperatorSettings
    mass: NDArray[np.float64]
    eigenvalues: NDArray[np.float64]
    eigenvectors: NDArray[np.complex128]
    features: NDArray[np.complex128]
    lines: NDArray[np.complex128]

    @property
    def area(self) -> float:
        """Total area."""
        return float(self.mass.sum())


def build_operators(mesh: TriMesh, settings: OperatorSettings | None = None) -> Operators:
    """Build the operators of a mesh.

    Meant for one connected component at a time: of several the eigenpairs are those of the union,
    of which a small component gets few.

    Raises
    ------
    MeshError
        If a vertex belongs to no face, or an edge or vertex is not manifold.
    """
    settings = OperatorSettings() if settings is None else settings
    unused = np.flatnonzero(mesh.outgoing < 0)
    if unused.size:
        raise MeshError(
            f"{len(unused)} vertices belong to no face, the first is {unused[0]}; run repair first"
        )
    frames = build_frames(mesh)
    tri = intrinsic_delaunay(mesh, frames)
    mass = lumped_mass(tri)
    spectrum = smallest_eigenpairs(connection_laplacian(tri, settings.order), mass, settings.k)
    shape = ShapeContext(mesh, frames, tri, settings.k)
    features = compute_features(settings.features, shape, settings.turned)
    return Operators(
        mesh=mesh,
        settings=settings,
        mass=mass,
        eigenvalues=spectrum.eigenvalues,
        eigenvectors=spectrum.eigenvectors.astype(np.complex128, copy=False),
        features=features.vectors,
        lines=features.lines,
    )


# ---- cache -----------------------------------------------------------------------------------


def load_or_build(
    mesh: TriMesh,
    settings: OperatorSettings | None = None,
    cache_dir: str | os.PathLike[str] | None = None,
    cache: bool = True,
) -> Operators:
    """The operators of a mesh, from the cache if they are there, else built and kept.

    An entry that is damaged or does not fit is built again. A cache that cannot be written (full
    or read-only disk) is no error.

    Parameters
    ----------
    mesh : TriMesh
    settings : OperatorSettings, optional
    cache_dir : path, optional
        :func:`default_cache_dir` if not given.
    cache : bool
        False neither reads nor writes.
    """
    settings = OperatorSettings() if settings is None else settings
    if not cache:
        return build_operators(mesh, settings)
    folder = default_cache_dir() if cache_dir is None else Path(cache_dir)
    path = folder / f"{_key(mesh, settings)}.npz"
    found = _read(path, mesh, settings)
    if found is not None:
        return found
    built = build_operators(mesh, settings)
    write_arrays(path, {name: getattr(built, name) for name in _ARRAYS})
    return built


def _key(mesh: TriMesh, settings: OperatorSettings) -> str:
    return content_key([OPERATORS_VERSION, asdict(settings)], mesh.vertices, mesh.faces)


def _read(path: Path, mesh: TriMesh, settings: OperatorSettings) -> Operators | None:
    """The entry at a path, or None if it is absent, damaged, or of the wrong shape."""
    found = read_arrays(path, _ARRAYS)
    if found is None:
        return None
    mass, values, vectors, features, lines = found
    n = mesh.n_vertices
    pairs = min(settings.k, n)
    fits = (
        mass.shape == (n,)
        and values.shape == (pairs,)
        and vectors.shape == (n, pairs)
        and features.ndim == lines.ndim == 2
        and len(features) == len(lines) == n
        and mass.dtype == values.dtype == np.float64
        and vectors.dtype == features.dtype == lines.dtype == np.complex128
    )
    return Operators(mesh, settings, mass, values, vectors, features, lines) if fits else None

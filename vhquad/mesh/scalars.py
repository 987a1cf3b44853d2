"""A number at every vertex of a mesh file: a PLY property by its name, or the vertex colours."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from vhquad.errors import MeshError
from vhquad.mesh.load import LoadedMesh
from vhquad.mesh.ply import read_tables
from vhquad.mesh.triangle import TriMesh

__all__ = ["COLOUR", "carried", "read_density", "read_scalars"]

Floats = NDArray[np.float64]

COLOUR = ("color", "colour")
RANGE = 4.0  # what white multiplies a density by, and black divides it by


def read_density(loaded: LoadedMesh, name: str) -> Floats:
    """A factor on the density of quads at each vertex of a loaded mesh, from its file.

    Parameters
    ----------
    loaded : LoadedMesh
    name : str
        A vertex property of a PLY file, taken as it is, or "color": white is 4, mid-grey 1,
        black 1/4, and between them the factor grows evenly by ratio.

    Returns
    -------
    (n,) float64
        At a vertex that repair added, the mean of its neighbours.

    Raises
    ------
    MeshError
        If the file has no such values.
    """
    values = read_scalars(loaded.path, name)
    if name.lower() in COLOUR:
        values = RANGE ** (2.0 * np.clip(values, 0.0, 1.0) - 1.0)
    return carried(values, loaded.vertex_source, loaded.mesh)


def carried(values: Floats, source: NDArray[np.int64], mesh: TriMesh) -> Floats:
    """Values of an input's vertices at those of the repaired mesh.

    Parameters
    ----------
    values : (n_in,) float64
    source : (n,) int64
        Vertex of the input for each of the mesh's; -1 for one that repair added, which gets the
        mean of its neighbours.
    mesh : TriMesh

    Returns
    -------
    (n,) float64
    """
    known = source >= 0
    out = np.where(known, values[np.maximum(source, 0)], 0.0)
    i, j = np.concatenate([mesh.edges, mesh.edges[:, ::-1]]).T
    while not known.all():
        count = np.bincount(i, known[j], mesh.n_vertices)
        total = np.bincount(i, known[j] * out[j], mesh.n_vertices)
        new = ~known & (count > 0)
        if not new.any():  # a part made of added vertices alone
            return np.where(known, out, 1.0)
        out[new] = total[new] / count[new]
        known = known | new
    return out


def read_scalars(path: str | Path, name: str) -> Floats:
    """One number for each vertex of a file, in its order; colours as the mean of their channels.

    Raises
    ------
    MeshError
        If the file has no such values; the message names those that it has.
    """
    path = Path(path)
    try:
        data = path.read_bytes()
    except OSError as error:
        raise MeshError(f"{path} cannot be read ({error.strerror or error})") from None
    if data.startswith(b"ply"):
        columns = _ply_columns(data)
    elif path.suffix.lower() == ".obj":
        columns = _obj_columns(data.decode("utf-8", "replace"))
    else:
        columns = {}
    found = columns.get("color" if name.lower() in COLOUR else name)
    if found is None:
        there = ", ".join(columns) if columns else "none"
        raise MeshError(
            f"{path} has no values {name!r} at its vertices (there are: {there}); PLY files hold "
            "properties by name, PLY and OBJ files colours"
        )
    return found


def _ply_columns(data: bytes) -> dict[str, Floats]:
    vertex = read_tables(data).get("vertex", {})
    columns = {
        name: np.asarray(values, dtype=np.float64)
        for name, values in vertex.items()
        if isinstance(values, np.ndarray) and name not in ("x", "y", "z")
    }
    if {"red", "green", "blue"} <= set(columns):
        mean = np.mean([columns[c] for c in ("red", "green", "blue")], axis=0)
        whole = vertex["red"].dtype.kind in "iu" or mean.max(initial=0.0) > 1.0
        columns["color"] = mean / 255.0 if whole else mean
    return columns


def _obj_columns(text: str) -> dict[str, Floats]:
    rows = [line.split()[1:7] for line in text.splitlines() if line.startswith("v ")]
    if not rows or any(len(row) != 6 for row in rows):
        return {}
    try:
        mean = np.array([row[3:] for row in rows], dtype=np.float64).mean(axis=1)
    except ValueError:
        return {}
    return {"color": mean / 255.0 if mean.max(initial=0.0) > 1.0 else mean}

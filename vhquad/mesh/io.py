"""Mesh files in and out: any triangle or polygon mesh in, quads and triangles out.

OBJ, PLY and OFF are read here, so that polygons stay polygons; STL, GLB and glTF by trimesh.
Everything a file holds comes back, in one soup; nothing is welded or dropped
(see :mod:`vhquad.mesh.load` for that). Files are written whole or not at all, with all digits.
"""

from __future__ import annotations

import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vhquad.atomic import atomic_path
from vhquad.errors import MeshError
from vhquad.mesh.parse import parse_obj, parse_off
from vhquad.mesh.ply import parse_ply
from vhquad.mesh.polygons import PolygonSoup
from vhquad.mesh.quad import QuadMesh
from vhquad.mesh.scene import read_scene
from vhquad.mesh.triangle import TriMesh

__all__ = [
    "READABLE",
    "WRITABLE",
    "check_output",
    "read_polygons",
    "read_quad_mesh",
    "write_obj_with_uv",
    "write_quad_mesh",
    "write_triangle_mesh",
]

READABLE = (".obj", ".ply", ".stl", ".off", ".glb", ".gltf")
WRITABLE = (".obj", ".ply", ".off")

PathLike = str | os.PathLike[str]
Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


# ---- in -------------------------------------------------------------------------------------


def read_polygons(path: PathLike) -> PolygonSoup:
    """Everything that a mesh file holds, as it stands.

    Parameters
    ----------
    path : str or PathLike
        An OBJ, PLY, OFF, STL, GLB or glTF file; the content decides before the suffix.

    Returns
    -------
    PolygonSoup
        Vertices and polygons of all objects of the file, scene transforms applied.

    Raises
    ------
    MeshError
        If the file is missing, unreadable, of another kind, damaged, or has no faces; the message
        is one line that names the file.
    """
    file = Path(path)
    data = _bytes(file)
    kind = _kind(file, data)
    try:
        if kind == ".obj":
            soup = parse_obj(data.decode("utf-8", "replace").lstrip("\ufeff"))
        elif kind == ".off":
            soup = parse_off(data.decode("utf-8", "replace").lstrip("\ufeff"))
        elif kind == ".ply":
            soup = parse_ply(data)
        else:
            soup = read_scene(file, kind)
    except MeshError as error:
        raise MeshError(f"{file}: {error}; check or re-export the file") from None
    if soup.n_faces == 0:
        count = len(soup.vertices)
        if not count:
            raise MeshError(
                f"{file} holds neither vertices nor faces; is it a mesh, and whole? Export it again"
            )
        raise MeshError(
            f"{file} has {count} vertices but no faces (a point cloud?); export a surface"
        )
    return PolygonSoup(soup.vertices, soup.corners, soup.sizes, soup.lines, file.stem)


def read_quad_mesh(path: PathLike) -> QuadMesh:
    """A mesh of quads only, as it stands in the file.

    Raises
    ------
    MeshError
        If the file cannot be read, some faces are not quads (the message counts them), or some
        positions are not finite.
    """
    soup = read_polygons(path)
    quads, _ = soup.of_size(4)
    if len(quads) < soup.n_faces:
        size, count = np.unique(soup.sizes[soup.sizes != 4], return_counts=True)
        kinds = ", ".join(f"{c} with {s} corners" for s, c in zip(size, count, strict=True))
        raise MeshError(
            f"{path}: {soup.n_faces - len(quads)} of {soup.n_faces} faces are not quads ({kinds});"
            " only all-quad meshes can be used here"
        )
    try:
        return QuadMesh(soup.vertices, quads)
    except MeshError as error:
        raise MeshError(f"{path}: {error}; check or re-export the file") from None


def _bytes(file: Path) -> bytes:
    """The file's content; one-line errors for what is no readable, non-empty file."""
    try:
        if file.is_dir():
            raise MeshError(f"{file} is a folder; name a mesh file")
        data = file.read_bytes()
    except FileNotFoundError:
        raise MeshError(f"{file} does not exist; check the path") from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise MeshError(f"{file} cannot be read ({reason}); check the path and rights") from None
    if not data.strip():
        raise MeshError(f"{file} is empty; export the mesh again")
    return data


def _kind(file: Path, data: bytes) -> str:
    """Suffix of the format, by the first bytes where they tell, else by the name."""
    if data.startswith((b"ply\n", b"ply\r")):
        return ".ply"
    if data.startswith(b"glTF"):
        return ".glb"
    suffix = file.suffix.lower()
    if suffix not in READABLE:
        kinds = ", ".join(READABLE)
        raise MeshError(
            f"{file}: the format {suffix or 'without suffix'!r} is not read; use {kinds}"
        )
    return suffix


# ---- out ------------------------------------------------------------------------------------


def check_output(path: PathLike) -> None:
    """Refuse, before work starts, a mesh file name that could not be written in the end.

    Raises
    ------
    MeshError
        If the suffix is none of `WRITABLE`, or the path is a folder.
    """
    file = Path(path)
    if file.suffix.lower() not in WRITABLE:
        kinds = ", ".join(WRITABLE)
        raise MeshError(f"{file}: cannot write the format {file.suffix!r}; use {kinds}")
    if file.is_dir():
        raise MeshError(f"{file} is a folder; name a file to write")


def write_quad_mesh(path: PathLike, mesh: QuadMesh) -> None:
    """Write quads as quads: OBJ, PLY (binary, double) or OFF by the suffix.

    Raises
    ------
    MeshError
        If the format is another or the file cannot be written; an earlier file then stays.
    """
    _write(path, mesh.vertices, mesh.quads)


def write_triangle_mesh(path: PathLike, mesh: TriMesh) -> None:
    """Write triangles: OBJ, PLY (binary, double) or OFF by the suffix.

    Raises
    ------
    MeshError
        As :func:`write_quad_mesh`.
    """
    _write(path, mesh.vertices, mesh.faces)


def write_obj_with_uv(path: PathLike, mesh: TriMesh, uv: ArrayLike) -> None:
    """Write triangles with a texture coordinate at each corner, as libQEx reads them.

    One grid unit of (u, v) is one quad edge; the corners of a seam keep their own values.

    Parameters
    ----------
    path : str or PathLike
        An ``.obj`` file.
    mesh : TriMesh
    uv : (m, 3, 2) array_like
        Coordinates of corner k of face f.

    Raises
    ------
    MeshError
        If the suffix is not ``.obj``, the shape is wrong, values are not finite, or the file cannot
        be written.
    """
    values = np.asarray(uv, dtype=np.float64)
    if Path(path).suffix.lower() != ".obj":
        raise MeshError(f"{path}: texture coordinates are written as OBJ; use the suffix .obj")
    if values.shape != (mesh.n_faces, 3, 2) or not np.isfinite(values).all():
        raise MeshError(f"uv must be finite, of shape ({mesh.n_faces}, 3, 2), not {values.shape}")
    points, place = np.unique(values.reshape(-1, 2) + 0.0, axis=0, return_inverse=True)
    corner = np.stack([mesh.faces, place.reshape(-1, 3)], axis=2).reshape(-1, 6) + 1
    rows = [f"f {a}/{s} {b}/{t} {c}/{u}" for a, s, b, t, c, u in corner.tolist()]
    _save(path, _text([*_rows("v", mesh.vertices), *_rows("vt", points), *rows]))


def _write(path: PathLike, vertices: Floats, faces: Ints) -> None:
    check_output(path)
    suffix = Path(path).suffix.lower()
    if suffix == ".obj":
        data = _text([*_rows("v", vertices), *_rows("f", faces + 1)])
    elif suffix == ".off":
        counts = f"{len(vertices)} {len(faces)} 0"
        data = _text(["OFF", counts, *_rows("", vertices), *_rows(str(faces.shape[1]), faces)])
    else:
        data = _ply(vertices, faces)
    _save(path, data)


def _rows(head: str, table: NDArray[Any]) -> list[str]:
    """One line a row, each number in its shortest form that reads back the same."""
    start = f"{head} " if head else ""
    return [start + " ".join(map(repr, row)) for row in table.tolist()]


def _text(lines: Iterable[str]) -> bytes:
    return ("\n".join(lines) + "\n").encode("ascii")


def _ply(vertices: Floats, faces: Ints) -> bytes:
    head = (
        "ply\nformat binary_little_endian 1.0\n"
        f"element vertex {len(vertices)}\n"
        "property double x\nproperty double y\nproperty double z\n"
        f"element face {len(faces)}\n"
        "property list uchar int vertex_indices\nend_header\n"
    )
    size = faces.shape[1]
    table = np.zeros(len(faces), dtype=[("size", "u1"), ("corner", "<i4", (size,))])
    table["size"], table["corner"] = size, faces
    return head.encode("ascii") + vertices.astype("<f8").tobytes() + table.tobytes()


def _save(path: PathLike, data: bytes) -> None:
    try:
        with atomic_path(path) as temporary:
            temporary.write_bytes(data)
    except OSError as error:
        reason = error.strerror or error
        raise MeshError(f"{path} cannot be written ({reason}); choose another place") from None

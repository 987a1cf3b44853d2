"""Loaded meshes, kept by the content of the file: reading and repairing takes a while.

Only files that hold all of a mesh are looked at, and only those that take longer than a look into
the cache.
"""

from __future__ import annotations

from dataclasses import astuple, fields
from pathlib import Path

import numpy as np

from vhquad.cache import code_digest, content_key, default_cache_dir, read_arrays, write_arrays
from vhquad.errors import MeshError
from vhquad.mesh.io import PathLike
from vhquad.mesh.load import LoadedMesh, load
from vhquad.mesh.repair_report import RepairReport
from vhquad.mesh.triangle import TriMesh

__all__ = ["load_kept"]

LEAST_BYTES = 50_000  # some hundred vertices
WHOLE = (".obj", ".ply", ".stl", ".off", ".glb")  # a .gltf names other files
_INTEGERS = ("faces", "vertex_source", "face_source", "creases", "counts", "repaired")
_COUNTS = ("polygons", "ignored_faces", "ignored_lines")


def load_kept(path: PathLike) -> LoadedMesh:
    """The same as :func:`vhquad.mesh.load.load`, from the cache if this file was loaded before.

    Raises
    ------
    MeshError
        If it cannot be loaded.
    """
    file = Path(path)
    try:
        large = file.suffix.lower() in WHOLE and file.stat().st_size >= LEAST_BYTES
        data = file.read_bytes() if large else b""
    except OSError:
        large = False
    if not large:
        return load(path)  # which says what is wrong
    key = content_key([code_digest(), file.suffix.lower()], data)
    entry = default_cache_dir() / f"mesh-{key}.npz"
    found = _read(entry, file)
    if found is not None:
        return found
    loaded = load(path)
    creases = loaded.crease_edges
    counts = [getattr(loaded, name) for name in _COUNTS]
    arrays = {
        "vertices": loaded.mesh.vertices,
        "faces": loaded.mesh.faces,
        "vertex_source": loaded.vertex_source,
        "face_source": loaded.face_source,
        "creases": np.zeros((0, 2), dtype=np.int64) if creases is None else creases,
        "counts": np.array([*counts, creases is not None], dtype=np.int64),
        "repaired": np.array(astuple(loaded.report), dtype=np.int64),
    }
    write_arrays(entry, arrays)
    return loaded


def _read(entry: Path, file: Path) -> LoadedMesh | None:
    """What an entry holds; None if it is absent, damaged or of another shape."""
    found = read_arrays(entry, ("vertices", *_INTEGERS))
    if found is None or any(array.dtype != np.int64 for array in found[1:]):
        return None
    vertices, faces, vertex_source, face_source, creases, counts, repaired = found
    names = [field.name for field in fields(RepairReport)]
    try:
        mesh = TriMesh(vertices, faces)
    except MeshError:
        return None
    fits = (
        vertex_source.shape == (len(vertices),)
        and face_source.shape == (len(faces),)
        and creases.shape == (len(creases), 2)
        and counts.shape == (len(_COUNTS) + 1,)
        and repaired.shape == (len(names),)
    )
    if not fits:
        return None
    *numbers, lines = counts.tolist()
    return LoadedMesh(
        mesh=mesh,
        report=RepairReport(**dict(zip(names, repaired.tolist(), strict=True))),
        path=file,
        vertex_source=vertex_source,
        face_source=face_source,
        crease_edges=creases if lines else None,
        **dict(zip(_COUNTS, numbers, strict=True)),
    )

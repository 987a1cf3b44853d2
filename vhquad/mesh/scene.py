"""Triangles out of the formats that trimesh reads for us: STL, GLB, glTF."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from vhquad.errors import MeshError
from vhquad.mesh.polygons import PolygonSoup

__all__ = ["read_scene"]


def read_scene(file: Path, kind: str) -> PolygonSoup:
    """Triangles of all geometries of a file, each placed as the scene says.

    Parameters
    ----------
    file : Path
    kind : str
        The format as a suffix, such as ``".glb"``.

    Raises
    ------
    MeshError
        If trimesh cannot read the file, or faces name vertices that are not there.
    """
    import trimesh

    scene: Any
    options: dict[str, Any] = {} if kind == ".stl" else {"skip_materials": True}
    try:
        with file.open("rb") as stream:
            resolver = trimesh.resolvers.FilePathResolver(str(file))
            scene = trimesh.load(
                stream,
                file_type=kind[1:],
                force="scene",
                process=False,
                resolver=resolver,
                **options,
            )
        nodes = [scene.graph[node] for node in scene.graph.nodes_geometry]
    except Exception as error:  # whatever a damaged file makes of a parser
        text = " ".join(str(error).split())[:80]
        raise MeshError(f"it is not a readable {kind[1:].upper()} file ({text})") from None
    vertices, faces, count = [np.zeros((0, 3))], [np.zeros((0, 3), dtype=np.int64)], 0
    for transform, name in nodes:
        part = scene.geometry[name]
        if not isinstance(part, trimesh.Trimesh):
            continue
        v = np.asarray(part.vertices, dtype=np.float64)
        f = np.asarray(part.faces, dtype=np.int64)
        if f.size and (f.min() < 0 or f.max() >= len(v)):
            raise MeshError(f"faces of {name!r} name vertices outside 0..{len(v) - 1}")
        if not np.array_equal(transform, np.eye(4)):
            v = v @ transform[:3, :3].T + transform[:3, 3]
            f = f[:, ::-1] if np.linalg.det(transform[:3, :3]) < 0 else f
        vertices.append(v)
        faces.append(f + count)
        count += len(v)
    every = np.concatenate(faces)
    return PolygonSoup(np.concatenate(vertices), every.reshape(-1), np.full(len(every), 3))

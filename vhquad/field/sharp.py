"""QuadWild's .sharp files: the edges that quads must follow, as (type, face, edge) rows.

::

    <count>
    <type>,<face>,<edge>

Type 0 is concave, 1 convex; edge e of a face joins its corners e and e + 1; all count from 0. An
inner edge is listed from either side or from both. Commas separate: QuadWild reads nothing else.
Borders are listed too, since beside a field file QuadWild looks for none itself.
"""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vhquad.atomic import write_atomic
from vhquad.errors import FieldError
from vhquad.field.features import crease_halfedges
from vhquad.mesh.triangle import TriMesh

__all__ = ["read_sharp", "write_sharp"]

Ints = NDArray[np.int64]


def write_sharp(
    path: str | os.PathLike[str], mesh: TriMesh, creases: ArrayLike | None = None
) -> None:
    """Write creases, each from both of its sides, and the border of a mesh.

    Parameters
    ----------
    path : path
    mesh : TriMesh
    creases : (k, 2) array_like of int, optional
        Vertex pairs.
    """
    h = np.flatnonzero(crease_halfedges(mesh, creases) | (mesh.twin < 0))
    convex = (mesh.dihedral_angles[h] >= 0).astype(np.int64)
    rows = np.stack([convex, h // 3, h % 3], axis=1)
    text = "".join(f"{kind},{face},{edge}\n" for kind, face, edge in rows.tolist())
    write_atomic(path, f"{len(rows)}\n{text}")


def read_sharp(path: str | os.PathLike[str], mesh: TriMesh) -> Ints:
    """Read the inner edges of a .sharp file; blanks in place of commas are taken too.

    Parameters
    ----------
    path : path
    mesh : TriMesh
        The mesh that the file was written for.

    Returns
    -------
    (k, 2) int64
        Vertex pairs (lower, higher), sorted, each once; borders are left out.

    Raises
    ------
    FieldError
        If the file cannot be read or names what the mesh has not.
    """
    path = Path(path)
    try:
        lines = path.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError as error:
        raise FieldError(f"{path} cannot be read: {error.strerror or error}") from error
    rows = [_row(path, number, line) for number, line in enumerate(lines, 1) if line.strip()]
    if not rows or len(rows[0]) != 1:
        raise FieldError(f"{path}, line 1: a .sharp file starts with the number of its edges")
    if rows[0][0] != len(rows) - 1:
        raise FieldError(f"{path}, line 1: {rows[0][0]} edges are said, {len(rows) - 1} follow")
    halfedges = []
    for number, row in enumerate(rows[1:], 2):
        if len(row) != 3:
            raise FieldError(f"{path}, line {number}: expected type,face,edge")
        _, face, edge = row
        if not (0 <= face < mesh.n_faces and 0 <= edge < 3):
            raise FieldError(
                f"{path}, line {number}: edge {edge} of face {face}, but the mesh has "
                f"{mesh.n_faces} faces of 3 edges, counted from 0"
            )
        halfedges.append(3 * face + edge)
    h = np.array(halfedges, dtype=np.int64)
    inner = h[mesh.twin[h] >= 0]
    return mesh.edges[np.unique(mesh.halfedge_edge[inner])]


def _row(path: Path, number: int, line: str) -> list[int]:
    try:
        return [int(word[:20]) for word in line.replace(",", " ").split()]
    except ValueError:
        raise FieldError(f"{path}, line {number}: {line.strip()[:40]!r} is not numbers") from None

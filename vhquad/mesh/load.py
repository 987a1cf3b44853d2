"""Load: from a mesh file to a sound TriMesh in one call: read, cut polygons, repair."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from vhquad.errors import MeshError
from vhquad.mesh.io import PathLike, read_polygons
from vhquad.mesh.polygons import PolygonSoup, triangulate
from vhquad.mesh.repair import repair
from vhquad.mesh.repair_report import RepairReport
from vhquad.mesh.triangle import TriMesh
from vhquad.mesh.weld import position_classes

__all__ = ["LoadedMesh", "load"]

Ints = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class LoadedMesh:
    """A repaired mesh, what was done to it, and where its parts stand in the file."""

    mesh: TriMesh
    report: RepairReport
    path: Path
    polygons: int
    """Faces of the file with more than three corners, which were cut into triangles."""
    ignored_faces: int
    """Faces of the file with fewer than three corners."""
    vertex_source: Ints
    """(n,) vertex of the file, 0-based; -1 for an added one."""
    face_source: Ints
    """(m,) face of the file, 0-based."""
    crease_edges: Ints | None
    """(k, 2) vertex pairs of the mesh that the file's line elements mark; None without any."""
    ignored_lines: int
    """Line elements of the file that are no edge of the mesh."""

    def lines(self) -> list[str]:
        """What was done on the way, for people; empty if the file held a sound triangle mesh."""
        counts = {
            "polygons cut into triangles": self.polygons,
            "faces of fewer than three corners left out": self.ignored_faces,
            "line elements that are no edge left out": self.ignored_lines,
        }
        return [f"{text}: {count}" for text, count in counts.items() if count] + self.report.lines()


def load(path: PathLike) -> LoadedMesh:
    """Read a mesh file and make it a sound triangle mesh.

    Parameters
    ----------
    path : str or PathLike
        OBJ, PLY, STL, OFF, GLB or glTF; all objects of the file are taken.

    Returns
    -------
    LoadedMesh

    Raises
    ------
    MeshError
        In one line that names the file, the cause and a remedy.
    """
    soup = read_polygons(path)
    cut = triangulate(soup)
    try:
        result = repair(soup.vertices, cut.faces)
    except MeshError as error:
        raise MeshError(f"{path}: {error}") from None
    creases, ignored = _creases(soup, result.mesh)
    return LoadedMesh(
        mesh=result.mesh,
        report=result.report,
        path=Path(path),
        polygons=int((soup.sizes > 3).sum()),
        ignored_faces=int((soup.sizes < 3).sum()),
        vertex_source=result.vertex_source,
        face_source=cut.source[result.face_source],
        crease_edges=creases,
        ignored_lines=ignored,
    )


def _creases(soup: PolygonSoup, mesh: TriMesh) -> tuple[Ints | None, int]:
    """Edges of the mesh at the places of the soup's line elements, and how many lines have none.

    Places, not numbers, are compared: welded and split vertices find their lines all the same.
    """
    if len(soup.lines) == 0:
        return None, 0
    n = len(soup.vertices)
    place = position_classes(np.concatenate([soup.vertices, mesh.vertices]))
    size = np.int64(len(place))

    def keys(pairs: Ints) -> Ints:
        a, b = place[pairs].T
        return np.asarray(np.minimum(a, b) * size + np.maximum(a, b))

    wanted, have = keys(soup.lines), keys(mesh.edges + n)
    return mesh.edges[np.isin(have, wanted)], int((~np.isin(wanted, have)).sum())

"""What a file offers for training: quads, or triangles, perhaps with a field or quads beside."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from vhquad.errors import MeshError
from vhquad.field.cross import CrossField
from vhquad.field.io import read_field
from vhquad.field.transport import to_vertices
from vhquad.learn.pairs import quads_beside, read_pair
from vhquad.mesh.io import read_polygons
from vhquad.mesh.load import load
from vhquad.mesh.triangle import TriMesh

__all__ = ["Part", "read_source"]

FIELD_SUFFIXES = (".ffield", ".vfield", ".rosy", ".rawfield", ".dmat")
LEAST_QUADS = 50
LEAST_SHARE = 0.05  # of the area; smaller components (buttons, eyelashes) are left out


@dataclass(frozen=True, eq=False)
class Part:
    """One connected surface of a file: either quads, or a triangle mesh with or without a field.

    Attributes
    ----------
    files : tuple of Path
        Files it was read from.
    suffix : str
        Tells the parts of a file apart; empty if there is one.
    vertices : (n, 3) float64 or None
    quads : (k, 4) int64 or None
    mesh : TriMesh or None
    field : CrossField or None
        On the vertices of ``mesh``.
    """

    files: tuple[Path, ...]
    suffix: str = ""
    vertices: NDArray[np.float64] | None = None
    quads: NDArray[np.int64] | None = None
    mesh: TriMesh | None = None
    field: CrossField | None = None


def read_source(path: Path) -> list[Part]:
    """Read a file and say what it offers; at least one part.

    Raises
    ------
    VhquadError
        If it cannot be used, and why.
    """
    soup = read_polygons(path)
    if (soup.sizes == 4).all():
        quads = quads_beside(path)
        if quads is not None:
            raise MeshError(f"it holds quads, and so does {quads.name}; rename one of them")
        return _quad_parts(path, soup.vertices, soup.of_size(4)[0])
    if (soup.sizes == 3).all():
        return [_triangle_part(path, soup.vertices, soup.of_size(3)[0])]
    share = 100.0 * (soup.sizes == 4).mean()
    raise MeshError(
        f"only {share:.1f} % of the faces are quads; all of them must be (one Catmull-Clark step "
        "in a modeller gives that), or all triangles"
    )


def _quad_parts(path: Path, vertices: NDArray[np.float64], quads: NDArray[np.int64]) -> list[Part]:
    degenerate = (np.diff(np.sort(quads, axis=1), axis=1) == 0).any(axis=1)
    quads = quads[~degenerate]
    n = len(vertices)
    links = coo_matrix(
        (np.ones(quads.size), (quads.reshape(-1), np.roll(quads, 1, axis=1).reshape(-1))), (n, n)
    )
    label = connected_components(links, directed=False)[1][quads[:, 0]]
    corners = vertices[quads]
    diagonals = np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])
    area = np.bincount(label, weights=0.5 * np.linalg.norm(diagonals, axis=1))
    count = np.bincount(label)
    good = np.flatnonzero((area >= LEAST_SHARE * area.sum()) & (count >= LEAST_QUADS))
    if len(good) == 0:
        raise MeshError(f"no component has {LEAST_QUADS} quads")
    parts = []
    for place, one in enumerate(good):
        used, local = np.unique(quads[label == one], return_inverse=True)
        suffix = f".c{place}" if len(good) > 1 else ""
        parts.append(Part((path,), suffix, vertices[used], local.reshape(-1, 4).astype(np.int64)))
    return parts


def _triangle_part(path: Path, vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> Part:
    beside = [path.with_suffix(s) for s in FIELD_SUFFIXES if path.with_suffix(s).exists()]
    quads = quads_beside(path)
    if quads is not None:
        if beside:
            raise MeshError(f"{beside[0].name} and {quads.name} lie beside it; keep one of them")
        mesh, field = read_pair(path, quads)
        return Part((path, quads), mesh=mesh, field=field)
    if not beside:
        mesh = load(path).mesh
        if mesh.n_components > 1:
            areas = np.bincount(mesh.face_component, weights=mesh.face_areas)
            mesh, _ = mesh.submesh(mesh.face_component == areas.argmax())
        return Part((path,), mesh=mesh)
    mesh = TriMesh(vertices, faces)  # a field counts its faces: the mesh must be used as it is
    if not mesh.has_manifold_vertices or mesh.n_components > 1:
        raise MeshError(
            f"with a field ({beside[0].name}) the mesh must be one manifold piece as it is"
        )
    field = read_field(beside[0], mesh)
    if field.domain == "faces":
        field = to_vertices(mesh, field)
    return Part((path, beside[0]), mesh=mesh, field=field)

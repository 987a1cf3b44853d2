"""Cross fields to files and back; the suffix gives the format (``vhquad.field.formats``).

A file holds vectors in space; a field holds fourth powers in tangent frames. On the way in, vectors
are projected to the tangent plane and the directions of an element are averaged as fourth powers.
Lengths are sizes where the format keeps lengths; a file in which every length is 1 has no sizes.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from vhquad.atomic import write_atomic
from vhquad.errors import FieldError
from vhquad.field.cross import CrossField, Domain
from vhquad.field.formats import READERS, WRITERS, Rows
from vhquad.field.transport import to_faces, to_vertices
from vhquad.geometry.frames import Axes, face_axes, from_3d, to_3d, vertex_axes
from vhquad.mesh.triangle import TriMesh

__all__ = ["FORMAT_LOSSES", "read_field", "write_field"]

Complexes = NDArray[np.complex128]
Floats = NDArray[np.float64]

FORMAT_LOSSES: dict[str, str] = {
    ".ffield": "sizes and confidences are not kept",
    ".vfield": "sizes and confidences are not kept",
    ".rosy": "sizes and confidences are not kept",
    ".rawfield": "confidences are not kept",
    ".dmat": "confidences are not kept",
}
"""What each format that can be written loses, as text."""

DOMAINS: dict[str, Domain] = {".ffield": "faces", ".vfield": "vertices", ".rosy": "faces"}
KEEPS_LENGTH = (".rawfield", ".dmat")
NO_SIZE = 1e-12  # lengths this close to 1 all over say nothing
LARGEST = 1e150  # squares must stay finite
FLAT = 1e-6  # shares of a vector's length in the tangent plane below this are no direction


def write_field(
    path: str | os.PathLike[str],
    mesh: TriMesh,
    field: CrossField,
    domain: Literal["faces", "vertices"] | None = None,
) -> None:
    """Write a field, whole or not at all; see ``FORMAT_LOSSES`` for what is lost.

    Parameters
    ----------
    path : path
        Ends in .ffield, .rosy (faces), .vfield (vertices), .rawfield or .dmat.
    mesh : TriMesh
    field : CrossField
        Brought to faces or vertices as the format wants it.
    domain : "faces" or "vertices", optional
        For .rawfield and .dmat, which serve both. Default: faces.

    Raises
    ------
    FieldError
        If the suffix is not known, the field is not one of this mesh, or a cross is zero.
    """
    path = Path(path)
    suffix = _suffix(path, tuple(WRITERS))
    fixed = DOMAINS.get(suffix)
    if fixed is not None and domain not in (None, fixed):
        raise FieldError(f"{suffix} files hold a cross for each of the {fixed}, not {domain}")
    field = _at(mesh, field, fixed or domain or "faces")
    lost = np.flatnonzero(field.z == 0)
    if lost.size:
        raise FieldError(
            f"{lost.size} of the {len(field)} {field.domain} have no direction, the first is "
            f"{lost[0]}; fill them by vhquad.field.smooth.polish before writing"
        )
    u = np.exp(1j * field.angle)
    if field.size is not None and suffix in KEEPS_LENGTH:
        bare = np.flatnonzero(field.size <= 0)
        if bare.size:
            raise FieldError(f"{bare.size} sizes are zero, the first at {bare[0]}")
        u = u * field.size
    four = u[:, None] * np.array([1, 1j, -1, -1j])
    write_atomic(path, WRITERS[suffix](to_3d(four, _axes(mesh, field.domain))))


def read_field(path: str | os.PathLike[str], mesh: TriMesh) -> CrossField:
    """Read a field of a mesh.

    Parameters
    ----------
    path : path
        Ends in .ffield, .vfield, .rosy, .rawfield, .dmat, or .txt (as NeurCross writes it).
    mesh : TriMesh
        The mesh that the file was written for, faces and vertices in the same order.

    Returns
    -------
    CrossField
        On faces, or on vertices if the format says so; for .rawfield and .dmat the number of rows
        decides (faces, if there are as many vertices).

    Raises
    ------
    FieldError
        If the file cannot be read, its count does not fit the mesh, or a direction is NaN, zero or
        perpendicular to the surface.
    """
    path = Path(path)
    suffix = _suffix(path, tuple(READERS))
    try:
        rows = READERS[suffix](path)
    except OSError as error:
        raise FieldError(f"{path} cannot be read: {error.strerror or error}") from error
    domain = _domain(path, suffix, rows, mesh)
    directions = _in_order(path, rows)
    size_of = np.abs(directions).max(axis=(1, 2))
    _refuse(path, domain, ~(size_of < LARGEST), "is not finite")
    u = from_3d(directions, _axes(mesh, domain))
    length = np.linalg.norm(directions, axis=2)
    _refuse(path, domain, (length == 0).any(axis=1), "is zero")
    beside = (np.abs(u) < FLAT * length).any(axis=1)
    _refuse(path, domain, beside, "is perpendicular to the surface")

    unit = u / np.abs(u)
    z = (unit**4).mean(axis=1)
    z = np.where(np.abs(z) > 1e-6, z, unit[:, 0] ** 4)  # 45 degrees apart: the first decides
    size = None
    if suffix in KEEPS_LENGTH and not np.allclose(length, 1.0, rtol=0.0, atol=NO_SIZE):
        size = np.exp(np.log(length).mean(axis=1))
    return CrossField(domain, z, size)


def _suffix(path: Path, known: tuple[str, ...]) -> str:
    suffix = path.suffix.lower()
    if suffix not in known:
        raise FieldError(
            f"{path}: fields end in {', '.join(known)}, not in {suffix or 'nothing'!r}"
        )
    return suffix


def _at(mesh: TriMesh, field: CrossField, domain: Domain) -> CrossField:
    return to_faces(mesh, field) if domain == "faces" else to_vertices(mesh, field)


def _axes(mesh: TriMesh, domain: Domain) -> Axes:
    return face_axes(mesh) if domain == "faces" else vertex_axes(mesh)


def _domain(path: Path, suffix: str, rows: Rows, mesh: TriMesh) -> Domain:
    """Where the rows belong, by format and count."""
    counts: dict[Domain, int] = {"faces": mesh.n_faces, "vertices": mesh.n_vertices}
    if suffix == ".txt":
        counts.pop("vertices")
    elif suffix in DOMAINS:
        counts = {DOMAINS[suffix]: counts[DOMAINS[suffix]]}
    for domain, count in counts.items():
        if len(rows.directions) == count:
            return domain
    expected = " and ".join(f"{count} {domain}" for domain, count in counts.items())
    place = f"{path}, line {rows.line}" if rows.line else f"{path}"
    raise FieldError(
        f"{place}: the file has {len(rows.directions)} crosses, the mesh {expected}; "
        "the field must be written for this very mesh"
    )


def _in_order(path: Path, rows: Rows) -> Floats:
    """The directions by element, for files that number their rows."""
    if rows.element is None:
        return rows.directions
    order = np.argsort(rows.element, kind="stable")
    wrong = np.flatnonzero(rows.element[order] != np.arange(len(order)))
    if wrong.size:
        raise FieldError(
            f"{path}: the first column must name each element from 0 to {len(order) - 1} once; "
            f"{wrong[0]} is missing"
        )
    return rows.directions[order]


def _refuse(path: Path, domain: Domain, bad: NDArray[np.bool_], what: str) -> None:
    which = np.flatnonzero(bad)
    if which.size:
        name = "face" if domain == "faces" else "vertex"
        raise FieldError(
            f"{path}: {which.size} directions cannot be used; that of {name} {which[0]} {what}"
        )

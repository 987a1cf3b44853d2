"""From a triangle mesh and a cross field to quads: sizes, symmetry, components, report.

Every component is remeshed by itself (:mod:`vhquad.quad.component`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vhquad.errors import ConfigError, FieldError, ParametrizationError
from vhquad.field.cross import CrossField
from vhquad.field.density import bend_to_density
from vhquad.field.transport import to_faces
from vhquad.mesh.closest import ClosestPoints
from vhquad.mesh.quad import QuadMesh
from vhquad.mesh.quality import check_quads
from vhquad.mesh.triangle import TriMesh
from vhquad.quad.attempts import Component
from vhquad.quad.component import remesh_component
from vhquad.quad.mapping import Progress
from vhquad.quad.parts import Part, UvMap, join_quads, join_uv
from vhquad.quad.sizing import checked_density, wanted_sizes
from vhquad.quad.symmetric import SYMMETRIES, find_plane, remesh_mirrored
from vhquad.report import MeshCounts, RemeshReport, SymmetryReport
from vhquad.watch import Watch

__all__ = ["RemeshResult", "RemeshSettings", "UvMap", "remesh_mesh"]

Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

LEAST_QUADS = 6
SMALL_SHARE = 0.005  # of all quads: so much too many or too few in one component is near enough


@dataclass(frozen=True)
class RemeshSettings:
    """What to make.

    Attributes
    ----------
    target_quads : int, optional
        Wanted number of quads. Default: what the sizes of the field amount to, else 4,000.
    edge_length : float, optional
        Mean quad edge length instead of a count, in units of the mesh.
    crease : float or None
        Edges sharper than this angle (degrees) become edges of quads; None for none.
    adaptivity : float
        0 for uniform quads, 1 for the sizes of the field, anything between.
    symmetry : str
        "x", "y" or "z" for quads that are their own mirror image in the best plane across that
        axis, "auto" for the best plane of all, if the mesh has one, "off".
    seed : int
        Recorded in the report; the same input, settings and seed give the same quads.
    """

    target_quads: int | None = None
    edge_length: float | None = None
    crease: float | None = 40.0
    adaptivity: float = 1.0
    symmetry: str = "off"
    seed: int = 0

    def __post_init__(self) -> None:
        if self.target_quads is not None and self.edge_length is not None:
            raise ConfigError("give --target-quads or --edge-length, not both")
        if self.target_quads is not None and self.target_quads < 1:
            raise ConfigError(f"--target-quads must be at least 1, not {self.target_quads}")
        if self.edge_length is not None and not 0 < self.edge_length < np.inf:
            raise ConfigError(f"--edge-length must be positive, not {self.edge_length}")
        if self.crease is not None and not 0 < self.crease < 180:
            raise ConfigError(f"--crease must lie between 0 and 180 degrees, not {self.crease}")
        if not 0 <= self.adaptivity <= 1:
            raise ConfigError(f"--adaptivity must lie between 0 and 1, not {self.adaptivity}")
        if self.symmetry not in SYMMETRIES:
            raise ConfigError(
                f"--symmetry must be one of {', '.join(SYMMETRIES)}, not {self.symmetry!r}"
            )


@dataclass(frozen=True, eq=False)
class RemeshResult:
    """Quads, the report of how they were made, and their map on the input if it was asked for."""

    quads: QuadMesh
    report: RemeshReport
    uv: UvMap | None = None


def remesh_mesh(
    mesh: TriMesh,
    field: CrossField,
    settings: RemeshSettings | None = None,
    *,
    creases: ArrayLike | None = None,
    density: ArrayLike | None = None,
    onto: TriMesh | None = None,
    with_uv: bool = False,
    cache: bool = False,
    progress: Progress | None = None,
) -> RemeshResult:
    """Quads along a cross field.

    Parameters
    ----------
    mesh : TriMesh
        Manifold and oriented, any genus, boundaries and number of components.
    field : CrossField
        On vertices or faces; its sizes steer the density.
    settings : RemeshSettings, optional
    creases : (k, 2) array_like of int, optional
        Edges that quads must follow, instead of those found by angle.
    density : (n,) array_like, optional
        Factor on the quads per area at each vertex, positive; twice the density makes edges
        shorter by the root of two. With a count asked for only ratios matter.
    onto : TriMesh, optional
        The surface that the mesh is a decimated stand-in for, with the same components: quads are
        polished on it and judged against it. Without a symmetry only.
    with_uv : bool
        Make the integer-grid map too; with a symmetry, that of the half.
    cache : bool
        Keep continuous maps, and use those kept.
    progress : callable, optional
        Called with (step, share done).

    Raises
    ------
    FieldError
        If the field does not fit the mesh.
    ConfigError
        If the density does not.
    MeshError
        If a symmetry is asked for whose plane leaves no half to mirror.
    """
    settings = settings or RemeshSettings()
    if onto is not None and settings.symmetry != "off":
        raise ConfigError("a stand-in cannot be mirrored; leave out --symmetry or onto")
    original = mesh if onto is None else onto
    surface = ClosestPoints(original)
    watch = Watch()
    if field.domain == "vertices":
        if len(field) != mesh.n_vertices:
            raise FieldError(
                f"the field has {len(field)} crosses, the mesh {mesh.n_vertices} vertices"
            )
        field = to_faces(mesh, field)
    if len(field) != mesh.n_faces:
        raise FieldError(f"the field has {len(field)} crosses, the mesh {mesh.n_faces} faces")
    factor = None if density is None else checked_density(density, mesh.n_vertices)
    wanted = wanted_sizes(
        mesh,
        field,
        adaptivity=settings.adaptivity,
        density=factor,
        target_quads=settings.target_quads,
        edge_length=settings.edge_length,
    )
    field = replace(field, size=wanted.relative)
    if factor is not None:
        field = bend_to_density(mesh, field, factor, float(np.sqrt(mesh.area / wanted.quads)))
    given = None if creases is None else np.asarray(creases, dtype=np.int64).reshape(-1, 2)
    wish = _Wish(
        settings=settings,
        scale=wanted.scale,
        density=factor is not None,
        with_uv=with_uv,
        cache=cache,
        progress=progress,
    )
    result, parts, symmetry = _remesh(mesh, field, given, surface, wish, watch)
    with watch("check"):
        quality = check_quads(result, surface)
    seconds = dict(watch.seconds)
    for part in parts:
        for step, value in part.report.seconds.items():
            seconds[step] = seconds.get(step, 0.0) + value
    report = RemeshReport(
        asked=wanted.quads,
        made=result.n_quads,
        input=MeshCounts.of(original),
        output=MeshCounts.of(result),
        quality=quality,
        components=tuple(part.report for part in parts),
        symmetry=symmetry,
        stand_in=None if onto is None else mesh.n_faces,
        seconds=seconds,
        settings={name: getattr(settings, name) for name in RemeshSettings.__dataclass_fields__},
    )
    return RemeshResult(result, report, join_uv([part.uv for part in parts]))


@dataclass(frozen=True)
class _Wish:
    """What is wanted of the quads of all parts alike.

    Attributes
    ----------
    settings : RemeshSettings
    scale : float
        What makes edge lengths of the sizes of the field.
    density : bool
        Whether the sizes follow a density that was asked for.
    with_uv, cache, progress
        As in :func:`remesh_mesh`.
    """

    settings: RemeshSettings
    scale: float
    density: bool
    with_uv: bool
    cache: bool
    progress: Progress | None


def _remesh(
    mesh: TriMesh,
    field: CrossField,
    given: Ints | None,
    surface: ClosestPoints,
    wish: _Wish,
    watch: Watch,
) -> tuple[QuadMesh, list[Part], SymmetryReport | None]:
    """Quads of the whole mesh; of one half and its mirror image, if there is a plane for it."""

    def remesh_parts(
        half: TriMesh, own: CrossField, creases: Ints | None, seam: Bools | None
    ) -> list[Part]:
        onto = surface if half is mesh else ClosestPoints(half)
        return _remesh_parts(half, own, creases, seam, onto, wish)

    symmetry: SymmetryReport | None = None
    if wish.settings.symmetry != "off":
        with watch("symmetry"):
            plane, symmetry = find_plane(mesh, wish.settings.symmetry)
        if plane is not None:
            try:
                mirrored = remesh_mirrored(mesh, field, given, plane, remesh_parts)
                symmetry = replace(symmetry, doubled=mirrored.doubled)
                return mirrored.quads, mirrored.parts, symmetry
            except ParametrizationError as problem:
                symmetry = symmetry.given_up(str(problem))
    parts = remesh_parts(mesh, field, given, None)
    return join_quads([part.quads for part in parts]), parts, symmetry


def _remesh_parts(
    mesh: TriMesh,
    field: CrossField,
    given: Ints | None,
    seam: Bools | None,
    surface: ClosestPoints,
    wish: _Wish,
) -> list[Part]:
    """Quads of every component by itself; the field has relative sizes, the surface all parts."""
    settings, progress = wish.settings, wish.progress
    size = np.ones(mesh.n_faces) if field.size is None else field.size
    density = mesh.face_areas / (size * wish.scale) ** 2
    slack = SMALL_SHARE * float(density.sum())
    parts: list[Part] = []
    n_parts = mesh.n_components
    for number in range(n_parts):

        def tell(step: str, share: float, number: int = number) -> None:
            if progress is not None:
                progress(step, (number + share) / n_parts)

        inside = mesh.face_component == number
        part, used = mesh.submesh(inside)
        local = np.full(mesh.n_vertices, -1)
        local[used] = np.arange(len(used))
        own: Ints | None = None
        if given is not None:
            own = local[given]
            own = own[(own >= 0).all(axis=1)]
        part_field = CrossField(
            "faces",
            field.z[inside],
            size[inside],
            None if field.confidence is None else field.confidence[inside],
        )
        target = max(round(float(density[inside].sum())), LEAST_QUADS)
        edge = None if seam is None else seam.reshape(-1, 3)[inside].reshape(-1)
        whole = part
        if surface.mesh is not mesh:
            whole, _ = surface.mesh.submesh(surface.mesh.face_component == number)
        onto = surface if whole is surface.mesh else ClosestPoints(whole)
        parts.append(
            remesh_component(
                Component(
                    mesh=part,
                    field=part_field,
                    surface=onto,
                    target=target,
                    slack=slack,
                    creases=own,
                    crease_angle=settings.crease,
                    seam=edge,
                    density=wish.density,
                    adaptivity=settings.adaptivity,
                    cache=wish.cache,
                ),
                wish.with_uv,
                tell,
            )
        )
    return parts

"""From a triangle mesh and a cross field to quads: every component by itself, valid in the end.

For each component the field is aligned (:mod:`vhquad.field.align`), turned into a seamless map
(:mod:`vhquad.quad.seamless_map`), cut into rectangles (:mod:`vhquad.quad.tmesh`), quantised
(:mod:`vhquad.quad.quantize`), laid on the surface (:mod:`vhquad.quad.embed`) and polished
(:mod:`vhquad.quad.smooth`). Where no valid map is found the field is smoothed further, then
creases are given up, and at last triangles are paired (:mod:`vhquad.quad.fallback`).
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vhquad.errors import ConfigError, FieldError, ParametrizationError
from vhquad.field.align import AlignedField, AlignSettings, align_field
from vhquad.field.creases import TOGETHER, creases_for_quads
from vhquad.field.cross import CrossField
from vhquad.field.density import bend_to_density
from vhquad.field.transport import to_faces
from vhquad.mesh.closest import ClosestPoints
from vhquad.mesh.quad import QuadMesh
from vhquad.mesh.quality import check_quads, scaled_jacobians
from vhquad.mesh.triangle import TriMesh
from vhquad.quad.curves import CurveConstraints
from vhquad.quad.embed import embed_layout
from vhquad.quad.fallback import triangles_to_quads
from vhquad.quad.integer_map import integer_map
from vhquad.quad.layout import Layout
from vhquad.quad.motorcycle import Tracing, trace
from vhquad.quad.parts import Part, UvMap, join_quads, join_uv
from vhquad.quad.quantize import quantise
from vhquad.quad.seamless_map import SeamlessMap, solve_seamless_map
from vhquad.quad.sizing import checked_density, wanted_sizes
from vhquad.quad.smooth import smooth_quads
from vhquad.quad.symmetric import SYMMETRIES, find_plane, remesh_mirrored
from vhquad.quad.tmesh import build_tmesh
from vhquad.report import ComponentReport, MeshCounts, RemeshReport, SymmetryReport

__all__ = ["RemeshResult", "RemeshSettings", "UvMap", "remesh_mesh"]

Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

LEAST_QUADS = 6
NEAR_COUNT = 1.10
SMALL_SHARE = 0.005  # of all quads: so much too many or too few in one component is near enough

MOST_POLISHED = 2  # attempts, while quads stay folded

Progress = Callable[[str, float], None]


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


@dataclass(frozen=True, eq=False)
class _Mapped:
    """Quads from a map, with what made them."""

    quads: QuadMesh
    aligned: AlignedField
    seamless: SeamlessMap
    tracing: Tracing
    layout: Layout

    def uv(self) -> UvMap:
        """The integer-grid map of the layout."""
        made = integer_map(
            self.aligned, self.seamless, self.tracing, self.layout.tmesh, self.layout
        )
        return UvMap(made.mesh, made.uv, made.flips)


@dataclass
class _Watch:
    """Seconds by step."""

    seconds: dict[str, float] = field(default_factory=dict)

    @contextmanager
    def __call__(self, step: str) -> Iterator[None]:
        start = time.perf_counter()
        try:
            yield
        finally:
            self.seconds[step] = self.seconds.get(step, 0.0) + time.perf_counter() - start


def remesh_mesh(
    mesh: TriMesh,
    field: CrossField,
    settings: RemeshSettings | None = None,
    *,
    creases: ArrayLike | None = None,
    density: ArrayLike | None = None,
    onto: TriMesh | None = None,
    with_uv: bool = False,
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
    watch = _Watch()
    if field.domain == "vertices":
        if len(field) != mesh.n_vertices:
            raise FieldError(
                f"the field has {len(field)} crosses, the mesh {mesh.n_vertices} vertices"
            )
        field = to_faces(mesh, field)
    if len(field) != mesh.n_faces:
        raise FieldError(f"the field has {len(field)} crosses, the mesh {mesh.n_faces} faces")
    factor = None if density is None else checked_density(density, mesh.n_vertices)
    size, asked = wanted_sizes(
        mesh,
        field,
        adaptivity=settings.adaptivity,
        density=factor,
        target_quads=settings.target_quads,
        edge_length=settings.edge_length,
    )
    field = replace(field, size=size)
    if factor is not None:
        field = bend_to_density(mesh, field, factor, float(np.sqrt(mesh.area / asked)))
    given = None if creases is None else np.asarray(creases, dtype=np.int64).reshape(-1, 2)
    result, parts, symmetry = _remesh(
        mesh, field, given, settings, original, with_uv, watch, progress
    )
    with watch("check"):
        quality = check_quads(result, original)
    seconds = dict(watch.seconds)
    for part in parts:
        for step, value in part.report.seconds.items():
            seconds[step] = seconds.get(step, 0.0) + value
    report = RemeshReport(
        asked=asked,
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


def _remesh(
    mesh: TriMesh,
    field: CrossField,
    given: Ints | None,
    settings: RemeshSettings,
    original: TriMesh,
    with_uv: bool,
    watch: _Watch,
    progress: Progress | None,
) -> tuple[QuadMesh, list[Part], SymmetryReport | None]:
    """Quads of the whole mesh; of one half and its mirror image, if there is a plane for it."""

    def remesh_parts(
        half: TriMesh, own: CrossField, creases: Ints | None, seam: Bools | None
    ) -> list[Part]:
        surface = original if half is mesh else half
        return _remesh_parts(half, own, creases, seam, settings.crease, surface, with_uv, progress)

    symmetry: SymmetryReport | None = None
    if settings.symmetry != "off":
        with watch("symmetry"):
            plane, symmetry = find_plane(mesh, settings.symmetry)
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
    angle: float | None,
    original: TriMesh,
    with_uv: bool,
    progress: Progress | None,
) -> list[Part]:
    """Quads of every component by itself; the field has the sizes wanted."""
    size = np.ones(mesh.n_faces) if field.size is None else field.size
    density = mesh.face_areas / size**2
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
        if original is not mesh:
            whole, _ = original.submesh(original.face_component == number)
        surface = ClosestPoints(whole)
        parts.append(
            _remesh_part(part, part_field, own, edge, angle, target, slack, surface, with_uv, tell)
        )
    return parts


@dataclass(frozen=True)
class _Attempt:
    """One way to try; lengths are in wanted quad edges.

    ``smoothing``: detail of the field below this is smoothed away. ``crease_length``: creases must
    hang together over this length; None: no creases.
    """

    name: str
    smoothing: float
    crease_length: float | None

    def creases(
        self, mesh: TriMesh, given: Ints | None, angle: float | None, length: float
    ) -> Ints:
        """Crease edges of a component that this attempt keeps."""
        if self.crease_length is None:
            return np.zeros((0, 2), dtype=np.int64)
        if given is not None:
            return given
        if angle is None:
            return np.zeros((0, 2), dtype=np.int64)
        return creases_for_quads(mesh, angle, length, self.crease_length)


MAP, PAIRED = "integer-grid map", "paired triangles"
_ATTEMPTS = (
    _Attempt(MAP, 0.5, TOGETHER),
    _Attempt(f"{MAP}, smoother field", 1.5, 8.0),
    _Attempt(f"{MAP}, no creases", 1.5, None),
    _Attempt(f"{MAP}, no creases, smoothest field", 5.0, None),
)


def _remesh_part(
    mesh: TriMesh,
    field: CrossField,
    given: Ints | None,
    seam: Bools | None,
    angle: float | None,
    target: int,
    slack: float,
    surface: ClosestPoints,
    with_uv: bool,
    tell: Progress,
) -> Part:
    """Quads of one component by the first attempt that gives a valid mesh of about the count.

    If some of them stay folded, another attempt may do better.

    Within ``slack`` quads any count is near enough.
    """
    watch = _Watch()
    length = float(np.sqrt(mesh.area / target))
    reasons: list[str] = []
    rough: list[tuple[float, _Mapped, str]] = []  # of another count than asked for
    done: list[tuple[int, _Mapped, QuadMesh, str]] = []
    for attempt in _ATTEMPTS:
        creases = attempt.creases(mesh, given, angle, length)
        try:
            mapped = _by_map(mesh, field, creases, seam, target, attempt, watch, tell)
        except (ParametrizationError, FieldError) as problem:
            reasons.append(str(problem))
            continue
        made = mapped.quads.n_quads
        miss = abs(np.log(made / target))
        if miss > np.log(NEAR_COUNT) and abs(made - target) > slack:
            rough.append((miss, mapped, attempt.name))
            reasons.append(f"{made} quads where {target} were asked for")
            continue
        quads = _polished(mapped, surface, watch, tell)
        folded = int((scaled_jacobians(quads) <= 0).any(axis=1).sum())
        done.append((folded, mapped, quads, attempt.name))
        if folded == 0 or len(done) == MOST_POLISHED:
            break
        reasons.append(f"{folded} quads stay folded")
    if rough and not done:
        _, mapped, name = min(rough, key=lambda found: found[0])
        done.append((0, mapped, _polished(mapped, surface, watch, tell), name))
    uv: UvMap | None = None
    if done:
        _, mapped, quads, method = min(done, key=lambda found: found[0])
        aligning = mapped.aligned.report
        singularities, cancelled = aligning.singularities, aligning.pairs_cancelled
        if with_uv:
            with watch("integer-grid map"):
                uv = mapped.uv()
    else:
        with watch("fallback"):
            quads = triangles_to_quads(mesh, target, angle=field.angle)
        method, singularities, cancelled = PAIRED, {}, 0
    tell("done", 1.0)
    report = ComponentReport(
        vertices=mesh.n_vertices,
        faces=mesh.n_faces,
        target=target,
        made=quads.n_quads,
        method=method,
        reason="" if method == MAP else "; ".join(dict.fromkeys(reasons)),
        singularities=singularities,
        cancelled=cancelled,
        seconds=dict(watch.seconds),
    )
    return Part(quads, report, uv)


def _by_map(
    mesh: TriMesh,
    field: CrossField,
    creases: Ints,
    seam: Bools | None,
    target: int,
    attempt: _Attempt,
    watch: _Watch,
    tell: Progress,
) -> _Mapped:
    """Quads by an integer-grid map, their vertices where the map has them.

    Raises
    ------
    ParametrizationError, FieldError
        If there is no valid map, or its quads are not a valid mesh of the input's topology.
    """
    tell("align the field", 0.0)
    length = float(np.sqrt(mesh.area / target))
    with watch("align"):
        settings = AlignSettings(edge_length=length, smoothing=attempt.smoothing)
        aligned = align_field(mesh, field, creases, settings, seam)
    tell("map", 0.15)
    with watch("map"):
        seamless = solve_seamless_map(aligned)
    if not seamless.is_valid:
        raise ParametrizationError(
            f"{seamless.flips} triangles of the map stay folded after {seamless.solves} solves"
        )
    tell("quantise", 0.5)
    with watch("quantise"):
        tracing = trace(aligned, seamless)
        tmesh = build_tmesh(aligned, seamless, tracing)
        layout = quantise(tmesh, target, seamless.area).layout
    tell("lay out", 0.7)
    with watch("lay out"):
        vertices = embed_layout(layout, aligned, seamless)
    quads = QuadMesh(vertices, layout.quads)
    _require_topology(quads, mesh)
    return _Mapped(quads, aligned, seamless, tracing, layout)


def _polished(mapped: _Mapped, surface: ClosestPoints, watch: _Watch, tell: Progress) -> QuadMesh:
    """The quads with their vertices moved on the surface to even shapes and sizes."""
    tell("polish", 0.75)
    quads = mapped.quads
    with watch("polish"):
        fixed, curves = _constraints(mapped.layout)
        moved = smooth_quads(quads.vertices, quads.quads, surface, fixed, curves, loosen=True)
    return QuadMesh(moved, quads.quads)


def _require_topology(quads: QuadMesh, mesh: TriMesh) -> None:
    if not quads.is_manifold or len(quads.degenerate_quads):
        raise ParametrizationError("the quads of the map do not form a manifold")
    made, wanted = MeshCounts.of(quads).topology, MeshCounts.of(mesh).topology
    if made != wanted:
        raise ParametrizationError(
            f"the quads of the map have (components, Euler characteristic, boundary loops) {made} "
            f"instead of {wanted}"
        )


def _constraints(layout: Layout) -> tuple[NDArray[np.bool_], CurveConstraints]:
    """Vertices that the polish must not move, and the feature curves on which others slide."""
    tmesh = layout.tmesh
    curve = np.full(layout.n_vertices, -1, dtype=np.int64)
    on = np.flatnonzero(tmesh.node_feature >= 0)
    curve[layout.vertex_of[on]] = tmesh.node_feature[on]
    for a, arc in enumerate(tmesh.arcs):
        if arc.feature >= 0:
            curve[layout.vertex_of[layout.half_arc_points(2 * a)]] = arc.feature
    fixed = np.zeros(layout.n_vertices, dtype=bool)
    fixed[layout.vertex_of[np.flatnonzero(tmesh.node_fixed)]] = True
    curve[fixed] = -1
    closed = [bool(np.array_equal(c[0], c[-1])) for c in tmesh.curves]
    lines = [c[:-1] if loop else c for c, loop in zip(tmesh.curves, closed, strict=True)]
    return fixed, CurveConstraints(lines, closed, curve)

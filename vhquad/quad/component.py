"""Quads of one component: what is tried in turn until a valid mesh of about the count is there.

The field is aligned and turned into a seamless map (:mod:`vhquad.quad.continuous`), cut into
rectangles (:mod:`vhquad.quad.tmesh`), quantised (:mod:`vhquad.quad.quantize`), laid on the surface
(:mod:`vhquad.quad.embed`), polished (:mod:`vhquad.quad.smooth`) with tips held
(:mod:`vhquad.quad.tips`) and no limb laid bare (:mod:`vhquad.quad.limbs`), and freed of the last
folds (:mod:`vhquad.quad.lift`). At last edges come as near to creases as they can: to those that
the layout left out (:mod:`vhquad.quad.attach`) and to those it follows
(:mod:`vhquad.quad.straddle`). Where no valid map is found the field is smoothed further, then
creases are given up, those beside folds first, and at last triangles paired
(:mod:`vhquad.quad.fallback`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from vhquad.errors import FieldError, ParametrizationError
from vhquad.field.align import AlignedField, AlignReport
from vhquad.field.creases import TOGETHER, creases_for_quads
from vhquad.field.cross import CrossField
from vhquad.field.features import sharp_edges
from vhquad.field.grow import are_mostly_creases
from vhquad.mesh.closest import ClosestPoints
from vhquad.mesh.quad import QuadMesh
from vhquad.mesh.triangle import TriMesh
from vhquad.quad.attach import attach_to_creases
from vhquad.quad.continuous import MapInput
from vhquad.quad.counts import map_quads, narrow_map_quads
from vhquad.quad.curves import CurveConstraints
from vhquad.quad.embed import embed_layout
from vhquad.quad.fallback import triangles_to_quads
from vhquad.quad.guide import FieldGuide
from vhquad.quad.integer_map import integer_map
from vhquad.quad.layout import Layout
from vhquad.quad.lift import lifted
from vhquad.quad.limbs import Covering, polished_onto_limbs
from vhquad.quad.motorcycle import Tracing, trace
from vhquad.quad.parts import Part, UvMap
from vhquad.quad.quantize import quantise
from vhquad.quad.seamless_map import SIZE_WEIGHT, SeamlessMap, twice_area
from vhquad.quad.smooth import smooth_quads
from vhquad.quad.straddle import straddled
from vhquad.quad.tips import put_on_tips
from vhquad.quad.tmesh import build_tmesh
from vhquad.report import MAP, ComponentReport, MeshCounts
from vhquad.watch import Watch

__all__ = ["MAP", "PAIRED", "Component", "Progress", "remesh_component"]

Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]
Floats = NDArray[np.float64]

NEAR_COUNT = 1.10  # a factor from the count asked for
MOST_POLISHED = 2  # attempts, while quads stay folded
_BESIDE = 0.5  # wanted quad edges between a crease that is given up and a folded triangle

Progress = Callable[[str, float], None]


@dataclass(frozen=True, eq=False)
class _Mapped:
    """Quads from a map, with what made them."""

    quads: QuadMesh
    aligned: AlignedField
    seamless: SeamlessMap
    tracing: Tracing
    layout: Layout
    method: str
    creases: Ints

    def miss(self, target: int) -> float:
        """How far the count is off, as the logarithm of a factor."""
        return float(abs(np.log(self.quads.n_quads / target)))

    def uv(self) -> UvMap:
        """The integer-grid map of the layout."""
        made = integer_map(
            self.aligned, self.seamless, self.tracing, self.layout.tmesh, self.layout
        )
        return UvMap(made.mesh, made.uv, made.flips)


@dataclass(frozen=True)
class _Attempt:
    """One way to try; lengths are in wanted quad edges.

    ``smoothing``: detail of the field below this is smoothed away. ``cancel``: opposite
    singularities closer than this are cancelled; where those of fingers and folds must all stay
    apart, that takes more quads than were asked for. ``crease_length``: creases must hang together
    over this length; None: no creases.
    """

    name: str
    smoothing: float
    cancel: float
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


class _FoldedMap(ParametrizationError):
    """No valid map; ``places`` are the corners of its folded triangles, (k, 3)."""

    def __init__(self, message: str, places: Floats) -> None:
        super().__init__(message)
        self.places = places


PAIRED = "paired triangles"
_ATTEMPTS = (
    _Attempt(MAP, 0.5, 0.5, TOGETHER),
    _Attempt(f"{MAP}, smoother field", 1.5, 1.0, 8.0),
    _Attempt(f"{MAP}, no creases", 1.5, 1.0, None),
    _Attempt(f"{MAP}, no creases, smoothest field", 5.0, 2.0, None),
)


@dataclass(frozen=True, eq=False)
class Component:
    """A connected surface, and what is wanted of its quads.

    Attributes
    ----------
    mesh : TriMesh
        Connected.
    field : CrossField
        On its faces, with sizes.
    surface : ClosestPoints
        What the quads are to lie on: the mesh, or the finer one that it stands for.
    target : int
        Quads.
    slack : float
        Within so many quads of the target any count is near enough.
    creases : (k, 2) int64 or None
        Edges that were given as creases; None: those at which faces turn by ``crease_angle``
        degrees, if that is no None either.
    crease_angle : float or None
    seam : (3m,) bool or None
        As in :func:`vhquad.field.align.align_field`.
    density : bool
        Whether the sizes follow a density that was asked for.
    adaptivity : float
        How far sizes follow curved creases, 0 to 1.
    cache : bool
        Keep continuous maps, and use those kept.
    """

    mesh: TriMesh
    field: CrossField
    surface: ClosestPoints
    target: int
    slack: float
    creases: Ints | None
    crease_angle: float | None
    seam: Bools | None
    density: bool
    adaptivity: float
    cache: bool

    def attempts(self) -> Iterator[tuple[_Attempt, Ints, float]]:
        """What to try in turn, with the creases kept and the quads that the map is made for.

        Nothing is tried twice where no creases are to give up.
        """
        tried: set[tuple[float, bytes]] = set()
        for attempt in _ATTEMPTS:
            quads = narrow_map_quads(self.target)
            creases = self._creases(attempt, quads)
            shared = map_quads(self.target, self.mesh.n_faces)
            free = not self.density and self.curving(creases) == 0
            if free and shared != quads:
                quads, creases = shared, self._creases(attempt, shared)
            key = (attempt.smoothing, creases.tobytes())
            if key not in tried:
                tried.add(key)
                yield attempt, creases, quads

    def _creases(self, attempt: _Attempt, quads: float) -> Ints:
        length = float(np.sqrt(self.mesh.area / quads))
        return attempt.creases(self.mesh, self.creases, self.crease_angle, length)

    def curving(self, creases: Ints) -> float:
        """How far sizes follow these creases where they are curved.

        Only on designed parts, where there are any, and they were given, or most of what is sharp
        are creases: elsewhere the doubtful ones would take the quads that shapes need.
        """
        return self.adaptivity if self._is_designed(creases) else 0.0

    def sharp(self, creases: Ints) -> Floats:
        """Ends of all edges that quads should have edges along, of a part with these creases.

        Those that were given, or all sharp ones; none unless the part was designed with creases.
        (c, 2, 3).
        """
        if not self._is_designed(creases):
            return np.zeros((0, 2, 3))
        edges = creases if self.creases is not None else self.mesh.edges[self._sharp]
        return np.asarray(self.mesh.vertices[edges])

    def _is_designed(self, creases: Ints) -> bool:
        given = self.creases is not None
        return len(creases) > 0 and (given or are_mostly_creases(self.mesh, creases, self._sharp))

    @cached_property
    def _sharp(self) -> Ints:
        """Edges sharper than the crease angle, if there is one; found once for all attempts."""
        none = np.zeros(0, dtype=np.int64)
        return none if self.crease_angle is None else sharp_edges(self.mesh, self.crease_angle)


def remesh_component(wish: Component, with_uv: bool, tell: Progress) -> Part:
    """Quads of one component by the first attempt that gives a valid mesh of about the count.

    Where quads stay folded, another attempt may do better. If none meets the count, it is the first
    whose count is about the nearest.
    """
    watch = Watch()
    target, surface = wish.target, wish.surface
    reasons: list[str] = []
    rough: list[_Mapped] = []  # of another count than asked for
    done: list[tuple[int, _Mapped, QuadMesh]] = []

    def good_enough(mapped: _Mapped) -> bool:
        """Polish an attempt; whether it is to be the last."""
        quads, wrong = _polished(mapped, surface, wish.sharp(mapped.creases), watch, tell)
        done.append((wrong, mapped, quads))
        if wrong > 0:
            reasons.append(f"{wrong} quads stay folded")
        return wrong == 0 or len(done) == MOST_POLISHED

    for attempt, creases, for_quads in wish.attempts():
        try:
            mapped = _mapped(wish, creases, attempt, for_quads, watch, tell)
        except (ParametrizationError, FieldError) as problem:
            reasons.append(str(problem))
            continue
        made = mapped.quads.n_quads
        if mapped.miss(target) > np.log(NEAR_COUNT) and abs(made - target) > wish.slack:
            rough.append(mapped)
            reasons.append(f"{made} quads where {target} were asked for")
        elif good_enough(mapped):
            break
    missed = not done
    if missed and rough:
        # The earlier an attempt, the more it keeps of the field and the creases.
        least = min(mapped.miss(target) for mapped in rough)
        for mapped in rough:
            if mapped.miss(target) <= least + np.log(NEAR_COUNT) and good_enough(mapped):
                break
    uv: UvMap | None = None
    if done:
        _, mapped, quads = min(done, key=lambda found: found[0])
        method, aligning = mapped.method, mapped.aligned.report
        if with_uv:
            with watch("integer-grid map"):
                uv = mapped.uv()
    else:
        with watch("fallback"):
            quads = triangles_to_quads(wish.mesh, target, angle=wish.field.angle)
        method, aligning = PAIRED, AlignReport(float(np.sqrt(wish.mesh.area / target)))
    tell("done", 1.0)
    report = ComponentReport(
        vertices=wish.mesh.n_vertices,
        faces=wish.mesh.n_faces,
        target=target,
        made=quads.n_quads,
        method=method,
        reason="; ".join(dict.fromkeys(reasons)) if missed or method != MAP else "",
        singularities=aligning.singularities,
        crease_corners=aligning.crease_corners,
        cancelled=aligning.pairs_cancelled,
        seconds=dict(watch.seconds),
    )
    return Part(quads, report, uv)


def _mapped(
    wish: Component,
    creases: Ints,
    attempt: _Attempt,
    for_quads: float,
    watch: Watch,
    tell: Progress,
) -> _Mapped:
    """Quads by a map; all but at first, creases beside triangles that stay folded are given up.

    Raises
    ------
    ParametrizationError, FieldError
        As :func:`_by_map` does.
    """
    try:
        return _by_map(wish, creases, attempt, for_quads, watch, tell)
    except _FoldedMap as folded:
        beside = _BESIDE * float(np.sqrt(wish.mesh.area / for_quads))
        kept = creases[~_are_near(wish.mesh.vertices[creases], folded.places, beside)]
        if attempt is _ATTEMPTS[0] or not 0 < len(kept) < len(creases):
            raise
    found = _by_map(wish, kept, attempt, for_quads, watch, tell)
    return replace(found, method=f"{MAP}, some creases")


def _are_near(edges: Floats, places: Floats, distance: float) -> Bools:
    """Which edges (c, 2, 3) come as near to some of the places (k, 3); (c,)."""
    share = np.linspace(0.0, 1.0, 9)[:, None, None]
    points = (1.0 - share) * edges[:, 0] + share * edges[:, 1]
    away = np.asarray(cKDTree(places).query(points)[0])
    return np.asarray((away < distance).any(axis=0))


def _by_map(
    wish: Component,
    creases: Ints,
    attempt: _Attempt,
    for_quads: float,
    watch: Watch,
    tell: Progress,
) -> _Mapped:
    """Quads by an integer-grid map, their vertices where the map has them.

    Raises
    ------
    ParametrizationError, FieldError
        If there is no valid map, or its quads are not a valid mesh of the input's topology.
    """
    wanted = MapInput(
        mesh=wish.mesh,
        field=wish.field,
        creases=creases,
        target=wish.target,
        quads=for_quads,
        smoothing=attempt.smoothing,
        cancel=attempt.cancel,
        seam=wish.seam,
        size_weight=1.0 if wish.density else SIZE_WEIGHT,  # who asks for a density wants it
        curving=wish.curving(creases),
    )
    continuous = wanted.solve(wish.cache, watch, tell)
    aligned, seamless = continuous.aligned, continuous.seamless
    if not seamless.is_valid:
        folded = aligned.mesh.faces[twice_area(seamless.uv) <= 0]
        raise _FoldedMap(
            f"{seamless.flips} triangles of the map stay folded after {seamless.solves} solves",
            aligned.mesh.vertices[np.unique(folded)],
        )
    tell("quantise", 0.5)
    with watch("quantise"):
        tracing = trace(aligned, seamless)
        tmesh = build_tmesh(aligned, seamless, tracing)
        layout = quantise(tmesh, wish.target, seamless.area).layout
    tell("lay out", 0.7)
    with watch("lay out"):
        vertices = embed_layout(layout, aligned, seamless)
    quads = QuadMesh(vertices, layout.quads)
    _require_topology(quads, wish.mesh)
    return _Mapped(quads, aligned, seamless, tracing, layout, attempt.name, creases)


def _polished(
    mapped: _Mapped, surface: ClosestPoints, sharp: Floats, watch: Watch, tell: Progress
) -> tuple[QuadMesh, int]:
    """The quads with their vertices moved to even shapes, on the surface but at the last folds.

    And how many stay folded.
    """
    tell("polish", 0.75)
    quads = mapped.quads
    with watch("polish"):
        fixed, curves = _constraints(mapped.layout)
        guide = FieldGuide(mapped.aligned)
        quads, fixed = put_on_tips(quads, surface.mesh, fixed, curves)

        def polish(held: Bools) -> NDArray[np.float64]:
            return smooth_quads(quads.vertices, quads.quads, surface, held, curves, guide=guide)

        moved = polished_onto_limbs(Covering(quads, surface), fixed, polish)
    with watch("unfold"):
        bound = fixed | (curves.curve >= 0)
        moved, wrong = lifted(moved, quads.quads, surface, bound)
    with watch("creases"):
        moved = attach_to_creases(moved, quads.quads, surface, fixed, curves, sharp)
        moved = straddled(moved, quads.quads, curves)
    return QuadMesh(moved, quads.quads), int(wrong.sum())


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

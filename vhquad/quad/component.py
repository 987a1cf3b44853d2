"""Quads of one component: what is tried in turn until a valid mesh of about the count is there.

An attempt (:mod:`vhquad.quad.attempts`) gives quads by a map (:mod:`vhquad.quad.mapping`). They are
polished (:mod:`vhquad.quad.smooth`) with tips held (:mod:`vhquad.quad.tips`) and no limb laid bare
(:mod:`vhquad.quad.limbs`), and freed of the last folds (:mod:`vhquad.quad.lift`). At last edges
come as near to creases as they can: to those that the layout left out (:mod:`vhquad.quad.attach`)
and to those it follows (:mod:`vhquad.quad.straddle`). Where no attempt finds a valid map, triangles
are paired (:mod:`vhquad.quad.fallback`).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vhquad.errors import FieldError, ParametrizationError
from vhquad.field.align import AlignReport
from vhquad.mesh.closest import ClosestPoints
from vhquad.mesh.quad import QuadMesh
from vhquad.quad.attach import attach_to_creases
from vhquad.quad.attempts import Component
from vhquad.quad.curves import CurveConstraints
from vhquad.quad.fallback import triangles_to_quads
from vhquad.quad.guide import FieldGuide
from vhquad.quad.layout import Layout
from vhquad.quad.lift import lifted
from vhquad.quad.limbs import Covering, polished_onto_limbs
from vhquad.quad.mapping import MappedQuads, Progress, map_to_quads
from vhquad.quad.parts import Part, UvMap
from vhquad.quad.smooth import smooth_quads
from vhquad.quad.straddle import straddled
from vhquad.quad.tips import put_on_tips
from vhquad.report import MAP, ComponentReport
from vhquad.watch import Watch

__all__ = ["PAIRED", "remesh_component"]

Bools = NDArray[np.bool_]
Floats = NDArray[np.float64]

PAIRED = "paired triangles"
NEAR_COUNT = 1.10  # a factor from the count asked for
MOST_POLISHED = 2  # attempts, while quads stay folded


def remesh_component(wish: Component, with_uv: bool, tell: Progress) -> Part:
    """Quads of one component by the first attempt that gives a valid mesh of about the count.

    Where quads stay folded, another attempt may do better. If none meets the count, it is the first
    whose count is about the nearest.
    """
    watch = Watch()
    target, surface = wish.target, wish.surface
    reasons: list[str] = []
    rough: list[MappedQuads] = []  # of another count than asked for
    done: list[tuple[int, MappedQuads, QuadMesh]] = []

    def good_enough(mapped: MappedQuads) -> bool:
        """Polish an attempt; whether it is to be the last."""
        quads, wrong = _polished(mapped, surface, wish.sharp(mapped.attempt.creases), watch, tell)
        done.append((wrong, mapped, quads))
        if wrong > 0:
            reasons.append(f"{wrong} quads stay folded")
        return wrong == 0 or len(done) == MOST_POLISHED

    for attempt in wish.attempts():
        try:
            mapped = map_to_quads(wish, attempt, watch, tell)
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
        method, aligning = mapped.attempt.name, mapped.aligned.report
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


def _polished(
    mapped: MappedQuads, surface: ClosestPoints, sharp: Floats, watch: Watch, tell: Progress
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
        moved = straddled(moved, quads.quads, surface, curves)
    return QuadMesh(moved, quads.quads), int(wrong.sum())


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

"""Quads of a component by an integer-grid map, as one attempt makes them.

The field is aligned and turned into a seamless map (:mod:`vhquad.quad.continuous`), cut into
rectangles (:mod:`vhquad.quad.tmesh`), quantised (:mod:`vhquad.quad.quantize`) and laid on the
surface (:mod:`vhquad.quad.embed`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from vhquad.errors import ParametrizationError
from vhquad.field.align import AlignedField
from vhquad.mesh.quad import QuadMesh
from vhquad.mesh.triangle import TriMesh
from vhquad.quad.attempts import Attempt, Component
from vhquad.quad.continuous import MapInput
from vhquad.quad.embed import embed_layout
from vhquad.quad.integer_map import integer_map
from vhquad.quad.layout import Layout
from vhquad.quad.motorcycle import Tracing, trace
from vhquad.quad.parts import UvMap
from vhquad.quad.quantize import quantise
from vhquad.quad.seamless_map import SIZE_WEIGHT, SeamlessMap, twice_area
from vhquad.quad.tmesh import build_tmesh
from vhquad.report import MAP, MeshCounts
from vhquad.watch import Watch

__all__ = ["MappedQuads", "Progress", "map_to_quads"]

Bools = NDArray[np.bool_]
Floats = NDArray[np.float64]

BESIDE = 0.5  # wanted quad edges between a crease that is given up and a folded triangle

Progress = Callable[[str, float], None]


@dataclass(frozen=True, eq=False)
class MappedQuads:
    """Quads from a map, with what made them."""

    quads: QuadMesh
    aligned: AlignedField
    seamless: SeamlessMap
    tracing: Tracing
    layout: Layout
    attempt: Attempt

    def miss(self, target: int) -> float:
        """How far the count is off, as the logarithm of a factor."""
        return float(abs(np.log(self.quads.n_quads / target)))

    def uv(self) -> UvMap:
        """The integer-grid map of the layout."""
        made = integer_map(
            self.aligned, self.seamless, self.tracing, self.layout.tmesh, self.layout
        )
        return UvMap(made.mesh, made.uv, made.flips)


class _FoldedMap(ParametrizationError):
    """No valid map; ``places`` are the corners of its folded triangles, (k, 3)."""

    def __init__(self, message: str, places: Floats) -> None:
        super().__init__(message)
        self.places = places


def map_to_quads(wish: Component, attempt: Attempt, watch: Watch, tell: Progress) -> MappedQuads:
    """Quads by a map, their vertices where the map has them.

    Where triangles of the map stay folded, creases beside these are given up, if the attempt may.

    Raises
    ------
    ParametrizationError, FieldError
        If there is no valid map, or its quads are not a valid mesh of the input's topology.
    """
    try:
        return _by_map(wish, attempt, watch, tell)
    except _FoldedMap as folded:
        creases = attempt.creases
        beside = BESIDE * float(np.sqrt(wish.mesh.area / attempt.quads))
        kept = creases[~_are_near(wish.mesh.vertices[creases], folded.places, beside)]
        if not (attempt.may_give_up and 0 < len(kept) < len(creases)):
            raise
    fewer = replace(attempt, name=f"{MAP}, some creases", creases=kept)
    return _by_map(wish, fewer, watch, tell)


def _are_near(edges: Floats, places: Floats, distance: float) -> Bools:
    """Which edges (c, 2, 3) come as near to some of the places (k, 3); (c,)."""
    share = np.linspace(0.0, 1.0, 9)[:, None, None]
    points = (1.0 - share) * edges[:, 0] + share * edges[:, 1]
    away = np.asarray(cKDTree(places).query(points)[0])
    return np.asarray((away < distance).any(axis=0))


def _by_map(wish: Component, attempt: Attempt, watch: Watch, tell: Progress) -> MappedQuads:
    """As :func:`map_to_quads`, with the creases of the attempt."""
    wanted = MapInput(
        mesh=wish.mesh,
        field=wish.field,
        creases=attempt.creases,
        target=wish.target,
        quads=attempt.quads,
        smoothing=attempt.smoothing,
        cancel=attempt.cancel,
        seam=wish.seam,
        size_weight=1.0 if wish.density else SIZE_WEIGHT,  # who asks for a density wants it
        curving=wish.curving(attempt.creases),
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
    return MappedQuads(quads, aligned, seamless, tracing, layout, attempt)


def _require_topology(quads: QuadMesh, mesh: TriMesh) -> None:
    if not quads.is_manifold or len(quads.degenerate_quads):
        raise ParametrizationError("the quads of the map do not form a manifold")
    made, wanted = MeshCounts.of(quads).topology, MeshCounts.of(mesh).topology
    if made != wanted:
        raise ParametrizationError(
            f"the quads of the map have (components, Euler characteristic, boundary loops) {made} "
            f"instead of {wanted}"
        )

"""What is wanted of the quads of a component, and the attempts to make them by a map.

Where an attempt fails, the next has a smoother field and fewer creases.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from vhquad.field.creases import TOGETHER, creases_for_quads
from vhquad.field.cross import CrossField
from vhquad.field.features import sharp_edges
from vhquad.field.grow import are_mostly_creases
from vhquad.mesh.closest import ClosestPoints
from vhquad.mesh.triangle import TriMesh
from vhquad.quad.counts import map_quads, narrow_map_quads
from vhquad.quad.known import known_parts
from vhquad.report import MAP

__all__ = ["Attempt", "Component"]

Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]
Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Attempt:
    """One way to try; lengths are in wanted quad edges.

    Attributes
    ----------
    name : str
        Of the method, as the report has it.
    smoothing : float
        Detail of the field below this is smoothed away.
    cancel : float
        Opposite singularities closer than this are cancelled; where those of fingers and folds must
        all stay apart, that takes more quads than were asked for.
    creases : (k, 2) int64
        Crease edges that edges of quads follow.
    quads : float
        That the map is made for.
    may_give_up : bool
        Whether single creases may be given up for it.
    """

    name: str
    smoothing: float
    cancel: float
    creases: Ints
    quads: float
    may_give_up: bool


@dataclass(frozen=True)
class _Plan:
    """An attempt before it is known what creases there are.

    ``crease_length``: creases must hang together over this length; None: no creases.
    """

    name: str
    smoothing: float
    cancel: float
    crease_length: float | None


_PLANS = (
    _Plan(MAP, 0.5, 0.5, TOGETHER),
    _Plan(f"{MAP}, smoother field", 1.5, 1.0, 8.0),
    _Plan(f"{MAP}, no creases", 1.5, 1.0, None),
    _Plan(f"{MAP}, no creases, smoothest field", 5.0, 2.0, None),
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

    def attempts(self) -> Iterator[Attempt]:
        """What to try in turn; nothing is tried twice where no creases are to give up."""
        tried: set[tuple[float, bytes]] = set()
        for plan in _PLANS:
            quads = narrow_map_quads(self.target)
            creases = self._creases(plan.crease_length, quads)
            shared = map_quads(self.target, self.mesh.n_faces, self._is_known)
            free = not self.density and self.curving(creases) == 0
            if free and shared != quads:
                quads, creases = shared, self._creases(plan.crease_length, shared)
            key = (plan.smoothing, creases.tobytes())
            if key not in tried:
                tried.add(key)
                later = plan is not _PLANS[0]
                yield Attempt(plan.name, plan.smoothing, plan.cancel, creases, quads, later)

    def _creases(self, together: float | None, quads: float) -> Ints:
        """Crease edges that hang together over a length in edges of so many quads."""
        if together is None:
            return np.zeros((0, 2), dtype=np.int64)
        if self.creases is not None:
            return self.creases
        if self.crease_angle is None:
            return np.zeros((0, 2), dtype=np.int64)
        length = float(np.sqrt(self.mesh.area / quads))
        return creases_for_quads(self.mesh, self.crease_angle, length, together, self.field)

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
    def _is_known(self) -> bool:
        size = np.ones(self.mesh.n_faces) if self.field.size is None else self.field.size
        return bool(known_parts(self.mesh, self.field, size)[0])

    @cached_property
    def _sharp(self) -> Ints:
        """Edges sharper than the crease angle, if there is one; found once for all attempts."""
        none = np.zeros(0, dtype=np.int64)
        return none if self.crease_angle is None else sharp_edges(self.mesh, self.crease_angle)

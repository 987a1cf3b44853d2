"""Numbers of quads in classes: what is made for one number of a class serves all of them.

A class goes from some number of quads to four times as many, or to twice as many where creases or a
density are followed, or a field whose detail is meant. 7,071 is where classes of either kind begin.
"""

from __future__ import annotations

import numpy as np

__all__ = ["map_quads", "narrow_map_quads", "stand_in_quads"]

SPAN = 4.0
NARROW_SPAN = 2.0
"""On parts that follow creases: which to keep, and how far they bound sizes, goes with the size of
quads. Where a density was asked for: the turns that it needs must not be smoothed away. And on
parts that are known, below 7,071: nor must the detail of their field, which is not for more."""
MAPPED = 8_000.0
"""For so many quads of the class from 7,071 on, and as much of the others, maps are made. Fields
are smoothed by the size of quads: a map suits the coarse end of its class, and is smoother than
need be at the fine end, where fewer irregular vertices come of it."""
STOOD_FOR = 10_000.0
"""For so many stand-ins are."""
LEAST = 10_000 / np.sqrt(2.0)  # of that class
FACES = 4.0
"""Triangles a quad: a field has no detail for more quads than that, and they share a map."""
FEWEST = 500.0  # quads: but more than these


def map_quads(n_quads: float, n_faces: float, known: bool = False) -> float:
    """For how many quads the continuous map of a mesh is made that serves this number.

    Parameters
    ----------
    n_quads : float
    n_faces : float
        Triangles of the mesh.
    known : bool
        It is a part that is known (:mod:`vhquad.quad.known`).
    """
    n_quads = min(n_quads, max(n_faces / FACES, FEWEST))
    return MAPPED * _times(n_quads, NARROW_SPAN if known and n_quads < LEAST else SPAN)


def narrow_map_quads(n_quads: float) -> float:
    """The same where creases or a density are followed."""
    return MAPPED * _times(n_quads, NARROW_SPAN)


def stand_in_quads(n_quads: float) -> float:
    """For how many quads the stand-in is made that serves this number."""
    return STOOD_FOR * _times(n_quads, SPAN)


def _times(n_quads: float, span: float) -> float:
    """A class by what its numbers are times those from 7,071 on: a power of the span."""
    return float(span ** np.floor(np.log(n_quads / LEAST) / np.log(span)))

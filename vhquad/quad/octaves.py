"""Numbers of quads in steps of two: what is made for one of them serves the others of its octave.

One octave goes from 7,071 to 14,142 quads; the next from there to twice as many.
"""

from __future__ import annotations

import numpy as np

__all__ = ["map_quads", "middle_of_octave"]

MIDDLE = 10_000  # of an octave
MAPPED = 0.8
"""Of the middle: for so many quads maps are made. Fields are smoothed by the size of quads, and
creases bound it: a map suits the coarser half of its octave, and is smoother and more careful than
need be for the finest."""


def middle_of_octave(n_quads: float) -> float:
    """The number in the middle of the octave of a positive number of quads."""
    return float(MIDDLE * 2.0 ** np.rint(np.log2(n_quads / MIDDLE)))


def map_quads(n_quads: float) -> float:
    """For how many quads the continuous map is made that serves this number."""
    return MAPPED * middle_of_octave(n_quads)

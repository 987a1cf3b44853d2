"""Unfold what stiffening leaves folded: a barrier descent on the map around the last folds.

Stiff weights push folds about; where that does not end, the triangles around them are mapped anew
by an energy that is finite while they are folded and forbids folds in the end (Garanzha et al.
2021, as in :mod:`vhquad.quad.distortion`): with the frame F of a triangle and its determinant D,

    (|F|² + λ (D² + 1)/2) / χ(D),        χ(D) = (D + √(D² + ε²))/2,

over the unknowns of the seamless space that move nothing else.

Reference: V. Garanzha et al., Foldover-free maps in 50 lines of code, 2021, section 2.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from vhquad.mesh.rings import within_rings
from vhquad.quad.distortion import barrier
from vhquad.quad.map_energy import MapEnergy, determinants

__all__ = ["untangled"]

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]

SIZE_WEIGHT = 0.3
ROUNDS = 12
STEPS, MEMORY = 150, 20  # of L-BFGS in a round
SETTLED = 2e-7  # relative gain of a step that ends a round: the next goes on from there
SIGNS = np.array([1.0, 1.0, -1.0, -1.0])  # of the squares in a determinant
CLEAR = 1e-2  # determinant, of the wanted one, from which on a triangle will survive rounding


def untangled(energy: MapEnergy, x: Floats, rings: int) -> Floats:
    """Unknowns with fewer folds, or as they were.

    Parameters
    ----------
    energy : MapEnergy
    x : (d,) float64
    rings : int
        How far around the folded triangles the map may change.
    """
    from scipy.optimize import fmin_l_bfgs_b  # 0.1 s to import, and most maps do without

    inside = determinants(energy.frames(x)) <= CLEAR
    inside = within_rings(energy.mesh.faces, inside, rings)
    rows = np.repeat(inside, 4)
    entries = energy.jacobian.astype(bool).astype(np.int64)
    free = np.flatnonzero((entries[~rows].sum(axis=0) == 0) & (entries[rows].sum(axis=0) > 0))
    if not free.size:
        return x
    jacobian = energy.jacobian[rows][:, free].tocsr()
    transpose = jacobian.T.tocsr()
    base = energy.frames(x)[inside].ravel() - jacobian @ x[free]
    area = energy.area[inside] / energy.area[inside].sum()

    def cost(y: Floats, epsilon: float) -> tuple[float, Floats]:
        frames = (base + jacobian @ y).reshape(-1, 4)
        d = determinants(frames)
        root, chi = barrier(d, epsilon)
        over = (frames**2).sum(axis=1) + 0.5 * SIZE_WEIGHT * (d * d + 1.0)
        by_d = (SIZE_WEIGHT * d - over / root) / chi
        slope = (2.0 / chi)[:, None] * frames + (2.0 * by_d)[:, None] * frames * SIGNS
        return float(area @ (over / chi)), transpose @ (area[:, None] * slope).ravel()

    y, factor = x[free], SETTLED / np.finfo(np.float64).eps
    for _ in range(ROUNDS):
        least = float(determinants((base + jacobian @ y).reshape(-1, 4)).min())
        if least > CLEAR:
            break
        epsilon = min(1.0, float(np.hypot(0.01, 0.2 * min(least, 0.0))))
        found = fmin_l_bfgs_b(cost, y, args=(epsilon,), m=MEMORY, factr=factor, maxiter=STEPS)
        y = np.asarray(found[0])
    out = x.copy()
    out[free] = y
    return out

"""Smooth cross fields on faces: the smoothest one, and the polish of a given one.

Both minimise quadratic energies of the fourth powers ``z`` and normalise afterwards.
Reference: Knoeppel et al. 2013, "Globally optimal direction fields".
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csc_matrix, diags

from vhquad.field.dual import carry4, dirichlet, dual_weights
from vhquad.geometry.sparse import SymmetricFactor
from vhquad.mesh.triangle import TriMesh

__all__ = ["polish", "relaxed", "settled", "smoothest", "unit"]

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

INVERSE_ITERATIONS = 20
SETTLING_STEPS = 5


def smoothest(mesh: TriMesh, seed: int = 0) -> Complexes:
    """Unit crosses of the least Dirichlet energy; (m,) complex128, one field per component.

    Inverse iteration for the lowest eigenvector of the energy against the area.
    """
    energy, mass = _energy(mesh), np.maximum(mesh.face_areas, 1e-12 * mesh.area / mesh.n_faces)
    scale = np.bincount(mesh.face_component, mass)[mesh.face_component]
    factor = SymmetricFactor(energy + diags(1e-3 * mass / scale))
    rng = np.random.default_rng(seed)
    z = np.exp(1j * rng.uniform(0.0, 2.0 * np.pi, mesh.n_faces))
    for _ in range(INVERSE_ITERATIONS):
        z = factor.solve(mass * z)
        norm = np.bincount(mesh.face_component, mass * np.abs(z) ** 2)
        z = z / np.sqrt(norm)[mesh.face_component]
    return unit(z)


def polish(
    mesh: TriMesh, target: Complexes, weight: Floats, fixed: NDArray[np.bool_] | None = None
) -> Complexes:
    """The unit crosses of :func:`relaxed`; (m,) complex128."""
    return unit(relaxed(mesh, target, weight, fixed))


def relaxed(
    mesh: TriMesh, target: Complexes, weight: Floats, fixed: NDArray[np.bool_] | None = None
) -> Complexes:
    """Minimise Dirichlet energy + sum over faces of ``weight |z - target|^2``; (m,) complex128.

    Parameters
    ----------
    mesh : TriMesh
    target : (m,) complex128
        The field to stay near; where ``fixed``, the field to keep (unit).
    weight : (m,) float64
        Of the data term, not negative. With ``area / l**2`` details below the length l are
        smoothed away.
    fixed : (m,) bool, optional
        Faces that keep ``target`` exactly.

    Notes
    -----
    A component without weights or fixed faces gets its smoothest field. The modulus says how much
    the target has to say at a face: it falls where weights are small or neighbours disagree.
    """
    fixed = np.zeros(mesh.n_faces, dtype=bool) if fixed is None else fixed
    component = mesh.face_component
    said = np.bincount(component, weight * np.abs(target) + fixed)
    silent = (said <= 0)[component]
    if silent.any():
        target = np.where(silent, smoothest(mesh), target)
        weight = np.where(silent, mesh.face_areas / mesh.area, weight)
    free = np.flatnonzero(~fixed)
    z = np.array(target, dtype=np.complex128)
    if free.size:
        energy = _energy(mesh)
        rows = energy[free]
        matrix = rows[:, free] + diags(weight[free])
        pull = weight[free] * target[free] - rows @ np.where(fixed, target, 0.0)
        z[free] = SymmetricFactor(matrix).solve(pull)
    return z


def settled(
    mesh: TriMesh,
    z: Complexes,
    target: Complexes,
    weight: Floats,
    fixed: NDArray[np.bool_],
    length: Floats,
) -> Complexes:
    """Lower the energy of unit crosses among unit crosses, by diffusing and normalising in turn.

    :func:`relaxed` lets crosses shrink where they disagree, so its singularities gather where there
    is nothing to say; here they repel each other and drift to better places.

    Parameters
    ----------
    mesh : TriMesh
    z : (m,) complex128
        Unit crosses to start from.
    target, weight, fixed
        As in :func:`relaxed`.
    length : (m,) float64
        Diffusion length of a step at each face.

    References
    ----------
    Viertel and Osting 2019, "An approach to quad meshing based on harmonic cross-valued maps".
    """
    free = np.flatnonzero(~fixed)
    z = z.copy()
    if free.size == 0:
        return z
    rows = _energy(mesh)[free]
    pull = weight[free] * target[free] - rows @ np.where(fixed, target, 0.0)
    hold = (mesh.face_areas / length**2)[free]
    factor = SymmetricFactor(rows[:, free] + diags(weight[free] + hold))
    for _ in range(SETTLING_STEPS):
        z[free] = unit(factor.solve(pull + hold * z[free]))
    return z


def unit(z: Complexes) -> Complexes:
    """Complex numbers scaled to modulus 1; 1 where they vanish."""
    modulus = np.abs(z)
    return np.divide(z, modulus, out=np.ones_like(z), where=modulus > 0)


def _energy(mesh: TriMesh) -> csc_matrix:
    return dirichlet(mesh, dual_weights(mesh), carry4(mesh))

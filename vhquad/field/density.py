"""A cross field bent to a wanted density: the one that suits quads whose size changes.

Quads along a cross field have sizes of its making: if their edge length goes as ``exp(-phi)``, the
field must turn, along any path, by the change of phi across the path. That is parallel transport in
the metric ``exp(2 phi) g``, whose curvature differs from that of the surface by the Laplacian of
phi. So the given field is smoothed in that metric: the more, the faster the density changes, and
hardly where it is constant. Singularities come and go where sizes need them.

References: Ray, Vallet, Alonso, Levy 2009, "Geometry-aware direction field processing"; Bommes,
Zimmer, Kobbelt 2009 for the condition; Springborn, Schroeder, Pinkall 2008 for the metric.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix, diags

from vhquad.errors import FieldError
from vhquad.field.cross import CrossField
from vhquad.field.dual import carry4, dirichlet, dual_weights
from vhquad.field.smooth import unit
from vhquad.geometry.laplacian import diffuse
from vhquad.geometry.sparse import SymmetricFactor
from vhquad.mesh.triangle import TriMesh

__all__ = ["bend_to_density"]

Floats = NDArray[np.float64]

BLUR = 2.0  # edge lengths over which the density is smoothed: quads cannot follow faster
STEEP = 0.02  # change of the logarithm of the edge length from quad to quad that counts in full
NEAR, FAR = 0.5, 20.0  # edge lengths below which the field is smoothed, where flat and where steep
LEAST_ANGLE = 1e-2  # of a corner, radians, so that cotangents stay finite


def bend_to_density(
    mesh: TriMesh, field: CrossField, density: Floats, edge_length: float
) -> CrossField:
    """Smooth a field in the metric in which the wanted quads are all of one size.

    Parameters
    ----------
    mesh : TriMesh
    field : CrossField
        On faces; its sizes and confidences stay.
    density : (n,) float64
        Factor on the quads per area at each vertex, positive.
    edge_length : float
        Mean edge length of the quads to come, in units of the mesh.

    Raises
    ------
    FieldError
        If the field is not on the faces of the mesh.
    """
    if field.domain != "faces" or len(field) != mesh.n_faces:
        raise FieldError(
            f"expected a cross for each of {mesh.n_faces} faces, not {len(field)} on {field.domain}"
        )
    weight = _cotan_weights(mesh)
    phi = _blurred(mesh, weight, 0.5 * np.log(density), BLUR * edge_length)
    # The flow of grad phi along each edge, turned: what crosses turn by on their way across it.
    turn = weight * (phi[mesh.head] - phi[mesh.tail])
    carry = np.where(mesh.twin >= 0, carry4(mesh) * np.exp(4j * turn), 1.0)
    steep = np.minimum(_slope(mesh, phi) * edge_length / STEEP, 1.0)
    length = edge_length * (NEAR + (FAR - NEAR) * steep)
    stay = mesh.face_areas / length**2 * (field.z != 0)
    if not (stay > 0).any():
        return field
    energy = dirichlet(mesh, dual_weights(mesh), carry)
    tiny = 1e-9 * mesh.face_areas / mesh.area  # components without any cross
    z = SymmetricFactor(energy + diags(stay + tiny)).solve(stay * field.z)
    return CrossField("faces", np.where(np.abs(z) > 0, unit(z), 0.0), field.size, field.confidence)


def _cotan_weights(mesh: TriMesh) -> Floats:
    """Half the cotangents opposite each edge, added up; of each halfedge, the twin's is equal."""
    angle = np.clip(mesh.corner_angles, LEAST_ANGLE, np.pi - LEAST_ANGLE)
    half = np.roll(0.5 / np.tan(angle), 1, axis=1).reshape(-1)
    return np.asarray(half + np.where(mesh.twin >= 0, half[mesh.twin], 0.0))


def _blurred(mesh: TriMesh, weight: Floats, values: Floats, length: float) -> Floats:
    """Vertex values diffused over about a length."""
    once = (mesh.twin < 0) | (np.arange(len(weight)) < mesh.twin)
    i, j, w = mesh.tail[once], mesh.head[once], np.maximum(weight[once], 1e-6)
    n = mesh.n_vertices
    pairs = (np.concatenate([i, j]), np.concatenate([j, i]))
    graph = coo_matrix((np.concatenate([w, w]), pairs), shape=(n, n)).tocsr()
    laplacian = diags(np.asarray(graph.sum(axis=1)).reshape(-1)) - graph
    mass = np.maximum(mesh.vertex_areas, 1e-12 * mesh.area / n)
    return np.asarray(diffuse(laplacian.tocsr(), mass, length**2, values))


def _slope(mesh: TriMesh, values: Floats) -> Floats:
    """Length of the gradient of a piecewise linear function on each face; (m,)."""
    p = mesh.vertices[mesh.faces]
    side = np.roll(p, -1, axis=1) - p
    opposite = np.roll(side, -1, axis=1)
    total = np.einsum("mk,mki->mi", values[mesh.faces], opposite)
    length = np.linalg.norm(total, axis=1)
    area = mesh.face_areas
    return np.divide(0.5 * length, area, out=np.zeros_like(area), where=area > 0)

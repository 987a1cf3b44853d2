"""A smaller stand-in for a large mesh, and the way back for a cross field predicted on it."""

from __future__ import annotations

import fast_simplification
import numpy as np

from vhquad.errors import MeshError
from vhquad.field.cross import CrossField
from vhquad.geometry.frames import build_frames, face_axes, from_3d, to_3d, vertex_axes
from vhquad.mesh.closest import ClosestPoints
from vhquad.mesh.triangle import TriMesh

__all__ = ["carry_back", "make_proxy"]


def make_proxy(mesh: TriMesh, n_vertices: int) -> TriMesh | None:
    """Decimate one component by quadric error.

    Parameters
    ----------
    mesh : TriMesh
    n_vertices : int
        About how many vertices to keep.

    Returns
    -------
    TriMesh or None
        None where decimation breaks the surface (another topology, not manifold): the caller then
        uses the mesh itself.
    """
    share = 1.0 - n_vertices / mesh.n_vertices
    if share <= 0.0:
        return None
    vertices, faces = fast_simplification.simplify(
        mesh.vertices.astype(np.float64), mesh.faces.astype(np.int32), target_reduction=share
    )
    faces = faces[(np.diff(np.sort(faces, axis=1), axis=1) > 0).all(axis=1)]
    if len(faces) == 0:
        return None
    used, local = np.unique(faces, return_inverse=True)
    proxy = TriMesh(vertices[used], local.reshape(-1, 3).astype(np.int64))
    try:
        sound = proxy.has_manifold_vertices and proxy.n_components == 1
        same = proxy.euler_characteristic == mesh.euler_characteristic
        same = same and len(proxy.boundary_loops) == len(mesh.boundary_loops)
    except MeshError:
        return None
    return proxy if sound and same and proxy.face_areas.min() > 0 else None


def carry_back(proxy: TriMesh, field: CrossField, mesh: TriMesh) -> CrossField:
    """Carry a vertex field of a proxy to the vertices of the mesh it stands for.

    At each vertex of the mesh the field is interpolated at the closest point of the proxy (in that
    face's frame), then both directions of the cross are projected to the vertex's tangent plane.
    """
    frames = build_frames(proxy)
    hits = ClosestPoints(proxy).query(mesh.vertices)
    in_face = field.z[proxy.faces] * frames.vertex_to_face**4
    z = hits.interpolate(in_face)
    size = None if field.size is None else hits.interpolate(field.size[proxy.faces])
    u = np.exp(0.25j * np.angle(z))
    axes = face_axes(proxy)
    there = type(axes)(axes.e1[hits.face], axes.e2[hits.face])
    vectors = to_3d(np.stack([u, 1j * u], axis=1), there)
    here = from_3d(vectors, vertex_axes(mesh))
    length = np.abs(here)
    unit = np.divide(here, length, out=np.zeros_like(here), where=length > 0)
    return CrossField("vertices", np.where(z != 0, (unit**4).sum(axis=1), 0.0), size)

"""A smaller stand-in for a large mesh, and the way back for a cross field predicted on it."""

from __future__ import annotations

import numpy as np

from vhquad.field.cross import CrossField
from vhquad.geometry.frames import build_frames, face_axes, from_3d, to_3d, vertex_axes
from vhquad.mesh.closest import ClosestPoints
from vhquad.mesh.proxy import decimate
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
        None where there is nothing to decimate or another topology comes out: the caller then uses
        the mesh itself.
    """
    if n_vertices >= mesh.n_vertices:
        return None
    proxy = decimate(mesh, round(mesh.n_faces * n_vertices / mesh.n_vertices))
    same = (
        proxy.n_vertices < mesh.n_vertices
        and proxy.euler_characteristic == mesh.euler_characteristic
        and len(proxy.boundary_loops) == len(mesh.boundary_loops)
    )
    return proxy if same else None


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
    confidence = None
    if field.confidence is not None:
        confidence = hits.interpolate(field.confidence[proxy.faces]).clip(0.0, 1.0)
    u = np.exp(0.25j * np.angle(z))
    axes = face_axes(proxy)
    there = type(axes)(axes.e1[hits.face], axes.e2[hits.face])
    vectors = to_3d(np.stack([u, 1j * u], axis=1), there)
    here = from_3d(vectors, vertex_axes(mesh))
    length = np.abs(here)
    unit = np.divide(here, length, out=np.zeros_like(here), where=length > 0)
    z = np.where(z != 0, (unit**4).sum(axis=1), 0.0)
    return CrossField("vertices", z, size, confidence)

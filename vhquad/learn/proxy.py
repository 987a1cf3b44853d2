"""Prediction by components, large ones on a smaller proxy from which the field is carried back."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

import numpy as np

from vhquad.errors import ConfigError
from vhquad.field.cross import CrossField
from vhquad.geometry.frames import build_frames, face_axes, from_3d, to_3d, vertex_axes
from vhquad.mesh.closest import ClosestPoints
from vhquad.mesh.proxy import decimate
from vhquad.mesh.triangle import TriMesh

__all__ = ["PROXY_ABOVE", "Resolution", "by_components", "carry_back", "make_proxy"]

PROXY_ABOVE = 15_000  # vertices of a component
PROXY_VERTICES = 10_000

Resolution = Literal["auto", "full"]


def by_components(
    mesh: TriMesh,
    on_surface: Callable[[TriMesh], CrossField],
    on_proxy: Callable[[TriMesh], CrossField],
    resolution: Resolution = "auto",
    of: TriMesh | None = None,
    on_component: Callable[[int, int], None] | None = None,
) -> CrossField:
    """The field of a mesh from those of its components.

    Parameters
    ----------
    mesh : TriMesh
    on_surface, on_proxy : callable
        Give the field at the vertices of a component, or of the proxy of one.
    resolution : "auto" or "full"
        "auto" takes proxies of components above :data:`PROXY_ABOVE` vertices.
    of : TriMesh, optional
        What the mesh is a decimated stand-in for, with the same components: proxies are made of
        that, so that all its stand-ins share them, or, if it cannot be decimated so far, of the
        stand-in.
    on_component : callable, optional
        Called with (components done, components) after each.

    Returns
    -------
    CrossField
        On the vertices, with sizes and confidences. All is 0 on components without area.

    Raises
    ------
    ConfigError
        If the resolution is unknown.
    """
    if resolution not in ("auto", "full"):
        raise ConfigError(f'resolution must be "auto" or "full", not {resolution!r}')
    z = np.zeros(mesh.n_vertices, dtype=np.complex128)
    size, trust = np.zeros(mesh.n_vertices), np.zeros(mesh.n_vertices)
    count = mesh.n_components
    for label in range(count):  # components are few
        part, used = _component(mesh, label)
        if part.area > 1e-24 * mesh.diagonal**2:
            proxy = None
            for source in (part,) if of is None else (_component(of, label)[0], part):
                if resolution == "auto" and proxy is None and source.n_vertices > PROXY_ABOVE:
                    proxy = make_proxy(source, PROXY_VERTICES)
            field = on_surface(part) if proxy is None else carry_back(proxy, on_proxy(proxy), part)
            z[used] = field.z
            if field.size is not None:
                size[used] = field.size
            if field.confidence is not None:
                trust[used] = field.confidence
        if on_component is not None:
            on_component(label + 1, count)
    return CrossField("vertices", z, size, trust)


def _component(mesh: TriMesh, label: int) -> tuple[TriMesh, np.ndarray]:
    """One component, and the vertices of the mesh that are its own."""
    if mesh.n_components == 1:
        return mesh, np.arange(mesh.n_vertices)
    return mesh.submesh(mesh.face_component == label)


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

"""A remesh along a field, and what must hold for every one."""

from __future__ import annotations

import numpy as np

from vhquad.field.cross import CrossField
from vhquad.mesh.triangle import TriMesh
from vhquad.quad.pipeline import RemeshResult, RemeshSettings, remesh_mesh


def plain_field(mesh: TriMesh) -> CrossField:
    """Nothing known: the smoothest field along the boundaries."""
    return CrossField("faces", np.zeros(mesh.n_faces))


def run(mesh: TriMesh, target: int = 200, field: CrossField | None = None) -> RemeshResult:
    return remesh_mesh(mesh, field or plain_field(mesh), RemeshSettings(target_quads=target))


def check_valid(mesh: TriMesh, result: RemeshResult) -> None:
    quads, report = result.quads, result.report
    # 1. a manifold of quads only, every component, the same topology
    assert quads.is_manifold
    assert len(quads.degenerate_quads) == 0
    assert len(np.unique(quads.quads)) == quads.n_vertices
    assert report.topology_kept
    assert quads.n_components == mesh.n_components
    assert quads.euler_characteristic == mesh.euler_characteristic
    assert quads.n_boundary_loops == len(mesh.boundary_loops)
    # 2. the rim on the rim
    assert rim_distance(mesh, result) < 1e-6 * mesh.diagonal
    # 3. the report counts what is there
    assert report.made == quads.n_quads == sum(part.made for part in report.components)
    assert len(report.components) == mesh.n_components
    assert report.quality is not None
    assert report.quality.boundary_loops == quads.n_boundary_loops
    for part in report.components:
        off = abs(part.made / part.target - 1)
        assert off <= 0.1 or part.reason or abs(part.made - part.target) <= 0.005 * report.asked
        assert part.reason if part.is_fallback else not part.reason or off > 0.09


def rim_distance(mesh: TriMesh, result: RemeshResult) -> float:
    """Largest distance of a boundary vertex to the boundary polyline of the input."""
    rim = result.quads.vertices[result.quads.is_boundary_vertex]
    border = np.flatnonzero(mesh.twin < 0)
    if len(border) == 0:
        assert len(rim) == 0
        return 0.0
    a, d = mesh.vertices[mesh.tail[border]], mesh.vertices[mesh.head[border]]
    d = d - a
    t = np.clip(np.einsum("pei,ei->pe", rim[:, None] - a[None], d) / (d * d).sum(axis=1), 0, 1)
    off = np.linalg.norm(rim[:, None] - a[None] - t[..., None] * d[None], axis=2).min(axis=1)
    return float(off.max())

"""Is a quad mesh valid, and how good is it: the figures that every report shows."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vhquad.mesh.closest import ClosestPoints, closest_barycentrics
from vhquad.mesh.distance import Distance, surface_distance
from vhquad.mesh.intersections import self_intersections
from vhquad.mesh.quad import QuadMesh
from vhquad.mesh.triangle import TriMesh

__all__ = [
    "QualityReport",
    "check_quads",
    "flipped_quads",
    "least_jacobians",
    "scaled_jacobians",
    "without_area",
]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_NO_AREA = 1e-12
"""A quad below this share of the square of its longest side has no area."""


@dataclass(frozen=True)
class QualityReport:
    """Validity, regularity, shape and closeness of a quad mesh; plain numbers only."""

    vertices: int
    quads: int
    non_quads: int
    """Faces that are not quads; 0 by construction."""
    components: int
    euler_characteristic: int
    boundary_loops: int
    nonmanifold_edges: int
    """Edges with more than two quads."""
    nonmanifold_vertices: int
    """Vertices where several fans of quads meet."""
    misoriented_edges: int
    """Edges whose two quads are wound against each other."""
    degenerate_quads: int
    """Quads that name a vertex twice or have no area."""
    unused_vertices: int
    irregular_interior: Mapping[int, int]
    """How many interior vertices have each valence other than 4."""
    irregular_boundary: Mapping[int, int]
    """How many boundary vertices have each valence other than 3."""
    doublets: int
    """Interior vertices of valence 2."""
    scaled_jacobian_min: float
    """Of all corners; 1 is a square corner, 0 and less is folded. NaN without quads."""
    scaled_jacobian_mean: float
    """Mean over the quads of their worst corner."""
    folded_quads: int
    """Quads with a corner whose scaled Jacobian is 0 or less."""
    edge_length_min: float
    edge_length_mean: float
    edge_length_max: float
    self_intersections: int = 0
    """Pairs of quads without a common vertex that cut through each other."""
    flipped_quads: int | None = None
    """Quads that face against the surface beneath them; None without a surface."""
    distance: Distance | None = None
    """From and to the surface, in % of its diagonal; None without a surface."""

    @property
    def is_valid(self) -> bool:
        """Whether it is a manifold, consistently wound mesh of true quads, with none unused."""
        return self.quads > 0 and not (
            self.non_quads
            or self.nonmanifold_edges
            or self.nonmanifold_vertices
            or self.misoriented_edges
            or self.degenerate_quads
            or self.unused_vertices
        )

    @property
    def irregular_vertices(self) -> int:
        """Interior vertices of valence other than 4."""
        return sum(self.irregular_interior.values())

    def to_dict(self) -> dict[str, Any]:
        """All figures by name, for JSON."""
        return asdict(self)


def check_quads(mesh: QuadMesh, against: TriMesh | ClosestPoints | None = None) -> QualityReport:
    """Judge a quad mesh.

    Parameters
    ----------
    mesh : QuadMesh
        Any; the worse it is, the more the report has to say.
    against : TriMesh or ClosestPoints, optional
        The surface it stands for: adds distances and quads facing the wrong way.

    Returns
    -------
    QualityReport
    """
    jacobian = scaled_jacobians(mesh)
    some = mesh.n_quads > 0
    length = mesh.edge_lengths if some else np.full(1, np.nan)
    distance, flipped = None, None
    if against is not None and some:
        surface = against if isinstance(against, ClosestPoints) else ClosestPoints(against)
        own = ClosestPoints(TriMesh(mesh.vertices, mesh.triangles()))
        distance = surface_distance(own, surface)
        flipped = len(flipped_quads(mesh, surface))
    flat = np.zeros(mesh.n_quads, dtype=bool)
    flat[mesh.degenerate_quads] = True
    return QualityReport(
        vertices=mesh.n_vertices,
        quads=mesh.n_quads,
        non_quads=0,
        components=mesh.n_components,
        euler_characteristic=mesh.euler_characteristic,
        boundary_loops=mesh.n_boundary_loops,
        nonmanifold_edges=len(mesh.nonmanifold_edges),
        nonmanifold_vertices=len(mesh.nonmanifold_vertices),
        misoriented_edges=len(mesh.misoriented_edges),
        degenerate_quads=int((flat | without_area(mesh)).sum()),
        unused_vertices=int((mesh.valence == 0).sum()),
        irregular_interior=mesh.irregular_interior,
        irregular_boundary=mesh.irregular_boundary,
        doublets=len(mesh.doublets),
        scaled_jacobian_min=float(jacobian.min()) if some else float("nan"),
        scaled_jacobian_mean=float(jacobian.min(axis=1).mean()) if some else float("nan"),
        folded_quads=int((jacobian <= 0).any(axis=1).sum()),
        edge_length_min=float(length.min()),
        edge_length_mean=float(length.mean()),
        edge_length_max=float(length.max()),
        self_intersections=len(self_intersections(mesh)),
        flipped_quads=flipped,
        distance=distance,
    )


def scaled_jacobians(mesh: QuadMesh) -> Floats:
    """Sine of each corner's angle, signed against the quad's own mean normal.

    Parameters
    ----------
    mesh : QuadMesh

    Returns
    -------
    (k, 4) float64
        n . (a x b) / (|a| |b|) at each corner, where a and b are the sides out of it to the next
        and to the previous corner and n is the unit area vector of the quad; 1 at all corners of a
        rectangle, negative where the quad is folded or dented, 0 where a side has no length.
    """
    p = mesh.vertices[mesh.quads]
    a, b = np.roll(p, -1, axis=1) - p, np.roll(p, 1, axis=1) - p
    normal = _area_vectors(mesh)
    part = np.einsum("qki,qi->qk", np.cross(a, b), normal)
    whole = np.linalg.norm(a, axis=2) * np.linalg.norm(b, axis=2)
    whole = whole * np.linalg.norm(normal, axis=1)[:, None]
    return np.divide(part, whole, out=np.zeros_like(part), where=whole > 0)


def least_jacobians(vertices: Floats, quads: Ints) -> Floats:
    """Scaled Jacobian of the worst corner of each quad; (k,)."""
    return np.asarray(scaled_jacobians(QuadMesh(vertices, quads)).min(axis=1))


def without_area(mesh: QuadMesh) -> NDArray[np.bool_]:
    """Quads whose area vanishes beside their longest edge; (k,)."""
    p = mesh.vertices[mesh.quads]
    longest = np.linalg.norm(np.roll(p, -1, axis=1) - p, axis=2).max(axis=1, initial=0.0)
    return np.asarray(np.linalg.norm(_area_vectors(mesh), axis=1) <= _NO_AREA * longest**2)


def flipped_quads(mesh: QuadMesh, surface: ClosestPoints) -> Ints:
    """Quads that face against the surface beneath them.

    The surface's normal at the point closest to the quad's middle decides; where it is more than
    60 degrees off, so do those at four points half way to the corners, which spares quads across
    a crease. Where two sheets nearly touch, as at lips, or a part is thinner than its quads, the
    nearest sheet may be the other: the corners, which lie on their own sheet, must face against
    the surface as well, and no face within an edge length of the middle may face the quad's way.

    Parameters
    ----------
    mesh : QuadMesh
    surface : ClosestPoints
        Queries on the surface.

    Returns
    -------
    (j,) int64
    """
    p = mesh.vertices[mesh.quads]
    middle = p.mean(axis=1)
    normal = surface.mesh.face_normals
    own = _area_vectors(mesh)
    beneath = normal[surface.faces(middle)]
    agree = np.einsum("qi,qi->q", beneath, own)
    doubt = np.flatnonzero(agree < 0.5 * np.linalg.norm(own, axis=1))
    around = 0.5 * (p[doubt] + middle[doubt, None])
    face = surface.faces(around.reshape(-1, 3)).reshape(-1, 4)
    beneath = beneath[doubt] + normal[face].sum(axis=1)
    doubt = doubt[np.einsum("qi,qi->q", beneath, own[doubt]) < 0]
    face = surface.faces(p[doubt].reshape(-1, 3)).reshape(-1, 4)
    doubt = doubt[np.einsum("qi,qi->q", normal[face].sum(axis=1), own[doubt]) < 0]
    return doubt[~_has_own_sheet(middle[doubt], own[doubt], surface.mesh)]


def _has_own_sheet(middle: Floats, own: Floats, mesh: TriMesh) -> NDArray[np.bool_]:
    """Whether a face that faces the quad's way lies within the quad's edge length; (q,)."""
    out = np.zeros(len(middle), dtype=bool)
    if len(middle) == 0:
        return out
    centre, widest = mesh.vertices[mesh.faces].mean(axis=1), mesh.edge_lengths.max()
    for i, (m, n) in enumerate(zip(middle, own, strict=True)):  # few
        area = float(np.linalg.norm(n))
        same = np.flatnonzero(mesh.face_normals @ n > 0.5 * area)
        near = same[np.linalg.norm(centre[same] - m, axis=1) < np.sqrt(area) + widest]
        corners = mesh.vertices[mesh.faces[near]]
        weights = closest_barycentrics(corners, np.broadcast_to(m, (len(near), 3)))
        gap = np.linalg.norm(np.einsum("qk,qki->qi", weights, corners) - m, axis=1)
        out[i] = (gap < np.sqrt(area)).any()
    return out


def _area_vectors(mesh: QuadMesh) -> Floats:
    """Normal of each quad, as long as its area; (k, 3)."""
    p = mesh.vertices[mesh.quads]
    return np.asarray(0.5 * np.cross(p[:, 2] - p[:, 0], p[:, 3] - p[:, 1]))

"""From a cross field to what a map needs: aligned to features, matched, with legal indices.

This is the door between fields and maps: :class:`AlignedField` holds every integer that the map
takes from the field, on a mesh refined just enough for the map to exist.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from dataclasses import field as default

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vhquad.errors import ConfigError, FieldError, MeshError
from vhquad.field.cancel import absorb_at_features, cancel_pairs, cure_low_sectors, low_sectors
from vhquad.field.constrained import pose
from vhquad.field.cross import CrossField
from vhquad.field.features import crease_halfedges, hopeless_creases
from vhquad.field.matching import MatchedField
from vhquad.field.prune import prune_branches
from vhquad.field.refine import Refinement, no_refinement, split_edges
from vhquad.field.separate import separate_features, separate_singularities
from vhquad.mesh.triangle import TriMesh

__all__ = ["AlignReport", "AlignSettings", "AlignedField", "align_field"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]

DEFAULT_QUADS = 2000
SHORTEST_CREASE = 2.0  # edge lengths; of what is left where part of a crease was dropped
LOOSE_CREASE = 1.5  # edge lengths; what dropping leaves as a shorter loose branch goes too
SETTLE = 2.0  # edge lengths over which singularities may drift to better places
MOST_SPLITS = 12  # rounds of splitting where vertices are too few; one or two happen


@dataclass(frozen=True)
class AlignSettings:
    """How a field is made fit for a map.

    Attributes
    ----------
    edge_length : float, optional
        Edge length of the quads to come, on average if the field has sizes. Default: the sizes of
        the field as they are, or what makes 2,000 quads.
    smoothing : float
        Details of the field smaller than this many edge lengths are smoothed away, where it is
        sure those below half of that.
    cancel : float
        Opposite singularities closer than this many edge lengths are cancelled, and those as close
        to a boundary or crease move on to it; 0 changes none.
    """

    edge_length: float | None = None
    smoothing: float = 0.5
    cancel: float = 0.5

    def __post_init__(self) -> None:
        if self.edge_length is not None and not 0.0 < self.edge_length < np.inf:
            raise ConfigError(f"edge_length must be positive, not {self.edge_length}")
        for name in ("smoothing", "cancel"):
            if not 0.0 <= getattr(self, name) < np.inf:
                raise ConfigError(f"{name} must not be negative, it is {getattr(self, name)}")


@dataclass(frozen=True)
class AlignReport:
    """What was done to a field.

    Attributes
    ----------
    edge_length : float
        Quad edge length that distances were measured by, on average.
    splits : int
        Vertices added.
    corners : int
        Boundary vertices where the boundary turns.
    creases, creases_dropped : int
        Crease edges kept, and left out because no quad fits beside them.
    pairs_cancelled : int
        Pairs of opposite singularities taken out.
    absorbed : int
        Singularities moved on to a boundary or crease close by.
    indices_moved : int
        Quarter indices moved away from vertices that had too few quads.
    singularities : dict of int to int
        Interior singular vertices by number of quads around them (4 less 4 times the index).
    crease_corners : dict of int to int
        Inner vertices on creases by number of quads around them, where that is not 4.
    """

    edge_length: float
    splits: int = 0
    corners: int = 0
    creases: int = 0
    creases_dropped: int = 0
    pairs_cancelled: int = 0
    absorbed: int = 0
    indices_moved: int = 0
    singularities: dict[int, int] = default(default_factory=dict)
    crease_corners: dict[int, int] = default(default_factory=dict)


@dataclass(frozen=True, eq=False)
class AlignedField:
    """A field ready for a seamless map.

    Guaranteed: every face has at most one feature edge; every other edge has at most one end on a
    feature and joins at most one singular sector (quads other than 4, at a feature other than 2);
    ``sector_quads`` is at least 1, and adds up to at least 3 around interior vertices.

    Attributes
    ----------
    mesh : TriMesh
        The input split further; its vertices keep their index, new ones lie on its faces.
    parent_face : (m,) int64
        Face of the input in which each face lies.
    angle : (m,) float64
        Angle of the direction that becomes the u axis of the face's chart, counter-clockwise
        from the face's halfedge 0, radians.
    size : (m,) float64 or None
        Wanted quad edge length.
    trust : (m,) float64
        That in the field, see :attr:`vhquad.field.cross.CrossField.trust`.
    feature : (3m,) bool
        Halfedges on a boundary or crease (both halfedges of a crease).
    axis : (3m,) int64
        a in 0..3: the map sends a feature halfedge to direction ``i**a`` of its face's chart;
        -1 elsewhere.
    rotation : (3m,) int64
        r in 0..3: ``z_g = i**r z_f + t`` from the face f of the halfedge to g across it;
        0 on boundaries.
    sector : (m, 3) int64
        Sector of each corner: corners around a vertex joined across non-feature edges.
    sector_quads : (s,) int64
        Quarter turns of the map's angle in each sector.
    sector_vertex : (s,) int64
    sector_is_feature : (s,) bool
        Whether feature halfedges delimit the sector, else it is the full fan of a vertex.
    report : AlignReport
    """

    mesh: TriMesh
    parent_face: Ints
    angle: Floats
    size: Floats | None
    trust: Floats
    feature: Bools
    axis: Ints
    rotation: Ints
    sector: Ints
    sector_quads: Ints
    sector_vertex: Ints
    sector_is_feature: Bools
    report: AlignReport


def align_field(
    mesh: TriMesh,
    field: CrossField,
    creases: ArrayLike | None = None,
    settings: AlignSettings | None = None,
    seam: Bools | None = None,
) -> AlignedField:
    """Polish, align, match and clean a cross field.

    Parameters
    ----------
    mesh : TriMesh
    field : CrossField
        On faces; zero crosses are filled in.
    creases : (k, 2) array_like of int, optional
        Edges, as pairs of vertices, that quad edges must follow.
    settings : AlignSettings, optional
    seam : (3m,) bool, optional
        Boundary halfedges beyond which the surface goes on, mirrored: vertices within them get
        at least two quads, so that the whole has no doublet there.

    Raises
    ------
    FieldError
        If the field does not fit the mesh, or the mesh is too coarse for any legal field.
    MeshError
        If a face has no area, or a crease is no edge.
    """
    settings = settings or AlignSettings()
    if field.domain != "faces" or len(field) != mesh.n_faces:
        raise FieldError(
            f"align_field needs a cross for each of {mesh.n_faces} faces, "
            f"not {len(field)} on {field.domain}; see vhquad.field.transport"
        )
    flat = np.flatnonzero(mesh.face_areas <= 0.0)
    if flat.size:
        raise MeshError(f"{flat.size} faces have no area, the first is {flat[0]}; run repair first")
    size = _quad_sizes(mesh, field, settings.edge_length)
    length = float(np.sqrt(mesh.area / (mesh.face_areas / size**2).sum()))
    feature = (mesh.twin < 0) | crease_halfedges(mesh, creases)
    n_creases = _count_creases(mesh, feature)
    while True:
        first = separate_features(mesh, feature)
        posed = pose(first, feature, field, size, settings.smoothing, seam)
        z = posed.solve()
        blunt = hopeless_creases(posed.match(z), SHORTEST_CREASE * length)
        if not blunt.any():
            break
        feature[first.source[blunt]] = False
        feature &= ~_frayed(mesh, feature, first.source[blunt], LOOSE_CREASE * length)
    matched = posed.match(posed.settle(z, SETTLE * posed.size))

    kept = posed.corner | (matched.feature & (matched.mesh.twin >= 0))
    n_kept = _count_creases(mesh, feature)
    size, near = posed.size, settings.cancel
    matched, cancelled = cancel_pairs(matched, near, matched.touched(kept), size)
    matched, absorbed = absorb_at_features(matched, near, size)
    matched, room, moved = _cure(matched, near, size)
    matched, last = separate_singularities(matched)
    report = AlignReport(
        edge_length=length,
        splits=matched.mesh.n_vertices - mesh.n_vertices,
        corners=int(posed.corner.sum()),
        creases=n_kept,
        creases_dropped=n_creases - n_kept,
        pairs_cancelled=cancelled,
        absorbed=absorbed,
        indices_moved=moved,
        singularities=_singularities(matched),
        crease_corners=_crease_corners(matched),
    )
    return _pack(matched, first.then(room).then(last), field, report)


def _quad_sizes(mesh: TriMesh, field: CrossField, edge_length: float | None) -> Floats:
    """Edge length of the quads to come at each face: the field's, scaled to the mean asked for."""
    size = np.ones(mesh.n_faces) if field.size is None else field.size
    if not (size > 0).any():
        size = np.ones(mesh.n_faces)
    size = np.where(size > 0, size, np.median(size[size > 0]))
    if edge_length is None and (field.size is None or not field.size.any()):
        edge_length = float(np.sqrt(mesh.area / DEFAULT_QUADS))
    if edge_length is None:
        return size
    return size * edge_length * float(np.sqrt((mesh.face_areas / size**2).sum() / mesh.area))


def _count_creases(mesh: TriMesh, feature: Bools) -> int:
    return int((feature & (mesh.twin >= 0)).sum()) // 2


def _frayed(mesh: TriMesh, feature: Bools, dropped: Ints, shortest: float) -> Bools:
    """Crease halfedges on short branches that dropping some halfedges left loose; (3m,)."""
    crease = feature & (mesh.twin >= 0)
    pairs = mesh.edges[np.unique(mesh.halfedge_edge[crease])]
    at = np.zeros(mesh.n_vertices, dtype=bool)
    at[mesh.tail[dropped]] = True
    at[mesh.head[dropped]] = True
    kept = crease_halfedges(mesh, prune_branches(mesh, pairs, shortest, at))
    return crease & ~kept


def _cure(
    matched: MatchedField, distance: float, size: Floats
) -> tuple[MatchedField, Refinement, int]:
    """Every sector with the quads it needs; splits edges where vertices are too few."""
    total, count = no_refinement(matched.mesh), 0
    for _ in range(MOST_SPLITS):
        matched, moved = cure_low_sectors(matched, distance, size[total.parent])
        count += moved
        if not low_sectors(matched).any():
            return matched, total, count
        edges = np.ones(matched.mesh.n_edges, dtype=bool)
        edges[matched.mesh.halfedge_edge[matched.feature]] = False
        step = split_edges(matched.mesh, edges)
        matched, total = matched.refined(step), total.then(step)
    vertices = matched.sector_vertex[low_sectors(matched)]
    raise FieldError(
        f"{len(vertices)} vertices cannot get the quads they need, the first is {vertices[0]}; "
        "use a finer mesh, or leave out a crease that ends there"
    )


def _singularities(matched: MatchedField) -> dict[int, int]:
    plain = ~matched.sector_is_feature & matched.sector_is_singular
    return dict(sorted(Counter(matched.sector_quads[plain].tolist()).items()))


def _crease_corners(matched: MatchedField) -> dict[int, int]:
    vertex, n = matched.sector_vertex, matched.mesh.n_vertices
    quads = np.zeros(n, dtype=np.int64)
    np.add.at(quads, vertex, matched.sector_quads)
    on = np.zeros(n, dtype=bool)
    on[vertex[matched.sector_is_feature]] = True
    irregular = on & ~matched.mesh.is_boundary_vertex & (quads != 4)
    return dict(sorted(Counter(quads[irregular].tolist()).items()))


def _pack(
    matched: MatchedField, refinement: Refinement, field: CrossField, report: AlignReport
) -> AlignedField:
    return AlignedField(
        mesh=matched.mesh,
        parent_face=refinement.parent,
        angle=matched.angle,
        size=None if field.size is None else field.size[refinement.parent],
        trust=field.trust[refinement.parent],
        feature=matched.feature,
        axis=matched.axis,
        rotation=matched.rotation,
        sector=matched.corner_sector.reshape(-1, 3),
        sector_quads=matched.sector_quads,
        sector_vertex=matched.sector_vertex,
        sector_is_feature=matched.sector_is_feature,
        report=report,
    )

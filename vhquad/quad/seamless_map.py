"""A seamless map without flips that follows a cross field, rounded to exact integer coordinates.

The map minimises ``sum_f w_f A_f |grad (u, v) - s_f (X, X_perp)|^2`` over the seamless space
(Bommes et al. 2009, eq. 5, without any rounding of singularities), where the share of the gradient
of u along X, and of v along X_perp, counts for less than the share across: a map cannot have the
directions of a field and its sizes both, and edges that run off are seen sooner than quads that are
longer than wide. The surer the field is, the less sizes count. Only where the surface turns much
within a quad, as at the tip of a limb, they count as much, else the tip is cut off. The weights of
folded and strongly distorted triangles are raised until no triangle is folded (local stiffening,
ibid. 5.4) and the map turns by the right angle around every vertex; when few folds are left,
unfolding their surroundings may end it sooner (:mod:`vhquad.quad.untangle`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix, diags

from vhquad.field.align import AlignedField
from vhquad.geometry.sparse import SymmetricFactor
from vhquad.mesh.rings import within_rings
from vhquad.mesh.triangle import TriMesh, next_halfedge
from vhquad.quad.map_energy import MapEnergy
from vhquad.quad.sag import CreasePulls
from vhquad.quad.seamless import SeamlessSpace, seamless_space
from vhquad.quad.untangle import untangled

__all__ = ["SIZE_WEIGHT", "SeamlessMap", "solve_seamless_map"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

SIZE_WEIGHT = 0.01  # least one of sizes, against directions: where the field is sure
DOUBTED_WEIGHT = 0.1  # the same where it is not
TURN_POWER = 3  # where the field is sure, sizes count by so high a power of how the surface turns
FEW_FOLDS = 50  # that are worth unfolding by themselves
RINGS = 4  # of triangles around them
PULLING_SOLVES = 4  # to find out which creases need pulling, and how hard
UNITS_PER_EDGE = 1 << 20
"""Integer units in a mean mesh edge: fine enough for any triangle, and products stay in int64."""


@dataclass(frozen=True, eq=False)
class SeamlessMap:
    """Integer coordinates of the corners and the exact transitions between charts.

    Attributes
    ----------
    uv : (m, 3, 2) int64
        Coordinates of corner k of face f in the chart of f.
    unit : float
        Parametric length of one integer unit: ``uv * unit`` is in wanted quad edges if the field
        has sizes, in mesh units otherwise.
    rotation : (3m,) int64
        r of ``z_g = i^r z_f + t``, for the halfedge of f whose twin lies in g.
    translation : (3m, 2) int64
        t of the same; zero on boundaries.
    flips : int
        Triangles that are not positively oriented.
    wrong_angles : int
        Sectors around which the map does not turn by ``sector_quads`` quarter turns.
    solves : int
        Linear systems solved.
    """

    uv: Ints
    unit: float
    rotation: Ints
    translation: Ints
    flips: int
    wrong_angles: int
    solves: int

    @property
    def is_valid(self) -> bool:
        """No folded triangle and the right angle around every vertex."""
        return self.flips == 0 and self.wrong_angles == 0

    @property
    def area(self) -> float:
        """Area of the image, in squared parametric units."""
        return float(twice_area(self.uv).sum() * 0.5 * self.unit**2)


def twice_area(uv: Ints) -> Ints:
    """Twice the signed area of each triangle, exactly; (m,)."""
    a, b = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])


@dataclass(frozen=True)
class _Schedule:
    """A way of stiffening: triangles whose area shrinks below a share of the wanted one, or that
    are strongly distorted (if asked for), and the rings around them get larger weights."""

    share: float
    factor: float
    cap: float
    rings: int = 0
    distorted: bool = False


# Which of these ends without folds differs from mesh to mesh; the first mostly does, soonest.
_SCHEDULES = (
    _Schedule(share=0.2, factor=3.0, cap=1e6),
    _Schedule(share=0.1, factor=2.0, cap=1e6),
    _Schedule(share=0.1, factor=2.0, cap=1e4, rings=2, distorted=True),
    _Schedule(share=0.1, factor=2.0, cap=1e4, rings=1),
)
_SOLVES_EACH = 16
_PATIENCE = 8  # solves without fewer folds before the next schedule


def solve_seamless_map(
    aligned: AlignedField,
    *,
    size_weight: float = SIZE_WEIGHT,
    least_density: Floats | None = None,
    on_solve: Callable[[int, int], None] | None = None,
) -> SeamlessMap:
    """Seamless map of an aligned field; check ``is_valid`` on the result.

    Parameters
    ----------
    aligned : AlignedField
    size_weight : float
        Least weight of sizes against directions.
    least_density : (3m,) float64, optional
        Least quad edges per length along crease halfedges, as in :mod:`vhquad.quad.sag`.
    on_solve : callable, optional
        Called with (solves so far, folded triangles) after each solve.
    """
    space = seamless_space(aligned)
    pulls = None if least_density is None else CreasePulls(aligned, space, least_density)
    problem = _Problem(aligned, space, size_weight, pulls)
    solves = 0

    def attempt(weight: Floats) -> tuple[Floats, SeamlessMap]:
        nonlocal solves
        solves += 1
        unknowns = problem.solve(weight)
        candidate = _snap(aligned, space, problem, unknowns, solves)
        if 0 < candidate.flips <= FEW_FOLDS:
            smooth = untangled(problem.energy, unknowns, RINGS)
            other = _snap(aligned, space, problem, smooth, solves)
            candidate = other if other.is_valid else candidate
        if on_solve is not None:
            on_solve(solves, candidate.flips)
        return unknowns, candidate

    even = np.ones(aligned.mesh.n_faces)
    problem.pull_creases(even)
    first, best = attempt(even)
    if best.is_valid:
        return best
    for schedule in _SCHEDULES:
        weight, unknowns = even, first
        least, waited = aligned.mesh.n_faces + 1, 0
        for _ in range(_SOLVES_EACH):
            weight = problem.stiffen(weight, unknowns, schedule)
            unknowns, candidate = attempt(weight)
            if candidate.is_valid:
                return candidate
            best = min(best, candidate, key=lambda c: (c.flips, c.wrong_angles))
            waited = 0 if candidate.flips < least else waited + 1
            least = min(least, candidate.flips)
            if waited == _PATIENCE:
                break
    return best


class _Problem:
    """The quadratic energy over the seamless space."""

    def __init__(
        self,
        aligned: AlignedField,
        space: SeamlessSpace,
        size_weight: float,
        pulls: CreasePulls | None = None,
    ) -> None:
        mesh = aligned.mesh
        self.mesh = mesh
        self.wedge = space.wedge
        size = np.ones(mesh.n_faces) if aligned.size is None else aligned.size
        self.stretch = 1.0 / size
        self.wanted = float((mesh.face_areas / size**2).sum())  # area of the map
        local = _local_corners(mesh)
        # d/dz-bar and d/dz of the map in the face's frame come from these gradients.
        opposite = np.roll(local, 1, axis=1) - np.roll(local, -1, axis=1)
        area = np.maximum(mesh.face_areas, 1e-12 * mesh.face_areas.max())
        self.gradient = 1j * opposite / (2 * area[:, None])  # (m, 3) complex
        self.area = area
        normals = mesh.vertex_normals[mesh.faces]
        change = np.einsum("fk,fki->fi", self.gradient, normals)  # complex: d/dx + i d/dy
        turn = np.linalg.norm(change, axis=1) * size  # radians within a quad
        if aligned.size is None:
            self.size_weight = np.ones(mesh.n_faces)
        else:
            self.size_weight = np.maximum(size_weights(turn, aligned.trust), size_weight)
        self.target = self.stretch * np.exp(1j * space.angle)
        self.basis = (space.basis / space.denominator).tocsr()
        self.transpose = self.basis.T.tocsr()
        self.denominator = space.denominator
        self.pulls = pulls
        self._factor: SymmetricFactor | None = None  # of the last solve; weights alone change

    @cached_property
    def energy(self) -> MapEnergy:
        """Distortion of the maps of the space."""
        return MapEnergy(self.mesh, self.wedge, self.basis, self.target)

    def solve(self, weight: Floats) -> Floats:
        """Minimiser for the given face weights; (d,)."""
        wa = weight * self.area
        # Shares of the hat functions' gradients along X and X_perp.
        g = self.gradient * np.exp(-1j * np.angle(self.target))[:, None]
        n = self.basis.shape[0]
        i = np.repeat(self.wedge, 3, axis=1).ravel()
        j = np.tile(self.wedge, (1, 3)).ravel()
        blocks, right = [], np.zeros(n)
        for axis, along, across in ((0, g.real, g.imag), (1, g.imag, g.real)):
            local = self.size_weight[:, None, None] * along[:, :, None] * along[:, None, :]
            local += across[:, :, None] * across[:, None, :]
            values = (wa[:, None, None] * local).ravel()
            entries = (values, (2 * i + axis, 2 * j + axis))
            blocks.append(coo_matrix(entries, shape=(n, n)).tocsr())
            pull = (self.size_weight * wa * self.stretch)[:, None] * along
            right += np.bincount(2 * self.wedge.ravel() + axis, pull.ravel(), n)
        energy = blocks[0] + blocks[1]
        if self.pulls is not None:
            energy = energy + self.pulls.matrix
            right += self.pulls.right
        matrix = (self.transpose @ energy @ self.basis).tocsc()
        # Charts may drift together where nothing ties them down: hold them softly. The wanted
        # gradients do not care, so a weak pull on all unknowns changes nothing visible.
        matrix = matrix + diags(np.full(matrix.shape[0], 1e-9 * matrix.diagonal().mean()))
        factor = SymmetricFactor(matrix, like=self._factor)
        self._factor = factor
        return np.asarray(factor.solve(np.asarray(self.transpose @ right)))

    def pull_creases(self, weight: Floats) -> None:
        """Pull from now on where the map has too few quads along creases.

        Pulls make the map larger, and where it is scaled down to the count asked for creases lose
        again what they gained; so the sizes of the rest grow as the map does.
        """
        if self.pulls is None:
            return
        for _ in range(PULLING_SOLVES):
            unknowns = self.solve(weight)
            if not self.pulls.tighten(np.asarray(self.basis @ unknowns)):
                break
            z = self.corners(unknowns)
            a, b = z[:, 1] - z[:, 0], z[:, 2] - z[:, 0]
            area = 0.5 * float((a.conj() * b).imag.sum())  # of a map turned inside out below 0
            growth = np.sqrt(max(area / self.wanted, 1e-3))
            self.stretch = self.stretch / growth
            self.target = self.target / growth

    def corners(self, unknowns: Floats) -> NDArray[np.complex128]:
        """Chart coordinates of the corners; (m, 3) complex."""
        flat = np.asarray(self.basis @ unknowns)
        z = flat[0::2] + 1j * flat[1::2]
        return np.asarray(z[self.wedge])

    def stiffen(self, weight: Floats, unknowns: Floats, schedule: _Schedule) -> Floats:
        """Doubled weights on folded and distorted triangles and the rings around them."""
        z = self.corners(unknowns)
        # Complex derivatives: gradients are d/dx + i d/dy of the hat functions.
        holomorphic = 0.5 * (z * self.gradient.conj()).sum(axis=1)
        anti = 0.5 * (z * self.gradient).sum(axis=1)
        jacobian = (np.abs(holomorphic) ** 2 - np.abs(anti) ** 2) / self.stretch**2
        off = 2 * (
            np.abs(holomorphic / self.target.conj() - 1) ** 2 + np.abs(anti / self.target) ** 2
        )
        bad = jacobian < schedule.share
        if schedule.distorted:
            bad |= off > 1.5**2
        bad = within_rings(self.mesh.faces, bad, schedule.rings)
        return np.where(bad, np.minimum(schedule.factor * weight, schedule.cap), weight)


def size_weights(turn: Floats, trust: Floats) -> Floats:
    """Weight of sizes against directions at each face; (m,).

    Parameters
    ----------
    turn : (m,) float64
        Radians by which the surface turns within a quad.
    trust : (m,) float64
        In the directions of the field, from 0 to 1.
    """
    doubted = np.clip(turn, DOUBTED_WEIGHT, 1.0)
    sure = np.clip(DOUBTED_WEIGHT * turn**TURN_POWER, SIZE_WEIGHT, 1.0)
    return np.asarray(doubted ** (1.0 - trust) * sure**trust)


def _local_corners(mesh: TriMesh) -> NDArray[np.complex128]:
    """Corners of each face in its own frame (origin at corner 0, axis along halfedge 0)."""
    length = mesh.edge_lengths
    angle = mesh.corner_angles[:, 0]
    out = np.zeros((mesh.n_faces, 3), dtype=np.complex128)
    out[:, 1] = length[:, 0]
    out[:, 2] = length[:, 2] * np.exp(1j * angle)
    return out


def _snap(
    aligned: AlignedField,
    space: SeamlessSpace,
    problem: _Problem,
    unknowns: Floats,
    solves: int,
) -> SeamlessMap:
    """Round to integers: seamless to the last bit, and no ordinary vertex on a special isoline.

    Unknowns that place special vertices and features become multiples of 4, the others odd: an
    isoline through a special vertex then meets other vertices only where the constraints make it.
    """
    mesh = aligned.mesh
    z = problem.corners(unknowns)
    mean_edge = float(np.abs(np.roll(z, -1, axis=1) - z).mean())
    unit = mean_edge / UNITS_PER_EDGE
    scaled = unknowns / (unit * space.denominator)
    multiple = np.where(space.even, 4 * np.round(scaled / 4), 2 * np.floor(scaled / 2) + 1)
    flat = space.basis @ multiple.astype(np.int64)
    uv = np.stack([flat[0::2], flat[1::2]], axis=1)[space.wedge]
    translation = np.zeros((3 * mesh.n_faces, 2), dtype=np.int64)
    h = np.flatnonzero(mesh.twin >= 0)
    corners = uv.reshape(-1, 2)
    for near, far in ((h, next_halfedge(mesh.twin[h])), (next_halfedge(h), mesh.twin[h])):
        shift = corners[far] - rotate(corners[near], space.rotation[h])
        if near is h:
            translation[h] = shift
        elif (translation[h] != shift).any():
            raise AssertionError("the snapped map is not seamless")
    flips = int((twice_area(uv) <= 0).sum())
    return SeamlessMap(
        uv=uv,
        unit=unit,
        rotation=space.rotation,
        translation=translation,
        flips=flips,
        wrong_angles=_wrong_angles(aligned, uv),
        solves=solves,
    )


def rotate(z: Ints, quarter: Ints) -> Ints:
    """Integer pairs turned by quarter turns, elementwise; (q, 2)."""
    u, v = z[:, 0], z[:, 1]
    q = quarter % 4
    return np.stack(
        [
            np.choose(q, [u, -v, -u, v]),
            np.choose(q, [v, u, -v, -u]),
        ],
        axis=1,
    )


def _wrong_angles(aligned: AlignedField, uv: Ints) -> int:
    p = uv.astype(np.float64)
    forward = np.roll(p, -1, axis=1) - p
    backward = np.roll(p, 1, axis=1) - p
    sine = forward[..., 0] * backward[..., 1] - forward[..., 1] * backward[..., 0]
    cosine = (forward * backward).sum(axis=2)
    total = np.bincount(
        aligned.sector.ravel(),
        weights=np.arctan2(sine, cosine).ravel(),
        minlength=len(aligned.sector_quads),
    )
    wanted = aligned.sector_quads * (np.pi / 2)
    return int((np.abs(total - wanted) > 0.1).sum())

"""Box modelling: a cage of few polygons that grows by extrusion, as an artist makes it.

A :class:`Cage` starts as a box, a ring or a tube of quads. Regions of faces are extruded to limbs,
sunk to sockets and hollows, two of them bridged to handles, and loops of edges cut in. What is
mirrored is modelled as its half with x >= 0, open at the plane x = 0, where vertices stay;
:meth:`Cage.finished` adds the other half and subdivides. Every operation keeps the surface an
oriented manifold; one that could not raises :class:`Unfit`.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from vhquad.learn.subdivide import catmull_clark

__all__ = ["Cage", "Limb", "Model", "Unfit", "box", "polygon_step", "ring"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Face = tuple[int, ...]
Edge = tuple[int, int]


class Unfit(Exception):
    """A drawn shape cannot be modelled this way; draw another."""


@dataclass
class Limb:
    """What a sweep made: the new faces, ring by ring, and the cap's."""

    rings: list[list[int]]
    cap: list[int]

    @property
    def faces(self) -> list[int]:
        """All of them."""
        return [f for ring in self.rings for f in ring] + self.cap


@dataclass(frozen=True, eq=False)
class Model:
    """A finished mesh.

    Attributes
    ----------
    vertices : (n, 3) float64
    quads : (k, 4) int64
        Counter-clockwise seen from outside.
    mate : (n,) int64
        Mirror image of each vertex across x = 0; of a model that is not mirrored, itself.
    genus : int
        As constructed.
    """

    vertices: Floats
    quads: Ints
    mate: Ints
    genus: int


class Cage:
    """Polygons under construction; faces keep their numbers, removed ones are empty."""

    def __init__(
        self, vertices: Iterable[Floats], faces: Iterable[Face], half: bool, genus: int = 0
    ) -> None:
        self.vertices = [np.array(v, dtype=np.float64) for v in vertices]
        self.faces: list[Face] = list(faces)
        self.half = half
        self.genus = genus
        self.plane = {i for i, v in enumerate(self.vertices) if half and v[0] == 0.0}
        self.taken: set[int] = set()  # faces that no further limb may grow from

    # ---- looking ----------------------------------------------------------------------------

    def edges(self) -> dict[Edge, int]:
        """Directed edges and the face that each bounds."""
        return {
            (a, b): f
            for f, face in enumerate(self.faces)
            for a, b in zip(face, face[1:] + face[:1], strict=True)
        }

    def corners(self, faces: Sequence[int]) -> list[int]:
        """Vertices of faces, each once, in order."""
        return list(dict.fromkeys(v for f in faces for v in self.faces[f]))

    def free(self) -> list[int]:
        """Faces from which a limb may grow."""
        return [f for f in range(len(self.faces)) if self.faces[f] and f not in self.taken]

    def centre(self, faces: Sequence[int]) -> Floats:
        """Mean of the corners; on the plane if the region touches it."""
        corners = self.corners(faces)
        middle = np.mean([self.vertices[v] for v in corners], axis=0)
        if self.on_plane(faces):
            middle[0] = 0.0
        return np.asarray(middle)

    def normal(self, faces: Sequence[int]) -> Floats:
        """Mean normal, in the plane if the region touches it."""
        total = np.zeros(3)
        for f in faces:
            p = np.array([self.vertices[v] for v in self.faces[f]])
            total += 0.5 * np.cross(p, np.roll(p, -1, axis=0)).sum(axis=0)
        if self.on_plane(faces):
            total[0] = 0.0
        length = np.linalg.norm(total)
        if length == 0.0:
            raise Unfit("a region without a direction")
        return np.asarray(total / length)

    def radius(self, faces: Sequence[int]) -> float:
        """Mean distance of the rim from the centre."""
        middle = self.centre(faces)
        rim = {v for edge in self.rim(faces) for v in edge}
        return float(np.mean([np.linalg.norm(self.vertices[v] - middle) for v in sorted(rim)]))

    def on_plane(self, faces: Sequence[int]) -> bool:
        """Whether a region touches the mirror plane."""
        return any(v in self.plane for v in self.corners(faces))

    def rim(self, faces: Sequence[int]) -> list[Edge]:
        """The region's directed boundary edges in order, without those on the mirror plane."""
        every, own = self.edges(), set(faces)
        follow: dict[int, int] = {}
        for (a, b), f in every.items():
            if f in own and (b, a) in every and every[b, a] not in own:
                if a in follow:
                    raise Unfit("a region that touches itself")
                follow[a] = b
        if not follow:
            raise Unfit("a region without a rim")
        starts = sorted(set(follow) - set(follow.values()))
        if len(starts) > 1:
            raise Unfit("a region with several rims")
        start = starts[0] if starts else next(iter(follow))
        edges: list[Edge] = []
        at = start
        while at in follow and len(edges) < len(follow):
            edges.append((at, follow[at]))
            at = follow[at]
        if len(edges) < len(follow) or (not starts and at != start):
            raise Unfit("a region with several rims")
        held = [v for v in (start, *(b for _, b in edges)) if v in self.plane]
        if held != ([start, at] if starts else []):
            raise Unfit("a region that touches the mirror plane in a point")
        return edges

    def elements(self, kind: str, within: Iterable[int]) -> list[list[int]]:
        """Regions that may grow: one face, the two of an edge, all round a vertex or a face."""
        free = [f for f in within if self.faces[f] and f not in self.taken]
        if kind == "face":
            return [[f] for f in free]
        around: dict[int, list[int]] = {}
        for f in free:
            for v in self.faces[f]:
                around.setdefault(v, []).append(f)
        whole: dict[int, int] = {}
        for face in self.faces:
            for v in face:
                whole[v] = whole.get(v, 0) + 1
        inside = {v: fs for v, fs in around.items() if len(fs) == whole[v]}
        if kind == "vertex":
            return [sorted(fs) for fs in inside.values()]
        if kind == "edge":
            every, own = self.edges(), set(free)
            return [
                sorted((f, every[b, a]))
                for (a, b), f in every.items()
                if a < b and f in own and every.get((b, a)) in own
            ]
        if kind == "block":
            return [
                sorted({f for v in self.faces[face] for f in inside[v]})
                for face in free
                if all(v in inside for v in self.faces[face])
            ]
        raise ValueError(kind)

    def pick(
        self,
        kind: str,
        point: Floats,
        direction: Floats,
        within: Iterable[int] | None = None,
        off_plane: bool | None = None,
    ) -> list[int]:
        """The region of a kind nearest to a point and facing a direction."""
        faces = list(range(len(self.faces)) if within is None else within)
        span = np.ptp(self.vertices, axis=0).max()
        best, least = None, np.inf
        for region in self.elements(kind, faces):
            if off_plane is not None and off_plane == self.on_plane(region):
                continue
            try:
                self.rim(region)
                cost = np.linalg.norm(self.centre(region) - point) / span
                cost -= 0.35 * float(self.normal(region) @ direction)
            except Unfit:
                continue
            if cost < least:
                best, least = region, cost
        if best is None:
            raise Unfit("no room for a limb")
        return best

    def copy(self) -> Cage:
        """Another cage like this one."""
        other = Cage(self.vertices, self.faces, self.half, self.genus)
        other.plane, other.taken = set(self.plane), set(self.taken)
        return other

    # ---- growing ----------------------------------------------------------------------------

    def _add(self, position: Floats, plane: bool) -> int:
        self.vertices.append(np.array(position))
        if plane:
            self.plane.add(len(self.vertices) - 1)
        return len(self.vertices) - 1

    def extrude(self, region: Sequence[int]) -> list[int]:
        """Raise a region: the same faces on new vertices, and quads along the rim; their numbers.

        The new vertices lie where the old ones do; move them.
        """
        rim = self.rim(region)
        old = list(dict.fromkeys(v for edge in rim for v in edge))
        new = {v: self._add(self.vertices[v], v in self.plane) for v in old}
        for f in region:
            self.faces[f] = tuple(new.get(v, v) for v in self.faces[f])
        first = len(self.faces)
        self.faces += [(a, b, new[b], new[a]) for a, b in rim]
        return list(range(first, len(self.faces)))

    def sweep(
        self,
        region: Sequence[int],
        spine: Floats,
        scales: Floats,
        round_off: float = 0.7,
        thin: tuple[Floats, float] | None = None,
        twist: float = 0.0,
    ) -> Limb:
        """Extrude a region along a spine, a ring of quads for each of its points.

        Parameters
        ----------
        region : faces
        spine : (n, 3)
            Where the centres of the rings go.
        scales : (n,)
            Their sizes, the region's own being 1.
        round_off : float
            How far the section becomes a circle.
        thin : (direction, factor), optional
            The section is multiplied in this direction by a factor that it reaches half-way.
        twist : float
            Radians, in all; none on the mirror plane.
        """
        plane = self.on_plane(region)
        middle, normal = self.centre(region), self.normal(region)
        rings: list[list[int]] = []
        rim = {v for edge in self.rim(region) for v in edge}
        corners = self.corners(region)
        at = np.array([self.vertices[v] for v in corners]) - middle
        height = at @ normal
        flat = at - height[:, None] * normal
        reach = np.linalg.norm(flat, axis=1)
        on_rim = np.array([v in rim for v in corners])
        mean = reach[on_rim].mean()
        circle = flat * (mean / np.maximum(reach, 1e-9))[:, None]
        circle[~on_rim] = flat[~on_rim]
        thin_axis = np.zeros(3) if thin is None else thin[0] - (thin[0] @ normal) * normal
        length = np.linalg.norm(thin_axis)
        if thin is not None and length < 1e-3:
            thin = None
        points = np.concatenate([middle[None], spine])
        steps = np.diff(points, axis=0)
        steps /= np.maximum(np.linalg.norm(steps, axis=1), 1e-12)[:, None]
        facing, turn = normal, np.eye(3)
        n = len(spine)
        for i in range(n):
            ahead = steps[i] + steps[min(i + 1, n - 1)]
            ahead = ahead / max(float(np.linalg.norm(ahead)), 1e-12)
            turn = _least_turn(facing, ahead) @ turn
            facing = ahead
            t = (i + 1) / n
            share = round_off * (1.0 - 0.5 ** (i + 1))
            section = (1.0 - share) * flat + share * circle
            if thin is not None:
                axis = thin_axis / length
                factor = 1.0 + (thin[1] - 1.0) * min(1.0, 2.0 * t)
                section = section + (factor - 1.0) * (section @ axis)[:, None] * axis
            if twist and not plane:
                section = section @ _about(normal, twist * t).T
            section = section + (0.5 ** (i + 1) * height)[:, None] * normal
            rings.append(self.extrude(region))
            moved = points[i + 1] + scales[i] * section @ turn.T
            for v, position in zip(self.corners(region), moved, strict=True):
                self.vertices[v] = position
        self.taken.update(f for ring in rings for f in ring)
        return Limb(rings, list(region))

    def sink(
        self,
        region: Sequence[int],
        depths: Sequence[float] | Floats,
        scales: Sequence[float] | Floats,
    ) -> Limb:
        """Extrude a region straight inwards (outwards, where a depth is negative)."""
        middle, normal = self.centre(region), self.normal(region)
        shape = np.array([self.vertices[v] for v in self.corners(region)]) - middle
        rings = []
        for depth, scale in zip(depths, scales, strict=True):
            rings.append(self.extrude(region))
            moved = middle - depth * normal + scale * shape
            for v, position in zip(self.corners(region), moved, strict=True):
                self.vertices[v] = position
        self.taken.update([f for ring in rings for f in ring] + list(region))
        return Limb(rings, list(region))

    def close_to_point(self, limb: Limb) -> None:
        """Gather a limb's cap in one vertex: its last ring becomes triangles."""
        tip = self._add(self.centre(limb.cap), self.on_plane(limb.cap))
        for f in limb.rings[-1]:
            a, b, _, _ = self.faces[f]
            self.faces[f] = (a, b, tip)
        for f in limb.cap:
            self.faces[f] = ()

    def bridge(
        self, one: Sequence[int], other: Sequence[int], spine: Floats, scales: Floats
    ) -> list[int]:
        """Join two regions by a tube along a spine; a handle if they were on one surface."""
        if set(self.corners(one)) & set(self.corners(other)):
            raise Unfit("a handle whose ends touch")
        plane = self.on_plane(one)
        if plane != self.on_plane(other) or len(self.rim(one)) != len(self.rim(other)):
            raise Unfit("a handle whose ends differ")
        limb = self.sweep(one, spine, scales)
        a = [edge[0] for edge in self.rim(one)] + [self.rim(one)[-1][1]] * plane
        b = [edge[0] for edge in self.rim(other)] + [self.rim(other)[-1][1]] * plane
        b = b[::-1]
        at = np.array([self.vertices[v] for v in a]) - self.centre(one)
        to = np.array([self.vertices[v] for v in b]) - self.centre(other)
        shifts = [0] if plane else range(len(a))
        shift = max(shifts, key=lambda s: float((at * np.roll(to, -s, axis=0)).sum()))
        b = b[shift:] + b[:shift]
        for f in (*one, *other):
            self.faces[f] = ()
        first = len(self.faces)
        count = len(a) - 1 if plane else len(a)
        for i in range(count):
            j = (i + 1) % len(a)
            self.faces.append((a[i], a[j], b[j], b[i]))
        self.genus += 1 if plane or not self.half else 2
        made = list(range(first, len(self.faces)))
        self.taken.update(made)
        return [f for ring in limb.rings for f in ring] + made

    def even_out(self, most: int, ratio: float) -> None:
        """Cut the widest strips of quads in two, at most so many, till none is ``ratio`` wider
        than the median edge is long: artists keep their quads near square."""
        for _ in range(most):
            seen: set[frozenset[int]] = set()
            lengths, widest, start = [], 0.0, None
            for edge in self.edges():
                if frozenset(edge) in seen:
                    continue
                strip = self._strip(edge)
                seen.add(frozenset(edge))
                seen.update(frozenset(e) for _, *pair in strip for e in pair)
                across = [
                    np.linalg.norm(self.vertices[p] - self.vertices[q]) for _, (p, q), _ in strip
                ]
                lengths += across
                if across and np.mean(across) > widest:
                    widest, start = float(np.mean(across)), edge
            if start is None or widest < ratio * np.median(lengths) or not self.cut(start, 0.5):
                return

    def relax(self, share: float) -> None:
        """Move each vertex towards the mean of its neighbours."""
        around: list[set[int]] = [set() for _ in self.vertices]
        for a, b in self.edges():
            around[a].add(b)
            around[b].add(a)
        moved = []
        for v, others in enumerate(around):
            place = self.vertices[v].copy()
            if others:
                mean = np.mean([self.vertices[w] for w in sorted(others)], axis=0)
                place += share * (mean - place)
            if v in self.plane:
                place[0] = 0.0
            moved.append(place)
        self.vertices = moved

    def cut(self, start: Edge, share: float) -> bool:
        """Cut a loop of edges through the strip of quads across an edge; whether there is one."""
        strip = self._strip(start)
        middle: dict[frozenset[int], int] = {}
        for _, near, far in strip:
            for p, q in (near, far):
                key = frozenset((p, q))
                if key not in middle:
                    position = (1.0 - share) * self.vertices[p] + share * self.vertices[q]
                    middle[key] = self._add(position, p in self.plane and q in self.plane)
        for f, (p, q), (r, s) in strip:
            m, n = middle[frozenset((p, q))], middle[frozenset((r, s))]
            face = self.faces[f]
            one, two = [p, m, n, r], [m, q, s, n]
            if face[(face.index(p) + 1) % 4] != q:
                one, two = one[::-1], two[::-1]
            self.faces[f] = tuple(one)
            self.faces.append(tuple(two))
            if f in self.taken:
                self.taken.add(len(self.faces) - 1)
        return bool(strip)

    def _strip(self, start: Edge) -> list[tuple[int, Edge, Edge]]:
        """The quads across an edge, one behind the other, each with the two edges to be cut, that
        side first where start[0] lies; empty if it crosses itself or meets another polygon."""
        every = self.edges()
        strip: list[tuple[int, Edge, Edge]] = []
        seen: set[int] = set()
        for back in (False, True):
            a, b = start[::-1] if back else start
            while (a, b) in every:
                f = every[a, b]
                face = self.faces[f]
                if f in seen or len(face) != 4:
                    return []
                seen.add(f)
                k = face.index(a)
                d, c = face[k - 1], face[(k + 2) % 4]
                strip.append((f, (b, a), (c, d)) if back else (f, (a, b), (d, c)))
                a, b = d, c
                if (a, b) == start:
                    return strip
        return strip

    # ---- finishing --------------------------------------------------------------------------

    def finished(self, levels: int) -> Model:
        """The mirrored cage after some Catmull-Clark steps."""
        faces = [face for face in self.faces if face]
        used = sorted({v for face in faces for v in face})
        place = {v: i for i, v in enumerate(used)}
        vertices = np.array([self.vertices[v] for v in used])
        faces = [tuple(place[v] for v in face) for face in faces]
        if self.half:
            plane = np.array([v in self.plane for v in used])
            vertices[plane, 0] = 0.0
            if (vertices[~plane, 0] < 1e-3 * np.ptp(vertices[:, 0])).any():
                raise Unfit("it grows through its mirror image")
            other = np.arange(len(used))
            other[~plane] = len(used) + np.arange((~plane).sum())
            faces += [tuple(int(other[v]) for v in face[::-1]) for face in faces]
            vertices = np.concatenate([vertices, vertices[~plane] * [-1.0, 1.0, 1.0]])
        vertices, quads = polygon_step(vertices, faces)
        for _ in range(levels - 1):
            fine = catmull_clark(vertices, quads)
            vertices, quads = fine.vertices, fine.quads
        mate = np.arange(len(vertices))
        if self.half:
            mate = _mates(vertices)
            vertices = 0.5 * (vertices + vertices[mate] * [-1.0, 1.0, 1.0])
        return Model(vertices, quads, mate, self.genus)


def box(counts: tuple[int, int, int], half: bool) -> Cage:
    """The surface of [-1, 1]^3 as a grid; ``half``: of its part with x >= 0, counts[0] cells."""
    nx, ny, nz = counts
    ticks = [np.linspace(0.0 if half else -1.0, 1.0, nx + 1)]
    ticks += [np.linspace(-1.0, 1.0, n + 1) for n in (ny, nz)]
    number: dict[tuple[int, int, int], int] = {}
    vertices: list[Floats] = []

    def corner(*place: int) -> int:
        key = (place[0], place[1], place[2])
        if key not in number:
            number[key] = len(vertices)
            vertices.append(np.array([ticks[k][key[k]] for k in range(3)]))
        return number[key]

    faces: list[Face] = []
    for axis in range(3):
        u, w = (axis + 1) % 3, (axis + 2) % 3
        for side in (0, counts[axis]):
            if half and axis == 0 and side == 0:
                continue
            for i in range(counts[u]):
                for j in range(counts[w]):
                    face = []
                    for di, dj in ((0, 0), (1, 0), (1, 1), (0, 1)):
                        place = [0, 0, 0]
                        place[axis], place[u], place[w] = side, i + di, j + dj
                        face.append(corner(*place))
                    faces.append(tuple(face if side else face[::-1]))
    return Cage(vertices, faces, half)


def ring(around: int, section: int, half: bool, radius: float) -> Cage:
    """A torus about the y axis with tube radius 1; ``half``: its part with x >= 0."""
    span = np.pi if half else 2.0 * np.pi
    n = around + 1 if half else around
    angle = np.arange(n) * span / around
    phase = 2.0 * np.pi * (np.arange(section) + 0.5) / section
    vertices = []
    for a in angle:
        for p in phase:
            r = radius + np.cos(p)
            vertices.append(np.array([r * np.sin(a), np.sin(p), r * np.cos(a)]))
    if half:
        for v in vertices[:section] + vertices[-section:]:
            v[0] = 0.0
    faces = []
    for i in range(around):
        for j in range(section):
            k, m = (i + 1) % n, (j + 1) % section
            faces.append((i * section + j, k * section + j, k * section + m, i * section + m))
    return Cage(vertices, faces, half, genus=1)


def polygon_step(vertices: Floats, faces: Sequence[Face]) -> tuple[Floats, Ints]:
    """One Catmull-Clark step on a closed mesh of any polygons; all quads after it."""
    n = len(vertices)
    sizes = np.array([len(face) for face in faces])
    tail = np.concatenate([np.array(face) for face in faces])
    head = np.concatenate([np.roll(face, -1) for face in faces])
    owner = np.repeat(np.arange(len(faces)), sizes)
    key = np.minimum(tail, head) * np.int64(n) + np.maximum(tail, head)
    unique, edge, count = np.unique(key, return_inverse=True, return_counts=True)
    if (count != 2).any():
        raise Unfit("an edge without two faces")
    face_point = _sums(vertices[tail], owner, len(faces)) / sizes[:, None]
    middle = 0.5 * (vertices[unique // n] + vertices[unique % n])
    edge_point = 0.5 * (middle + 0.5 * _sums(face_point[owner], edge, len(unique)))
    valence = np.bincount(tail, minlength=n)[:, None]
    faces_mean = _sums(face_point[owner], tail, n) / valence
    edges_mean = _sums(middle[edge], tail, n) / valence
    moved = (faces_mean + 2.0 * edges_mean + (valence - 3.0) * vertices) / valence
    before = np.concatenate(
        [np.roll(part, 1) for part in np.split(edge, np.cumsum(sizes)[:-1])]
    )  # edge that ends at each tail
    quads = np.stack([tail, n + edge, n + len(unique) + owner, n + before], axis=1)
    return np.concatenate([moved, edge_point, face_point]), quads.astype(np.int64)


def _sums(values: Floats, place: Ints, n: int) -> Floats:
    total = np.zeros((n, 3))
    np.add.at(total, place, values)
    return total


def _mates(vertices: Floats) -> Ints:
    """For each vertex the one nearest to its mirror image."""
    found = cKDTree(vertices).query(vertices * [-1.0, 1.0, 1.0])
    distance, mate = np.asarray(found[0]), np.asarray(found[1], dtype=np.int64)
    if distance.max() > 1e-9 * np.ptp(vertices) or (mate[mate] != np.arange(len(mate))).any():
        raise Unfit("vertices that coincide")
    return mate


def _least_turn(a: Floats, b: Floats) -> Floats:
    """The smallest rotation that takes one unit vector to another."""
    axis, cos = np.cross(a, b), float(a @ b)
    if cos < -0.99:
        raise Unfit("a limb that folds back")
    k = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    return np.asarray(np.eye(3) + k + k @ k / (1.0 + cos))


def _about(axis: Floats, angle: float) -> Floats:
    k = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    return np.asarray(np.eye(3) + np.sin(angle) * k + (1.0 - np.cos(angle)) * k @ k)

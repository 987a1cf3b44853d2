"""Cells: polygons that are edited one at a time, for the few that need it."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from vhquad.quad.ragged import PolygonMesh

__all__ = ["Cells"]

Floats = NDArray[np.float64]


class Cells:
    """Polygons as lists of halfedges, edited in place; every edit keeps the topology.

    Parameters
    ----------
    mesh : PolygonMesh
        Polygons to start from; vertices keep their numbers, new ones follow.
    """

    def __init__(self, mesh: PolygonMesh) -> None:
        start = mesh.start.tolist()
        self.faces: list[list[int]] = [list(range(a, b)) for a, b in pairwise(start)]
        self.tail: list[int] = mesh.corners.tolist()
        self.twin: list[int] = mesh.twin.tolist()
        self.face: list[int] = mesh.polygon.tolist()
        self.points: list[Floats] = list(mesh.vertices)

    # ---- looking --------------------------------------------------------------------------

    def head(self, h: int) -> int:
        """Vertex at which a halfedge ends."""
        face = self.faces[self.face[h]]
        return self.tail[face[(face.index(h) + 1) % len(face)]]

    def corners(self, f: int) -> list[int]:
        """Vertices of a face."""
        return [self.tail[h] for h in self.faces[f]]

    def alive(self) -> list[int]:
        """Faces that are left."""
        return [f for f, face in enumerate(self.faces) if face]

    def edges(self) -> list[tuple[int, int, int]]:
        """Each edge as a halfedge and its two vertices, the lower first."""
        out = []
        for face in self.faces:
            for h, after in zip(face, face[1:] + face[:1], strict=True):
                if self.twin[h] < 0 or h < self.twin[h]:
                    a, b = self.tail[h], self.tail[after]
                    out.append((h, min(a, b), max(a, b)))
        return out

    # ---- editing --------------------------------------------------------------------------

    def _new(self, tail: int, twin: int, face: int) -> int:
        self.tail.append(tail)
        self.twin.append(twin)
        self.face.append(face)
        return len(self.tail) - 1

    def add_vertex(self, point: Floats) -> int:
        """A new vertex."""
        self.points.append(point)
        return len(self.points) - 1

    def split_edge(self, h: int) -> int:
        """Put a vertex in the middle of an edge; both its faces gain a side. The vertex."""
        t = self.twin[h]
        w = self.add_vertex(0.5 * (self.points[self.tail[h]] + self.points[self.head(h)]))
        ahead = self._new(w, t, self.face[h])
        self._insert(h, ahead)
        if t >= 0:
            back = self._new(w, h, self.face[t])
            self._insert(t, back)
            self.twin[h], self.twin[t] = back, ahead
        return w

    def _insert(self, h: int, after: int) -> None:
        face = self.faces[self.face[h]]
        face.insert(face.index(h) + 1, after)

    def cut(self, f: int, i: int, j: int) -> int:
        """Cut a face along the line between its corners i < j; the new face has corners i..j."""
        face = self.faces[f]
        g = len(self.faces)
        inner = self._new(self.tail[face[j]], -1, g)
        outer = self._new(self.tail[face[i]], inner, f)
        self.twin[inner] = outer
        self.faces.append([*face[i:j], inner])
        for h in face[i:j]:
            self.face[h] = g
        self.faces[f] = [*face[:i], outer, *face[j:]]
        return g

    def star(self, f: int, first: int) -> int:
        """Cut a face of 2k sides into k quads around a new vertex joined to corners first + 2i."""
        face = self.faces[f][first:] + self.faces[f][:first]
        centre = np.mean([self.points[v] for v in self.corners(f)], axis=0)
        w = self.add_vertex(np.asarray(centre))
        self.faces[f] = []
        spokes = []
        for i in range(0, len(face), 2):
            a, b = face[i], face[i + 1]
            last = face[(i + 2) % len(face)]
            g = len(self.faces)
            inward = self._new(self.tail[last], -1, g)
            outward = self._new(w, -1, g)
            self.faces.append([a, b, inward, outward])
            self.face[a] = self.face[b] = g
            spokes.append((inward, outward))
        for (inward, _), (_, outward) in zip(spokes, spokes[1:] + spokes[:1], strict=True):
            self.twin[inward], self.twin[outward] = outward, inward
        return w

    def merge(self, h: int) -> int:
        """Drop an edge between two different faces; the face that stays."""
        t = self.twin[h]
        f, g = self.face[h], self.face[t]
        one, two = self.faces[f], self.faces[g]
        i, j = one.index(h), two.index(t)
        rest = two[j + 1 :] + two[:j]
        for k in rest:
            self.face[k] = f
        self.faces[f] = one[i + 1 :] + one[:i] + rest
        self.faces[g] = []
        return f

    def prune(self, f: int) -> None:
        """Drop the edges of a face that it has on both sides of a vertex of one edge."""
        face = self.faces[f]
        i = 0
        while len(face) > 2 and i < len(face):
            h, after = face[i], face[(i + 1) % len(face)]
            if self.twin[h] == after:
                face = [k for k in face if k not in (h, after)]
                i = 0
            else:
                i += 1
        self.faces[f] = face

    def mesh(self) -> PolygonMesh:
        """The polygons as arrays; vertices keep their numbers, used or not."""
        order = [h for face in self.faces for h in face]
        place = np.full(len(self.tail), -1, dtype=np.int64)
        place[order] = np.arange(len(order))
        twin = np.array([self.twin[h] for h in order], dtype=np.int64)
        sides = [len(face) for face in self.faces if face]
        return PolygonMesh(
            np.array(self.points).reshape(-1, 3),
            np.array([self.tail[h] for h in order], dtype=np.int64),
            np.cumsum([0, *sides]).astype(np.int64),
            np.where(twin >= 0, place[np.maximum(twin, 0)], -1),
        )

"""Refinement that keeps the surface: splitting edges at midpoints and faces at centroids.

Every new face lies in the plane of its parent, so whatever lives on the old faces and halfedges
can be carried over exactly; a :class:`Refinement` says how.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from vhquad.field.dual import face_angles
from vhquad.mesh.triangle import TriMesh, next_halfedge, prev_halfedge

__all__ = ["Refinement", "lengths_of_edges", "no_refinement", "split_edges", "split_faces"]

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Bools = NDArray[np.bool_]
T = TypeVar("T", bound=np.generic)


@dataclass(frozen=True, eq=False)
class Refinement:
    """A refined mesh and where its parts come from.

    Attributes
    ----------
    mesh : TriMesh
        Vertices of the old mesh keep their index.
    parent : (m,) int64
        Old face in which each face lies.
    turn : (m,) float64
        Angle of the face's axis (its halfedge 0) in the frame of ``parent``, radians.
    source : (3m,) int64
        Old halfedge on which each halfedge lies, in the same direction; -1 within old faces.
    """

    mesh: TriMesh
    parent: Ints
    turn: Floats
    source: Ints

    def carry(self, values: NDArray[T], fill: float | bool) -> NDArray[T]:
        """Values on old halfedges, brought to the new ones; ``fill`` on those within old faces."""
        inherited = values[self.source]
        return np.where(self.source >= 0, inherited, np.asarray(fill, dtype=values.dtype))

    def then(self, later: Refinement) -> Refinement:
        """This refinement followed by one of its mesh."""
        return Refinement(
            later.mesh,
            self.parent[later.parent],
            self.turn[later.parent] + later.turn,
            later.carry(self.source, -1),
        )


def no_refinement(mesh: TriMesh) -> Refinement:
    """The refinement that changes nothing."""
    return Refinement(
        mesh, np.arange(mesh.n_faces), np.zeros(mesh.n_faces), np.arange(3 * mesh.n_faces)
    )


def split_edges(mesh: TriMesh, marked: Bools, priority: Floats | None = None) -> Refinement:
    """Split marked edges at their midpoints, at most one in a face.

    Parameters
    ----------
    mesh : TriMesh
    marked : (ne,) bool
        Edges that may be split; call again with what is still to be split.
    priority : (ne,) float64, optional
        The edge with the highest goes first. Default: the length.

    Returns
    -------
    Refinement
        At least one marked edge was split, if there was one.
    """
    if priority is None:
        priority = lengths_of_edges(mesh)
    chosen = _independent(mesh, marked, priority)
    if chosen.size == 0:
        return no_refinement(mesh)
    ends = mesh.edges[chosen]
    midpoint = np.full(mesh.n_edges, -1, dtype=np.int64)
    midpoint[chosen] = mesh.n_vertices + np.arange(len(chosen))
    h = np.flatnonzero(midpoint[mesh.halfedge_edge] >= 0)
    face, mid = h // 3, midpoint[mesh.halfedge_edge[h]]
    after, before = next_halfedge(h), prev_halfedge(h)
    first, second, third = mesh.tail[h], mesh.tail[after], mesh.tail[before]
    new = mesh.n_faces + np.arange(len(h))

    start = no_refinement(mesh)
    faces = np.concatenate([mesh.faces, np.stack([mid, second, third], axis=1)])
    faces[face] = np.stack([first, mid, third], axis=1)
    parent = np.concatenate([start.parent, face])
    turn = np.concatenate([start.turn, np.zeros(len(h))])
    turn[face] = turn[new] = face_angles(mesh)[h]
    none = np.full(len(h), -1)
    source = np.concatenate([start.source.reshape(-1, 3), np.stack([h, after, none], axis=1)])
    source[face] = np.stack([h, none, before], axis=1)
    vertices = np.concatenate([mesh.vertices, mesh.vertices[ends].mean(axis=1)])
    return Refinement(TriMesh(vertices, faces), parent, turn, source.reshape(-1))


def lengths_of_edges(mesh: TriMesh) -> Floats:
    """Length of each edge; (ne,)."""
    length = np.zeros(mesh.n_edges)
    length[mesh.halfedge_edge] = mesh.edge_lengths.reshape(-1)
    return length


def split_faces(mesh: TriMesh, marked: Bools) -> Refinement:
    """Split marked faces in three at their centroids.

    Parameters
    ----------
    mesh : TriMesh
    marked : (m,) bool
    """
    face = np.flatnonzero(marked)
    if face.size == 0:
        return no_refinement(mesh)
    start = no_refinement(mesh)
    centre = mesh.n_vertices + np.arange(len(face))
    corner = mesh.faces[face]
    parts = [np.stack([corner[:, k], corner[:, (k + 1) % 3], centre], axis=1) for k in range(3)]
    none = np.full(len(face), -1)
    sources = [np.stack([3 * face + k, none, none], axis=1) for k in range(3)]
    angle = face_angles(mesh).reshape(-1, 3)[face]
    faces = np.concatenate([mesh.faces, parts[1], parts[2]])
    source = np.concatenate([start.source.reshape(-1, 3), sources[1], sources[2]])
    turn = np.concatenate([start.turn, angle[:, 1], angle[:, 2]])
    faces[face], source[face] = parts[0], sources[0]
    vertices = np.concatenate([mesh.vertices, mesh.vertices[corner].mean(axis=1)])
    return Refinement(
        TriMesh(vertices, faces),
        np.concatenate([start.parent, face, face]),
        turn,
        source.reshape(-1),
    )


def _independent(mesh: TriMesh, marked: Bools, priority: Floats) -> Ints:
    """Marked edges that are the first marked one in each of their faces."""
    edge_of = mesh.halfedge_edge.reshape(-1, 3)
    rank = np.zeros(mesh.n_edges, dtype=np.int64)
    rank[np.argsort(priority, kind="stable")] = np.arange(1, mesh.n_edges + 1)
    rank[~marked] = 0
    in_face = rank[edge_of]
    beaten = in_face < in_face.max(axis=1, keepdims=True)
    chosen = marked.copy()
    chosen[edge_of[beaten]] = False
    return np.flatnonzero(chosen)

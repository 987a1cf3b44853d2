"""Split edges under a seamless space: more room for a map, and every old unknown keeps its meaning.

A split adds a vertex at the middle of an edge. Its place is free, so the basis gains two unknowns;
across a cut edge it has a second wedge, at the far end of the transition of that edge.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import block_array, csr_matrix, eye_array

from vhquad.field.align import AlignedField
from vhquad.field.refine import Refinement, split_edges
from vhquad.mesh.triangle import next_halfedge
from vhquad.quad.seamless import SeamlessSpace

__all__ = ["SplitSpace", "split_space"]

Ints = NDArray[np.int64]
Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class SplitSpace:
    """A field and its seamless space on a finer mesh.

    Attributes
    ----------
    aligned : AlignedField
    space : SeamlessSpace
        The unknowns of the coarser space, then two for each new vertex.
    middle : (2 k, d) csr_matrix
        The new unknowns over the old ones when every new vertex lies half way along its edge.
    """

    aligned: AlignedField
    space: SeamlessSpace
    middle: csr_matrix


def split_space(aligned: AlignedField, space: SeamlessSpace, faces: Ints) -> SplitSpace:
    """Split the longest edge that is no feature in each of some faces, or in one of neighbours.

    Parameters
    ----------
    aligned : AlignedField
    space : SeamlessSpace
        That of the field, or one of its splits.
    faces : (q,) int64
    """
    mesh = aligned.mesh
    marked = np.zeros(mesh.n_edges, dtype=bool)
    marked[mesh.halfedge_edge.reshape(-1, 3)[faces]] = True
    marked[mesh.halfedge_edge[aligned.feature]] = False
    step = split_edges(mesh, marked)
    edge = _split_edge_of(aligned, step)
    near = mesh.edge_halfedges[edge, 0]
    far = mesh.twin[near]
    k = len(edge)

    # Rows of the new wedges: near ones free; far ones i^r z + t with t that of the edge's ends.
    old = space.wedge.reshape(-1)
    one = space.denominator * eye_array(2 * k, dtype=np.int64, format="csr")
    r = space.rotation[near]
    turn = _turns(r)
    shift = _rows(space.basis, old[next_halfedge(far)]) - turn @ _rows(space.basis, old[near])
    blocks: list[list[Any]] = [[space.basis, None], [None, one], [shift, turn @ one]]
    basis = csr_matrix(block_array(blocks))
    wedge_of = np.full(3 * mesh.n_faces, -1, dtype=np.int64)  # of the middle, by old halfedge
    wedge_of[near] = space.n_wedges + np.arange(k)
    wedge_of[far] = space.n_wedges + k + np.arange(k)
    middle = _rows(space.basis, old[near]) + _rows(space.basis, old[next_halfedge(near)])
    return SplitSpace(
        aligned=_carried(aligned, step),
        space=SeamlessSpace(
            wedge=_corners(aligned, step, old, wedge_of),
            rotation=step.carry(space.rotation, 0),
            angle=space.angle[step.parent] - step.turn,
            basis=basis,
            denominator=space.denominator,
            even=np.append(space.even, np.zeros(2 * k, dtype=bool)),
        ),
        middle=(middle / (2 * space.denominator)).tocsr(),
    )


def _rows(basis: csr_matrix, wedge: Ints) -> csr_matrix:
    """Rows (u, v) of wedges."""
    return basis[np.stack([2 * wedge, 2 * wedge + 1], axis=1).ravel()]


def _turns(quarter: Ints) -> csr_matrix:
    """Quarter turns of pairs as a block-diagonal matrix."""
    c = np.array([1, 0, -1, 0])[quarter % 4]
    s = np.array([0, 1, 0, -1])[quarter % 4]
    first = 2 * np.arange(len(quarter))
    rows = np.concatenate([first, first, first + 1, first + 1])
    cols = np.concatenate([first, first + 1, first, first + 1])
    shape = (2 * len(quarter), 2 * len(quarter))
    return csr_matrix((np.concatenate([c, -s, s, c]), (rows, cols)), shape=shape)


def _split_edge_of(aligned: AlignedField, step: Refinement) -> Ints:
    """Old edge of each new vertex."""
    old, new = aligned.mesh, step.mesh
    edge = np.zeros(new.n_vertices - old.n_vertices, dtype=np.int64)
    h = np.flatnonzero((new.tail >= old.n_vertices) & (step.source >= 0))
    edge[new.tail[h] - old.n_vertices] = old.halfedge_edge[step.source[h]]
    return edge


def _corners(aligned: AlignedField, step: Refinement, kept: Ints, added: Ints) -> Ints:
    """Values at corners: those of old corners, and by old halfedge at its new middle; (m, 3)."""
    old, new = aligned.mesh, step.mesh
    parent = old.faces[step.parent]  # (m, 3) old vertices
    out = np.zeros((new.n_faces, 3), dtype=np.int64)
    for k in range(3):
        same = parent == new.faces[:, k : k + 1]
        corner = 3 * step.parent + np.argmax(same, axis=1)
        out[:, k] = kept[corner]
    middle = _split_edge_of(aligned, step)
    edge_of = old.halfedge_edge.reshape(-1, 3)[step.parent]
    face, place = np.nonzero(new.faces >= old.n_vertices)
    own = edge_of[face] == middle[new.faces[face, place] - old.n_vertices][:, None]
    out[face, place] = added[3 * step.parent[face] + np.argmax(own, axis=1)]
    return out


def _carried(aligned: AlignedField, step: Refinement) -> AlignedField:
    """The field on the refined mesh; new vertices are ordinary."""
    old, new = aligned.mesh, step.mesh
    added = np.arange(old.n_vertices, new.n_vertices)
    first = len(aligned.sector_quads)
    sector_of = np.zeros(3 * old.n_faces, dtype=np.int64)
    edge = _split_edge_of(aligned, step)
    for side in (0, 1):
        sector_of[old.edge_halfedges[edge, side]] = first + np.arange(len(added))
    return replace(
        aligned,
        mesh=new,
        parent_face=aligned.parent_face[step.parent],
        angle=aligned.angle[step.parent] - step.turn,
        size=None if aligned.size is None else aligned.size[step.parent],
        feature=step.carry(aligned.feature, False),
        axis=step.carry(aligned.axis, -1),
        rotation=step.carry(aligned.rotation, 0),
        sector=_corners(aligned, step, aligned.sector.reshape(-1), sector_of),
        sector_quads=np.append(aligned.sector_quads, np.full(len(added), 4)),
        sector_vertex=np.append(aligned.sector_vertex, added),
        sector_is_feature=np.append(aligned.sector_is_feature, np.zeros(len(added), dtype=bool)),
    )

"""RepairReport: what the repair of a mesh found and did, in numbers and in words."""

from __future__ import annotations

from dataclasses import dataclass, fields

__all__ = ["RepairReport"]


@dataclass(frozen=True)
class RepairReport:
    """What was found and done; all counts."""

    vertices_in: int = 0
    faces_in: int = 0
    vertices_out: int = 0
    faces_out: int = 0
    components: int = 0
    """Connected components of the result."""
    welded_vertices: int = 0
    """Vertices that became one with another at the same place."""
    unused_vertices: int = 0
    """Vertices that no face of the result uses."""
    degenerate_faces: int = 0
    """Faces without area, removed."""
    cut_faces: int = 0
    """Faces cut in two at a vertex that lay on their side, in place of a face without area."""
    duplicate_faces: int = 0
    """Copies of a face, removed."""
    folded_faces: int = 0
    """Faces on top of one with the opposite winding, removed."""
    turned_faces: int = 0
    """Faces whose winding was reversed."""
    nonmanifold_edges: int = 0
    """Edges with more than two faces, taken apart."""
    split_vertices: int = 0
    """Copies of vertices that were made to take the surface apart."""
    cut_edges: int = 0
    """Edges cut because the surface cannot be oriented."""
    added_vertices: int = 0
    """Vertices put in the middle of an edge that had a twin between the same two vertices."""
    lost_components: int = 0
    """Components that vanished because none of their faces had area."""

    @property
    def changed(self) -> bool:
        """Whether anything was repaired."""
        return any(getattr(self, name) for name in _TEXT)

    def lines(self) -> list[str]:
        """One line for each kind of repair that took place, for people."""
        counts = [(getattr(self, name), text) for name, text in _TEXT.items()]
        return [f"{text}: {count}" for count, text in counts if count]

    def to_dict(self) -> dict[str, int]:
        """All counts by name, for JSON."""
        return {f.name: getattr(self, f.name) for f in fields(self)}

    def __add__(self, other: RepairReport) -> RepairReport:
        """Counts of two rounds together."""
        return RepairReport(**{k: x + getattr(other, k) for k, x in self.to_dict().items()})


_TEXT = {
    "welded_vertices": "duplicate vertices welded",
    "unused_vertices": "unused vertices dropped",
    "degenerate_faces": "faces without area removed",
    "cut_faces": "faces cut in two to fit where those had been",
    "duplicate_faces": "duplicate faces dropped",
    "folded_faces": "faces folded onto another dropped",
    "turned_faces": "faces turned over to make the winding consistent and outward",
    "nonmanifold_edges": "edges with more than two faces taken apart",
    "split_vertices": "vertex copies made where parts of the surface only touched",
    "cut_edges": "edges cut because the surface could not be oriented",
    "added_vertices": "vertices put on edges that doubled another one",
    "lost_components": "components lost because they had no area at all",
}

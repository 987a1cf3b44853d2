"""The report of a remesh: what was asked, what was made, how it was made; plain JSON in and out."""

from __future__ import annotations

import platform
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from importlib import metadata
from typing import TYPE_CHECKING, Any

from vhquad import __version__
from vhquad.jsonable import from_plain, plain
from vhquad.mesh.quad import QuadMesh

if TYPE_CHECKING:
    from vhquad.mesh.quality import QualityReport
    from vhquad.mesh.triangle import TriMesh

__all__ = [
    "MAP",
    "CheckReport",
    "ComponentReport",
    "FieldReport",
    "MeshCounts",
    "RemeshReport",
    "SymmetryReport",
    "quality_shortfalls",
    "versions",
]

MAP = "integer-grid map"
"""The method of a component that needed no fallback."""
COUNT_BAND = 0.10  # of the count asked for; a result farther off is a shortfall


@dataclass(frozen=True)
class MeshCounts:
    """Size and topology of a mesh, of triangles or quads.

    Attributes
    ----------
    vertices, faces, components, euler_characteristic, boundary_loops : int
    """

    vertices: int
    faces: int
    components: int
    euler_characteristic: int
    boundary_loops: int

    @classmethod
    def of(cls, mesh: TriMesh | QuadMesh) -> MeshCounts:
        """Count a mesh."""
        if isinstance(mesh, QuadMesh):
            faces, loops = mesh.n_quads, mesh.n_boundary_loops
        else:
            faces, loops = mesh.n_faces, len(mesh.boundary_loops)
        return cls(mesh.n_vertices, faces, mesh.n_components, mesh.euler_characteristic, loops)

    @property
    def topology(self) -> tuple[int, int, int]:
        """(components, Euler characteristic, boundary loops): what a remesh must keep."""
        return (self.components, self.euler_characteristic, self.boundary_loops)


@dataclass(frozen=True)
class ComponentReport:
    """How the quads of one connected component were made.

    Attributes
    ----------
    vertices, faces : int
        Size of the component after repair.
    target : int
        Its share of the quads asked for.
    made : int
        Quads made.
    method : str
        "integer-grid map", or the name of the fallback that was used.
    reason : str
        Why a fallback was used, or why the count was missed without one; empty if neither was.
    singularities : dict of int to int
        Interior singular vertices of the field, by the number of quads around them (3 where the
        index is +1/4, 5 where it is -1/4).
    cancelled : int
        Pairs of opposite singularities too close for a quad between them, removed beforehand.
    seconds : dict of str to float
        Wall time of each step.
    warnings : tuple of str
    crease_corners : dict of int to int
        Inner vertices on creases where the field has other than four quads around, by their number.
        These and the singularities are the irregular vertices inside.
    """

    vertices: int
    faces: int
    target: int
    made: int
    method: str
    reason: str = ""
    singularities: Mapping[int, int] = field(default_factory=dict)
    cancelled: int = 0
    seconds: Mapping[str, float] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    crease_corners: Mapping[int, int] = field(default_factory=dict)

    @property
    def is_fallback(self) -> bool:
        """Whether another way than the integer-grid map of the field as it was made the quads."""
        return self.method != MAP


@dataclass(frozen=True)
class SymmetryReport:
    """The mirror plane that was asked for.

    Attributes
    ----------
    asked : str
        "auto", or the axis that the plane is across.
    plane : str
        Its equation, such as ``x = 0``; empty if the quads were not made symmetric.
    normal : tuple of float
        Of the best plane found, whether it was used or not.
    offset : float
        It holds the points p with ``normal . p = offset``.
    median, tail : float
        Half, and 95 %, of the mirrored input are nearer to the input than this, in % of the
        diagonal.
    made : bool
        Whether the quads are their own mirror image.
    doubled : int
        Components that had no mirror image in the input.
    warnings : tuple of str
    """

    asked: str
    plane: str
    normal: tuple[float, ...]
    offset: float
    median: float
    tail: float
    made: bool
    doubled: int = 0
    warnings: tuple[str, ...] = ()

    def given_up(self, reason: str) -> SymmetryReport:
        """The same, where symmetric quads could not be had."""
        line = f"the quads are not symmetric in {self.plane}, because {reason}"
        return replace(self, plane="", made=False, warnings=(*self.warnings, line))


@dataclass(frozen=True)
class RemeshReport:
    """What one remesh was asked for, what it made and how; written even if it fell short.

    Attributes
    ----------
    asked : int
        Quads asked for: the target, or the number that the field's or the given size amounts to.
    made : int
        Quads in the result.
    input, output : MeshCounts
        The repaired input, and the result.
    quality : QualityReport or None
        Figures of the result against the input.
    components : tuple of ComponentReport
        In the order of the input's components; of the half that was mirrored, if one was.
    symmetry : SymmetryReport or None
        None if no symmetry was asked for.
    stand_in : int or None
        Triangles of the decimated copy that was remeshed in place of the input, where that is far
        finer than its quads; the quads were polished on the input itself.
    repair : tuple of str
        What was repaired in the input, a line each.
    seconds : dict of str to float
        Wall time of each step, all components together.
    warnings : tuple of str
        What a user should know before using the result.
    settings : dict
        Every setting of the run, seed included.
    versions : dict of str to str
        Of this package, Python and the libraries that decide the result.
    """

    asked: int
    made: int
    input: MeshCounts
    output: MeshCounts
    quality: QualityReport | None = None
    components: tuple[ComponentReport, ...] = ()
    symmetry: SymmetryReport | None = None
    stand_in: int | None = None
    repair: tuple[str, ...] = ()
    seconds: Mapping[str, float] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    settings: Mapping[str, Any] = field(default_factory=dict)
    versions: Mapping[str, str] = field(default_factory=lambda: versions())

    @property
    def fallbacks(self) -> tuple[ComponentReport, ...]:
        """The components that needed another way than the integer-grid map."""
        return tuple(part for part in self.components if part.is_fallback)

    @property
    def topology_kept(self) -> bool:
        """Whether components, Euler characteristic and boundary loops are those of the input."""
        return self.input.topology == self.output.topology

    def shortfalls(self) -> tuple[str, ...]:
        """What a user should know before using the result, a line each; empty if all is well."""
        lines = list(self.warnings)
        if self.symmetry is not None:
            lines += self.symmetry.warnings
            if self.symmetry.doubled:
                lines.append(
                    f"{self.symmetry.doubled} components have no mirror image: now doubled"
                )
        if self.made == 0 or abs(self.made - self.asked) > COUNT_BAND * self.asked:
            lines.append(f"{self.made} quads were made where {self.asked} were asked for")
        if not self.topology_kept:
            lines.append(
                "components, Euler characteristic and boundary loops are "
                f"{self.output.topology}, those of the input {self.input.topology}"
            )
        if self.quality is not None:
            lines += quality_shortfalls(self.quality)
        for number, part in enumerate(self.components):
            if part.reason:
                where = f"component {number}: " if len(self.components) > 1 else ""
                used = f"fallback used ({part.method})" if part.is_fallback else "count missed"
                lines.append(f"{where}{used}, because {part.reason}")
        return tuple(lines)

    def to_dict(self) -> dict[str, Any]:
        """As plain JSON values; :meth:`from_dict` reads them back."""
        values = plain(self)
        values["topology_kept"] = self.topology_kept
        values["shortfalls"] = list(self.shortfalls())
        return dict(values)

    @classmethod
    def from_dict(cls, values: Mapping[str, Any]) -> RemeshReport:
        """The report that :meth:`to_dict` wrote.

        Raises
        ------
        ConfigError
            If something is missing or of another kind.
        """
        known = {f.name for f in fields(cls)}
        report: RemeshReport = from_plain(
            cls, {k: v for k, v in values.items() if k in known}, _late_names()
        )
        return report


@dataclass(frozen=True)
class CheckReport:
    """What is found in a quad mesh, from here or elsewhere.

    Attributes
    ----------
    quality : QualityReport
        Of its quads; faces that are no quads are counted and otherwise left out.
    input : MeshCounts or None
        The surface it was compared with.
    """

    quality: QualityReport
    input: MeshCounts | None = None

    @property
    def is_valid(self) -> bool:
        """Whether it is a manifold mesh of quads only."""
        return self.quality.is_valid

    def shortfalls(self) -> tuple[str, ...]:
        """What is wrong or differs from the surface, a line each."""
        lines = quality_shortfalls(self.quality)
        q = self.quality
        topology = (q.components, q.euler_characteristic, q.boundary_loops)
        if self.input is not None and topology != self.input.topology:
            lines.append(
                "components, Euler characteristic and boundary loops are "
                f"{topology}, those of the surface {self.input.topology}"
            )
        return tuple(lines)


def quality_shortfalls(quality: QualityReport) -> list[str]:
    """What makes a quad mesh invalid or bad to use, a line each."""
    counts = {
        "faces that are not quads": quality.non_quads,
        "edges with more than two quads": quality.nonmanifold_edges,
        "vertices where several fans of quads meet": quality.nonmanifold_vertices,
        "edges whose quads are wound against each other": quality.misoriented_edges,
        "quads without area or with a vertex twice": quality.degenerate_quads,
        "vertices that no quad uses": quality.unused_vertices,
        "folded quads (a scaled Jacobian of 0 or less)": quality.folded_quads,
        "quads that face against the surface": quality.flipped_quads,
        "pairs of quads that cut through each other": quality.self_intersections,
    }
    return [f"{count} {text}" for text, count in counts.items() if count]


@dataclass(frozen=True)
class FieldReport:
    """What a predicted cross field looks like.

    Attributes
    ----------
    input : MeshCounts
        The repaired mesh.
    singularities : dict of int to int
        Interior singular vertices, by the number of quads around them.
    index_sum : float
        Sum of their indices: on a closed mesh the Euler characteristic; on an open one the rest
        is taken by the boundary.
    size : dict of str to float, or None
        "least", "median" and "largest" edge length of the quads wanted, in units of the mesh.
    quads : int or None
        Quads that these sizes amount to.
    trust : dict of str to float, or None
        "mean" confidence over the area, and the share "below_half"; None if the field has none.
    lost : str
        What the file's format does not keep.
    repair : tuple of str
    seconds : dict of str to float
    versions : dict of str to str
    """

    input: MeshCounts
    singularities: Mapping[int, int]
    index_sum: float
    size: Mapping[str, float] | None = None
    quads: int | None = None
    trust: Mapping[str, float] | None = None
    lost: str = ""
    repair: tuple[str, ...] = ()
    seconds: Mapping[str, float] = field(default_factory=dict)
    versions: Mapping[str, str] = field(default_factory=lambda: versions())


# ---- helpers ---------------------------------------------------------------------------------


def _late_names() -> dict[str, Any]:
    """Types named in hints that this module imports for type checking only."""
    from vhquad.mesh.quality import QualityReport

    return {"QualityReport": QualityReport}


def versions() -> dict[str, str]:
    """Versions of this package, Python and the libraries that decide the result."""
    found = {"vhquad": __version__, "python": platform.python_version()}
    for name in ("numpy", "scipy", "torch", "libigl"):
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            found[name] = "not installed"
    return found

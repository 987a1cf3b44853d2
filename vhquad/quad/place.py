"""Where a mesh is remeshed: on itself, or on the stand-in whose triangles suit the quads."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from vhquad.field.creases import without_known
from vhquad.field.cross import CrossField
from vhquad.field.features import sharp_edges
from vhquad.field.transport import to_faces
from vhquad.mesh.triangle import TriMesh
from vhquad.quad.pipeline import RemeshSettings
from vhquad.quad.refined_curves import refine_curves
from vhquad.quad.refined_planes import refine_planes
from vhquad.quad.sizing import WantedSizes, wanted_sizes
from vhquad.quad.stand_in import StandIn, make_stand_in
from vhquad.watch import Watch

__all__ = ["Chosen", "Place", "choose_place", "guessed_quads"]

GUESSED_QUADS = 10_000  # where only the field will say; predicted sizes make fewer, as a rule


@dataclass(frozen=True, eq=False)
class Place:
    """A mesh that may be remeshed, with what there is to follow on it.

    Attributes
    ----------
    mesh : TriMesh
    creases : (k, 2) int64 or None
        Edges that quads must follow; None: those that are found by their angle.
    density : (n,) float64 or None
        Factor on the quads per area.
    onto : TriMesh or None
        The surface that the quads shall lie on, if another.
    """

    mesh: TriMesh
    creases: NDArray[np.int64] | None
    density: NDArray[np.float64] | None
    onto: TriMesh | None = None

    def of(self, copy: StandIn, onto: TriMesh | None) -> Place:
        """The same on a copy."""
        density = None if self.density is None else copy.carry(self.density)
        return Place(copy.mesh, copy.creases, density, onto)

    def sizes(self, on_faces: CrossField, settings: RemeshSettings) -> WantedSizes:
        """What edge lengths the settings and a field on its faces ask for."""
        return wanted_sizes(
            self.mesh,
            on_faces,
            adaptivity=settings.adaptivity,
            density=self.density,
            target_quads=settings.target_quads,
            edge_length=settings.edge_length,
        )


@dataclass(frozen=True, eq=False)
class Chosen:
    """A place, the field there, and settings that ask for as many quads as on the mesh itself."""

    place: Place
    field: CrossField
    settings: RemeshSettings


def guessed_quads(mesh: TriMesh, settings: RemeshSettings) -> int:
    """How many quads there are to be, as far as the settings say."""
    if settings.target_quads is not None:
        return settings.target_quads
    if settings.edge_length is not None:
        return max(1, round(mesh.area / settings.edge_length**2))
    return GUESSED_QUADS


def choose_place(
    itself: Place,
    field_of: Callable[[TriMesh, TriMesh | None], CrossField],
    settings: RemeshSettings,
    whole: bool,
    cache: bool,
    watch: Watch,
) -> Chosen:
    """Choose where to remesh.

    Parameters
    ----------
    itself : Place
        The mesh.
    field_of : callable
        Gives the cross field of a mesh, told which mesh it stands for, if it is decimated.
    settings : RemeshSettings
    whole : bool
        The triangles may lie beside the mesh, as long as the quads do not: there is no map of them
        to be written, and no half to be cut off.
    cache : bool
        Keep a decimated copy, and take one that was kept.
    watch : Watch
    """
    mesh, n_quads = itself.mesh, guessed_quads(itself.mesh, settings)
    if whole:
        with watch("stand-in"):
            decimated = make_stand_in(mesh, n_quads, itself.creases, settings.crease, cache)
        if decimated is not None:
            place = itself.of(decimated, mesh)
            with watch("field"):
                cross = field_of(place.mesh, mesh)
            if itself.creases is None:
                place = _less_known_creases(place, cross, settings)
            return Chosen(place, cross, settings)
    with watch("stand-in"):
        refined = refine_planes(mesh, n_quads, itself.creases)
    # The planes of the copy are the mesh's own, and its normals are better.
    place = itself if refined is None else itself.of(refined, None)
    with watch("field"):
        cross = field_of(place.mesh, None)
    if whole:
        with watch("stand-in"):
            on_faces = to_faces(place.mesh, cross)
            wanted = place.sizes(on_faces, settings)
            refined = refine_curves(place.mesh, wanted, on_faces, place.creases, settings.crease)
        if refined is not None:
            place = place.of(refined, place.mesh)
            with watch("field"):
                cross = field_of(place.mesh, None)
            settings = replace(settings, target_quads=wanted.quads, edge_length=None)
    return Chosen(place, cross, settings)


def _less_known_creases(place: Place, cross: CrossField, settings: RemeshSettings) -> Place:
    """The place without creases, found by angle, about which the field knows better."""
    if place.creases is None or settings.crease is None:
        return place
    sharp = sharp_edges(place.mesh, settings.crease)
    on_faces = to_faces(place.mesh, cross)
    return replace(place, creases=without_known(place.mesh, place.creases, sharp, on_faces))

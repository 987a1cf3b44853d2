"""Limbs stay covered: what the polish lays bare is held where the layout has it."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.meshes import ball_with_limb
from tests.quad_meshes import quad_tube, triangulated
from vhquad.field.cross import CrossField
from vhquad.mesh.closest import ClosestPoints
from vhquad.mesh.quad import QuadMesh
from vhquad.quad import limbs, tips
from vhquad.quad.limbs import Covering, polished_onto_limbs
from vhquad.quad.pipeline import RemeshResult, RemeshSettings, remesh_mesh

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]


def tube() -> Covering:
    """A tube of squares, four around and twenty long, that covers itself."""
    vertices, quads = quad_tube(4, 20)
    surface = ClosestPoints(triangulated((vertices, quads)))
    return Covering(QuadMesh(vertices, quads), surface)


def test_what_is_covered_is_not_bare() -> None:
    covering = tube()
    assert len(covering.bare(covering.layout.vertices)) == 0


def test_what_no_layout_reaches_is_not_bare() -> None:
    """A layout that ends six edges below the top leaves the same bare, whatever the polish does."""
    whole = tube()
    low = whole.layout.vertices * [1.0, 1.0, 0.7]
    covering = Covering(QuadMesh(low, whole.layout.quads), whole.surface)
    assert len(whole.bare(low)) > 0
    assert len(covering.bare(low)) == 0


def test_the_farthest_bare_place_comes_first() -> None:
    """Squeezed to half its height, the tube leaves the upper half bare but for 1.25 edges."""
    covering = tube()
    at = covering.layout.vertices
    top = at[:, 2].max()
    bare = covering.bare(at * [1.0, 1.0, 0.5])
    height = covering.surface.mesh.vertices[bare, 2]
    assert height[0] == top
    assert (np.diff(height) <= 0).all()
    assert height.min() > 0.5 * top + limbs.BARE * covering.length
    # One vertex of the layout for every stretch of two edges.
    keep = covering.keepers(bare)
    assert at[keep[0], 2] == top
    gap = np.linalg.norm(at[keep][:, None] - at[keep], axis=2)
    assert gap[~np.eye(len(keep), dtype=bool)].min() > limbs.APART * covering.length
    assert len(keep) <= 1 + (top - height.min()) / (limbs.APART * covering.length)


@pytest.mark.parametrize(("squeezed", "rounds"), [(1.0, 1), (0.5, 2)])
def test_a_polish_that_slides_off_is_done_again(squeezed: float, rounds: int) -> None:
    covering = tube()
    at = covering.layout.vertices
    fixed = np.zeros(len(at), dtype=bool)
    fixed[3] = True
    seen: list[Bools] = []

    def polish(held: Bools) -> Floats:
        """Squeezed, unless something is held at the top."""
        seen.append(held)
        return at.copy() if at[held, 2].max(initial=0) == at[:, 2].max() else at * [1, 1, squeezed]

    moved = polished_onto_limbs(covering, fixed, polish)
    np.testing.assert_array_equal(moved, at)
    assert len(seen) == rounds
    np.testing.assert_array_equal(seen[0], fixed)  # the first time nothing else is held
    assert all(held[fixed].all() for held in seen)


def test_a_polish_that_cannot_help_ends() -> None:
    covering = tube()
    calls: list[int] = []

    def polish(held: Bools) -> Floats:
        calls.append(int(held.sum()))
        return covering.layout.vertices * [1.0, 1.0, 0.5]

    polished_onto_limbs(covering, np.zeros(covering.layout.n_vertices, dtype=bool), polish)
    assert 2 <= len(calls) <= limbs.ROUNDS + 1
    assert calls[0] == 0
    assert (np.diff(calls) > 0).all()


def test_a_limb_thinner_than_its_quads_is_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    """Quads of an edge five times the limb's radius reach its tip; by the polish alone not."""
    mesh = ball_with_limb()
    tip = mesh.vertices[:, 2].max()
    edge = np.sqrt(mesh.area / 150)

    def top(result: RemeshResult) -> float:
        assert result.report.topology_kept
        assert result.report.quality is not None
        assert result.report.quality.folded_quads == 0
        return float(tip - result.quads.vertices[:, 2].max())

    def run() -> RemeshResult:
        field = CrossField("faces", np.zeros(mesh.n_faces))
        return remesh_mesh(mesh, field, RemeshSettings(target_quads=150))

    assert top(run()) < 0.5 * edge
    # Without tips held from the start: what limbs alone do, and what no one does.
    monkeypatch.setattr(tips, "find_tips", lambda *_: np.zeros(0, dtype=np.int64))
    assert top(run()) < 0.5 * edge
    monkeypatch.setattr(limbs, "ROUNDS", 0)
    assert top(run()) > 2.0 * edge

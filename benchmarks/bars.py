"""The bars that vhquad is held to, each a question to one run and how many must say yes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

__all__ = ["BARS", "Bar", "Result", "figures_of", "is_cad", "is_valid"]

Result = dict[str, Any]

_SHAPES = {"cube", "bracket_made", "stepped_block", "cone", "hexagon", "gear", "thin_plate"}
_CAD = frozenset({"cad_bracket", "cad_cube_bored", "wingnut", *_SHAPES})

FIRST = ("integer-grid map", "integer-grid map, smoother field")


@dataclass(frozen=True)
class Bar:
    """One bar.

    Attributes
    ----------
    text : str
    share : float
        Of the runs that must hold it.
    applies : callable
        Whether a run is asked.
    value : callable
        What is bad about it, in the unit of the text; the largest is the worst case.
    limit : float
        The most that is allowed.
    """

    text: str
    share: float
    applies: Callable[[Result], bool]
    value: Callable[[Result], float]
    limit: float

    def held(self, run: Result) -> bool:
        """Whether a run holds it; one without quads holds nothing."""
        return bool(figures_of(run)) and self.value(run) <= self.limit


def figures_of(run: Result) -> dict[str, Any]:
    """What the judge found; empty if nothing was made."""
    figures: dict[str, Any] = run.get("figures") or {}
    return figures if figures.get("faces") else {}


FAULTS = (
    "non_quads",
    "nonmanifold_edges",
    "nonmanifold_vertices",
    "misoriented_edges",
    "unused_vertices",
)


def faults(run: Result) -> float:
    """Faults of an all-quad manifold of the input's topology."""
    figures = figures_of(run)
    return sum(figures[name] for name in FAULTS) + (not figures["kept"])


def is_cad(run: Result) -> bool:
    """Whether the creases of the mesh are meant."""
    return run["mesh"] in _CAD or run["folder"] == "exported"


def is_valid(run: Result) -> bool:
    """All quads, manifold, of the input's topology."""
    return bool(figures_of(run)) and faults(run) == 0


def folds(run: Result) -> float:
    """Quads folded or turned over."""
    figures = figures_of(run)
    return float(figures["folded"] + (figures["flipped"] or 0))


def folded(run: Result) -> float:
    """Quads folded against their own normal; thin parts cannot blur that."""
    return float(figures_of(run)["folded"])


def fallbacks(run: Result) -> float:
    """Components that needed more than the first fallback."""
    return sum(part["method"] not in FIRST for part in run["parts"])


def no_fallback(run: Result) -> bool:
    return bool(run.get("parts")) and not any(part["reason"] for part in run["parts"])


def extra_irregular(run: Result) -> float:
    """Interior irregular vertices too many or too few for those of the field.

    The field's are its singularities and, where creases are kept, those of their corners that have
    other than four quads around. Reports of early commits do not name the corners; there the
    singularities must be all of those off sharp edges, and among those inside.
    """
    inside = figures_of(run)["irregular"]
    field: dict[str, int] = {}
    for part in run["parts"]:
        for kind in ("singularities", "crease_corners"):
            for quads, count in part.get(kind, {}).items():
                field[quads] = field.get(quads, 0) + count
    named = all("crease_corners" in part for part in run["parts"])
    off = inside if named else figures_of(run).get("irregular_off_creases", inside)
    return float(
        sum(
            max(off.get(v, 0) - field.get(v, 0), field.get(v, 0) - inside.get(v, 0), 0)
            for v in {*inside, *field}
        )
    )


def count_off(run: Result) -> float:
    """How far the count is off, in % of the target."""
    return 100.0 * abs(figures_of(run)["faces"] / run["target"] - 1.0)


def dense(run: Result) -> bool:
    return bool(run["target"] > 500)


BARS = (
    Bar("all quads, manifold, the input's topology (faults)", 1.0, lambda r: True, faults, 0),
    Bar("2,000 and 8,000: no quad folded or turned over (quads)", 0.95, dense, folds, 0),
    Bar("2,000 and 8,000: of these, no quad folded (quads)", 0.95, dense, folded, 0),
    Bar("2,000 and 8,000: never more than 2 of them (quads)", 1.0, dense, folds, 2),
    Bar(
        "2,000 and 8,000: at most the first fallback (components)",
        0.95,
        lambda r: dense(r) and "parts" in r,
        fallbacks,
        0,
    ),
    Bar(
        "500: folded or turned over under 1 % (%)",
        1.0,
        lambda r: not dense(r),
        lambda r: 100.0 * folds(r) / figures_of(r)["faces"],
        1.0,
    ),
    Bar(
        "no fallback: irregular inside = singularities of the field (vertices)",
        1.0,
        no_fallback,
        extra_irregular,
        0,
    ),
    Bar("count within 5 % (%)", 0.9, lambda r: True, count_off, 5.0),
    Bar("no fallback: count within 10 % (%)", 1.0, no_fallback, count_off, 10.0),
    Bar(
        "boundary vertices on the input's boundary (% of the diagonal)",
        1.0,
        lambda r: bool(figures_of(r).get("input", {}).get("loops")),
        lambda r: figures_of(r).get("border_off", 100.0),
        1e-4,
    ),
    Bar(
        "2,000 and 8,000, CAD: mean from crease to edge (% of the diagonal)",
        1.0,
        lambda r: dense(r) and is_cad(r),
        lambda r: figures_of(r).get("crease_off", 100.0),
        0.02,
    ),
    Bar("memory under 2 GB (MB)", 1.0, lambda r: True, lambda r: float(r["mb"]), 2000.0),
)

"""How much a predicted field changes when it must not: the paper's invariance experiments.

    python benchmarks/invariances.py --mesh examples/head.obj --out benchmarks/invariances

writes ``OUT.md``, ``OUT_head.png`` and ``OUT_sheet.png`` (the extra ``viz``) in about two minutes.

A trained model, the shipped one unless ``--model`` names another, predicts one mesh as it is, moved
and turned, in other units, with its vertices and faces numbered anew (which changes every tangent
basis), and triangulated anew. Bending needs a surface that can be bent: a network of the same kind,
with the paper's intrinsic features, is trained on a flat sheet for a moment and then shown the same
sheet folded and rolled up (the paper's crumpled paper). What is compared is the field at the
vertices, in degrees, weighted by area.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from bent_sheet import STEPS, answer, folded_sheet, rolled, train
from matplotlib.colors import LinearSegmentedColormap
from numpy.typing import NDArray
from PIL import Image

from vhquad.atomic import write_atomic
from vhquad.field.cross import CrossField
from vhquad.geometry.frames import build_frames
from vhquad.learn.blend import lean_on_curvature
from vhquad.learn.predict import predict_field
from vhquad.learn.proxy import carry_back
from vhquad.learn.targets import isotropic_remesh
from vhquad.mesh.closest import ClosestPoints
from vhquad.mesh.load import load
from vhquad.mesh.proxy import decimate
from vhquad.mesh.triangle import TriMesh
from vhquad.nn.checkpoint import Model, load_model
from vhquad.picture import SURFACE, View, draw_crosses, open_panel, picture, view_of

Floats = NDArray[np.float64]

PANEL = (330, 390)  # pixels
SHOWN = 10.0  # degrees, the brightest colour
CROSSES = 900


@dataclass(frozen=True, eq=False)
class Change:
    """A field beside the one that it must be like, both at the vertices of ``mesh``.

    ``shown`` is the changed mesh with its own field, for pictures; sizes there are in another unit.
    """

    name: str
    mesh: TriMesh
    field: CrossField
    before: CrossField
    shown: tuple[TriMesh, CrossField]
    unit: float = 1.0

    @property
    def angle(self) -> Floats:
        """Degrees, (n,)."""
        cosine = (self.field.z * self.before.z.conj()).real.clip(-1.0, 1.0)
        return np.degrees(np.arccos(cosine)) / 4.0

    @property
    def figures(self) -> tuple[float, float, float, float | None]:
        """Mean, median, 95 % below; mean of |log size ratio|."""
        weight = self.mesh.vertex_areas / self.mesh.area
        order = np.argsort(self.angle)
        below = np.cumsum(weight[order])
        at = [min(int(np.searchsorted(below, q)), len(order) - 1) for q in (0.5, 0.95)]
        median, p95 = self.angle[order][at]
        size = None
        if self.field.size is not None and self.before.size is not None:
            known = (self.field.size > 0) & (self.before.size > 0)
            ratio = self.field.size[known] / (self.unit * self.before.size[known])
            size = float(weight[known] @ np.abs(np.log(ratio)) / weight[known].sum())
        return float(weight @ self.angle), float(median), float(p95), size


# ---- one mesh, changed ------------------------------------------------------------------------


def on_head(mesh: TriMesh, model: Model) -> list[tuple[Change, Change]]:
    """Each change, for the network alone and for what ``vhquad predict`` answers."""
    rng = np.random.default_rng(0)

    def answers(surface: TriMesh) -> tuple[CrossField, CrossField]:
        own = predict_field(surface, model, "full", cache=False)
        return own, lean_on_curvature(surface, own)

    plain = answers(mesh)

    def pair(
        name: str,
        changed: TriMesh,
        back: Callable[[CrossField], CrossField],
        unit: float = 1.0,
    ) -> tuple[Change, Change]:
        first, second = (
            Change(name, mesh, back(field), before, (changed, field), unit)
            for field, before in zip(answers(changed), plain, strict=True)
        )
        return first, second

    turn = np.linalg.qr(rng.standard_normal((3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    moved = TriMesh(mesh.vertices @ turn.T + mesh.diagonal * np.array([3.0, -2.0, 1.0]), mesh.faces)
    new = rng.permutation(mesh.n_vertices)
    renumbered = _renumbered(mesh, new, rng)
    found = [
        pair("turned and moved away", moved, lambda field: field),
        pair("in units a thousandth as large", _scaled(mesh, 1e3), lambda field: field, 1e3),
        pair(
            "vertices, faces and corners in another order: other tangent bases",
            renumbered,
            lambda field: _numbered_back(mesh, renumbered, new, field),
        ),
    ]
    n = mesh.n_vertices
    for vertices in (n // 4, n // 2, 2 * n):
        other = isotropic_remesh(mesh.vertices, mesh.faces, vertices)
        name = f"isotropic triangles, {n:,} → {other.n_vertices:,} vertices"
        found.append(pair(name, other, _carrier(other, mesh)))
    coarse = decimate(mesh, mesh.n_faces // 4)
    name = f"decimated (quadrics), {n:,} → {coarse.n_vertices:,} vertices"
    found.append(pair(name, coarse, _carrier(coarse, mesh)))
    return found


def _scaled(mesh: TriMesh, factor: float) -> TriMesh:
    return TriMesh(factor * mesh.vertices, mesh.faces)


def _carrier(other: TriMesh, mesh: TriMesh) -> Callable[[CrossField], CrossField]:
    return lambda field: carry_back(other, field, mesh)


def _renumbered(mesh: TriMesh, new: NDArray[np.int64], rng: np.random.Generator) -> TriMesh:
    """Vertex v becomes new[v]; faces are shuffled, and each starts at a random corner."""
    vertices = np.zeros_like(mesh.vertices)
    vertices[new] = mesh.vertices
    faces = new[mesh.faces][rng.permutation(mesh.n_faces)]
    start = rng.integers(0, 3, (mesh.n_faces, 1))
    return TriMesh(vertices, np.take_along_axis(faces, (start + np.arange(3)) % 3, axis=1))


def _numbered_back(
    mesh: TriMesh, other: TriMesh, new: NDArray[np.int64], field: CrossField
) -> CrossField:
    """A field on the renumbered mesh in the order and frames of the first; exact."""
    old = np.argsort(new)
    n = mesh.n_vertices
    axis = other.outgoing[new]  # halfedge of the other mesh along the axis at each vertex
    key = np.arange(n) * n + old[other.head[axis]]
    own = mesh.tail * n + mesh.head
    order = np.argsort(own)
    halfedge = order[np.searchsorted(own, key, sorter=order)]
    turned = np.exp(4j * build_frames(mesh).halfedge_angle[halfedge])
    size = None if field.size is None else field.size[new]
    return CrossField("vertices", field.z[new] * turned, size)


# ---- a sheet, bent ----------------------------------------------------------------------------


def on_sheet(model: Model) -> tuple[list[Change], list[Change], float]:
    """A sheet folded and rolled, by a network trained on it flat, with its loss, and by a model."""
    flat = folded_sheet(0.0)
    network, loss = train(flat)
    roll = rolled(flat)
    shorter = 100.0 * (1.0 - (roll.edge_lengths / flat.edge_lengths).min())
    states = {
        "folded (Miura), every triangle as it was": folded_sheet(0.9),
        f"rolled up, edges up to {shorter:.2f} % shorter": roll,
    }

    def changes(field_of: Callable[[TriMesh], CrossField]) -> list[Change]:
        before = field_of(flat)
        found = []
        for name, mesh in states.items():
            field = field_of(mesh)
            found.append(Change(name, mesh, field, before, (mesh, field)))
        return found

    trained = changes(lambda mesh: answer(network, mesh))
    return trained, changes(lambda mesh: predict_field(mesh, model, "full", cache=False)), loss


# ---- what is written --------------------------------------------------------------------------


def table(changes: list[Change]) -> list[str]:
    """Markdown, a line each."""
    lines = ["| | mean | median | 95 % below | sizes |", "|---|---|---|---|---|"]
    for change in changes:
        *degrees, size = change.figures
        shown = " | ".join(_degrees(value) for value in degrees)
        lines.append(f"| {change.name} | {shown} | {'' if size is None else _percent(size)} |")
    return lines


def _degrees(value: float) -> str:
    return f"{value:.2f}°" if value >= 0.005 else "below 0.005°"


def _differ(value: float) -> str:
    return f"{max(value, 0.005):.3g}°"


def _percent(value: float) -> str:
    return f"{100.0 * value:.1f} %" if value >= 5e-4 else "below 0.05 %"


def report(
    command: str,
    model: Model,
    head: list[tuple[Change, Change]],
    sheet: tuple[list[Change], list[Change], float],
    out: Path,
) -> str:
    """The markdown."""
    trained, given, loss = sheet
    own = max(
        abs(a - b)
        for pair in head
        for a, b in zip(pair[0].figures[:3], pair[1].figures[:3], strict=True)
    )
    return "\n".join(
        [
            "# Invariances, measured",
            "",
            f"Made by `{command}`.",
            "How far the field of a changed mesh is from that of the mesh as it was, at the same",
            "points: degrees between crosses, weighted by area, and the mean |logarithm| of the",
            f"ratio of sizes. The model's features are `{model.settings.features}`.",
            "",
            "## One mesh, the same surface",
            "",
            *table([pair[0] for pair in head]),
            "",
            "The figures are of the network alone; with curvature where it is not sure, as `vhquad",
            f"predict` answers, no figure differs by more than {_differ(own)}. The first three are",
            "exact but for single precision. Under new triangles, carrying the field from one mesh",
            "to the other is a part of the change.",
            "",
            f"![The fields, red where they moved by 10° or more]({out.name}_head.png)",
            "",
            "## A sheet, bent",
            "",
            "A small network of the same kind with the paper's intrinsic features (heat kernel",
            f"signature), trained for {STEPS} steps on the flat sheet (direction loss {loss:.4f}):",
            "",
            *table(trained),
            "",
            "The model itself, on the same sheet, which is nothing that it has learned:",
            "",
            *table(given),
            "",
            "Features that know how the surface lies in space see bending, intrinsic ones do not.",
            "",
            f"![The sheet's field, red where it moved by 10° or more]({out.name}_sheet.png)",
            "",
        ]
    )


def draw(path: Path, titles: list[str], changes: list[Change], view: View | None = None) -> None:
    """A panel a change: its field, coloured by how far it moved."""
    colours = LinearSegmentedColormap.from_list("moved", [SURFACE, "#d7301f"])
    with picture(path, len(changes), PANEL) as (plotter, pv):
        for column, (title, change) in enumerate(zip(titles, changes, strict=True)):
            mesh, field = change.shown
            angle = change.angle
            if mesh.n_vertices != change.mesh.n_vertices:
                hits = ClosestPoints(change.mesh).query(mesh.vertices)
                angle = hits.interpolate(angle[change.mesh.faces])
            title = f"{title}: {_degrees(change.figures[0])}"
            open_panel(plotter, column, title, view or view_of(mesh))
            plotter.add_mesh(
                pv.PolyData.from_regular_faces(mesh.vertices, mesh.faces),
                scalars=angle,
                clim=(0.0, SHOWN),
                cmap=colours,
                smooth_shading=True,
                ambient=0.35,
                specular=0.0,
                show_scalar_bar=False,
            )
            draw_crosses(plotter, pv, mesh, field, CROSSES)
    with Image.open(path) as image:
        small = image.convert("RGB").quantize(64)
    small.save(path, optimize=True)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--mesh", type=Path, default=Path("examples/head.obj"))
    parser.add_argument("--model", default="default")
    parser.add_argument("--out", type=Path, default=Path("benchmarks/invariances"))
    options = parser.parse_args()
    torch.set_num_threads(1)
    model = load_model(options.model)
    mesh = load(options.mesh).mesh
    head, sheet = on_head(mesh, model), on_sheet(model)
    command = f"python benchmarks/invariances.py --mesh {options.mesh} --model {options.model}"
    text = report(command, model, head, sheet, options.out)
    write_atomic(options.out.with_suffix(".md"), text)
    print(text)
    shown = {"turned": 0, "coarser": 3, "decimated": 6}
    path = options.out.with_name(f"{options.out.name}_head.png")
    draw(path, list(shown), [head[place][0] for place in shown.values()])
    path = options.out.with_name(f"{options.out.name}_sheet.png")
    middle = 0.5 * np.ptp(sheet[0][0].mesh.vertices, axis=0) * [1.0, 1.0, 0.0]
    view = View(middle, middle + np.array([6.0, -12.0, 20.0]), (0.0, 1.0, 0.0), 4.0)
    draw(path, ["folded", "rolled up"], sheet[0], view)


if __name__ == "__main__":
    main()

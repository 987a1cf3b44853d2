"""Do the edges of the final quads run as the artist's? Measured on quad meshes that people made.

    python examples/make_heads.py heads/ --count 300
    python benchmarks/edge_flow.py heads/ --split test --most 10 --out benchmarks/edge_flow

Each quad mesh is hidden in triangles (one Catmull-Clark step, random diagonals, isotropic
remeshing) and every tool asked for as many quads as the artist made. At the middle of each edge
that comes out, the angle between the edge and the artist's cross at the closest point is at most 45
degrees, and 22.5 on average for edges that know nothing of it. The artist's own edges are not at 0
either: his quads are not square, and a cross is. Half of all edges lie on the small part of a head
where quads are smallest, so the mean weighted by the edges' length is given too. "Artist's field"
is what our remesh makes of the artist's own cross at the vertices of the triangles, in place of a
prediction: what is left even so is the triangles' and the remesh's. Writes OUT.md.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from remesh_folder import TOOLS, command, run

from vhquad.field.cross import CrossField
from vhquad.learn.subdivide import catmull_clark
from vhquad.learn.targets import isotropic_remesh, split_quads, truth_at
from vhquad.mesh.closest import ClosestPoints
from vhquad.mesh.io import read_quad_mesh
from vhquad.mesh.quad import QuadMesh
from vhquad.mesh.triangle import TriMesh
from vhquad.quad.pipeline import RemeshSettings
from vhquad.quad.remeshing import remesh_predicted

LIMIT = 180  # CPU seconds a run

Floats = NDArray[np.float64]


class Artist:
    """The crosses of a quad mesh at the points of its surface."""

    def __init__(self, mesh: QuadMesh) -> None:
        self.mesh = mesh
        triangles, self.quad, slots = split_quads(mesh.quads, np.random.default_rng(0))
        self.square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])[slots]
        self.surface = ClosestPoints(TriMesh(mesh.vertices, triangles))

    def means(self, quads: QuadMesh) -> tuple[float, float]:
        """Mean of the angles over the edges, and over their length."""
        angle, length = self.angles(quads)
        return float(angle.mean()), float(np.average(angle, weights=length))

    def angles(self, quads: QuadMesh) -> tuple[Floats, Floats]:
        """Degrees between each edge and the cross beneath its middle, 0 to 45, and its length."""
        ends = quads.vertices[quads.edges]
        ends = ends[(ends[:, 0] != ends[:, 1]).any(axis=1)]
        hits = self.surface.query(ends.mean(axis=1))
        x, y = hits.interpolate(self.square).T[:, :, None]
        a, b, c, d = self.mesh.vertices[self.mesh.quads[self.quad[hits.face]]].transpose(1, 0, 2)
        along = (1.0 - y) * (b - a) + y * (c - d)
        across = (1.0 - x) * (d - a) + x * (c - b)
        normal = np.cross(along, across)
        axis = along / np.linalg.norm(along, axis=1, keepdims=True)
        other = np.cross(normal, axis)
        other /= np.linalg.norm(other, axis=1, keepdims=True)

        def turn(v: Floats) -> NDArray[np.complex128]:
            z = (v * axis).sum(axis=1) + 1j * (v * other).sum(axis=1)
            return np.asarray((z / np.abs(z)) ** 4)

        cross = turn(along) + turn(across)
        side = ends[:, 1] - ends[:, 0]
        angle = np.degrees(np.abs(np.angle(turn(side) * cross.conj())) / 4.0)
        return angle, np.linalg.norm(side, axis=1)


def hidden(mesh: QuadMesh, n_vertices: int) -> tuple[TriMesh, Callable[..., CrossField]]:
    """The same surface in triangles that do not tell the quads, and the quads' field on any."""
    fine = catmull_clark(mesh.vertices, mesh.quads)
    triangles, source, slots = split_quads(fine.quads, np.random.default_rng(1))
    surface = TriMesh(fine.vertices, triangles)

    def field_of(copy: TriMesh, _: TriMesh | None = None) -> CrossField:
        field = truth_at(copy, surface, fine, source, slots)
        return replace(field, confidence=np.ones(len(field)))  # to be followed everywhere

    return isotropic_remesh(fine.vertices, triangles, n_vertices), field_of


def write_triangles(path: Path, mesh: TriMesh) -> None:
    lines = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in mesh.vertices]
    lines += [f"f {a} {b} {c}" for a, b, c in mesh.faces + 1]
    path.write_text("\n".join(lines) + "\n")


def chosen(folder: Path, split: str | None, most: int) -> list[Path]:
    """The first quad meshes of a folder, or of one part of its split."""
    paths = sorted(folder.glob("*.obj"))
    if split is not None:
        parts = json.loads((folder / "split.json").read_text())
        paths = [path for path in paths if parts.get(path.stem) == split]
    return paths[:most]


def cell(means: tuple[float, float], quads: QuadMesh) -> str:
    """What one mesh contributes to the table."""
    edges, length = means
    return f"{edges:.1f}°, {length:.1f}° ({quads.n_quads})"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, help="quad meshes")
    parser.add_argument("--split", help="only this part of the folder's split.json")
    parser.add_argument("--most", type=int, default=10, help="how many meshes (10)")
    parser.add_argument("--vertices", type=int, default=8000, help="of the triangle meshes (8000)")
    parser.add_argument("--tools", nargs="+", default=list(TOOLS), choices=TOOLS)
    parser.add_argument("--out", type=Path, required=True, help="stem of the .md file")
    options = parser.parse_args()
    paths = chosen(options.folder, options.split, options.most)
    names = ["the artist's own", *options.tools, "artist's field"]
    means: dict[str, list[tuple[float, float]]] = {name: [] for name in names}
    rows = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for path in paths:
            mesh = read_quad_mesh(path)
            artist = Artist(mesh)
            means["the artist's own"].append(artist.means(mesh))
            row = [path.stem, cell(means["the artist's own"][-1], mesh)]
            source, out = folder / "triangles.obj", folder / "quads.obj"
            triangles, field_of = hidden(mesh, options.vertices)
            write_triangles(source, triangles)
            for tool in options.tools:
                out.unlink(missing_ok=True)
                words = command(tool, source, mesh.n_quads, out, folder / "report.json")
                ended = run(words, LIMIT, folder / "log.txt", folder / "cache")
                if ended["exit"] != 0 or not out.exists():
                    row.append(f"exit {ended['exit']}")
                    continue
                made = read_quad_mesh(out)
                means[tool].append(artist.means(made))
                row.append(cell(means[tool][-1], made))
            settings = RemeshSettings(target_quads=mesh.n_quads)
            made = remesh_predicted(triangles, field_of, settings).result.quads
            means["artist's field"].append(artist.means(made))
            row.append(cell(means["artist's field"][-1], made))
            rows.append(row)
            print(*row, sep="  ", flush=True)
    given = f" --split {options.split}" if options.split else ""
    last = ["**mean**"]
    for found in means.values():
        middle = np.mean(found, axis=0) if found else None
        last.append("-" if middle is None else f"**{middle[0]:.1f}°, {middle[1]:.1f}°**")
    lines = [
        f"`python benchmarks/edge_flow.py {options.folder.name}/{given} --most {options.most} "
        f"--vertices {options.vertices} --out benchmarks/{options.out.name}`",
        "",
        "Mean angle between the edges of the final quads and the artist's cross at their middles, "
        "of all edges alike and weighted by their length, and the quads made; for edges that know "
        "nothing of the artist 22.5°. The artist's quads are not square, so his own edges are off "
        "the cross as well. \"Artist's field\" is what `remesh` makes of the artist's own cross at "
        "the vertices of the triangles, as a perfect prediction would give it.",
        "",
        "| mesh | " + " | ".join(names) + " |",
        "|---|" + "---|" * len(names),
        *("| " + " | ".join(row) + " |" for row in [*rows, last]),
    ]
    options.out.with_suffix(".md").write_text("\n".join(lines) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()

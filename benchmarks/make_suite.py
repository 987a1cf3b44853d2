"""Make folders of triangle meshes to measure remeshers on.

    python benchmarks/make_suite.py generated OUT/
    python benchmarks/make_suite.py from-quads QUADS/ OUT/ --vertices 6000
    python benchmarks/make_suite.py exported OUT/ --count 24

`generated` writes closed and open shapes, many-handled, sharp, thin, noisy and many-parted ones.
`from-quads` takes a folder of quad meshes, cuts each quad in two along a random diagonal and
remeshes isotropically, so that no triangle edge tells where a quad was. `exported` makes random
machine parts in as few triangles as CAD programs export.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path

import implicit
import numpy as np
import pymeshlab
import solids
from exported import random_part
from numpy.typing import NDArray

from vhquad.errors import MeshError
from vhquad.learn.augment import clip_triangles
from vhquad.learn.subdivide import catmull_clark
from vhquad.learn.targets import split_quads
from vhquad.mesh.io import read_polygons
from vhquad.mesh.triangle import TriMesh

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Soup = tuple[Floats, Ints]


# ---- smooth and closed ----------------------------------------------------------------------


def sphere(axes: tuple[float, float, float] = (1.0, 1.0, 1.0)) -> Soup:
    scale = np.array(axes)
    reach = 1.1 * scale
    return implicit.level_set(
        lambda p: np.linalg.norm(p / scale, axis=1) - 1.0, -reach, reach, cells=60
    )


def noisy_sphere() -> Soup:
    vertices, faces = remeshed(sphere(), 4000)
    rng = np.random.default_rng(0)
    return vertices * (1.0 + 0.02 * rng.standard_normal(len(vertices)))[:, None], faces


def two_parts() -> Soup:
    ring = implicit.level_set(lambda p: implicit.torus(p, 1.0, 0.3), [-1.4] * 3, [1.4] * 3, 60)
    return joined([remeshed(ring, 3000), remeshed(shifted(sphere(), 3.0, 0.6), 1200)])


def fifty_parts() -> Soup:
    """Balls, eggs, rings and cubes of many sizes."""
    rng = np.random.default_rng(1)
    kinds = [
        sphere(),
        sphere((1.0, 0.7, 0.5)),
        implicit.level_set(lambda p: implicit.torus(p, 0.8, 0.3), [-1.2] * 3, [1.2] * 3, 50),
        solids.cube(),
    ]
    small = [remeshed(kind, 200) for kind in kinds]
    parts = []
    for k in range(50):
        vertices, faces = small[k % 4]
        at = 3.0 * np.array([k % 5, k // 5 % 5, k // 25])
        parts.append((vertices * rng.uniform(0.5, 1.2) + at, faces))
    return joined(parts)


# ---- open -----------------------------------------------------------------------------------


def flat(width: float, height: float, count: int = 90) -> Soup:
    """A rectangle of squares cut in two, facing +z, about 0."""
    nx, ny = count, max(round(count * height / width), 2)
    x, y = np.meshgrid(np.linspace(-0.5, 0.5, nx + 1), np.linspace(-0.5, 0.5, ny + 1))
    vertices = np.column_stack([width * x.ravel(), height * y.ravel(), np.zeros(x.size)])
    a = (np.arange(ny)[:, None] * (nx + 1) + np.arange(nx)).ravel()
    b, c, d = a + 1, a + nx + 2, a + nx + 1
    return vertices, np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])


def cut(soup: Soup, height: Callable[[Floats], Floats]) -> Soup:
    """The part where a function of position is positive."""
    return clip_triangles(*soup, height(soup[0]))


def disc() -> Soup:
    return cut(flat(2.2, 2.2), lambda p: 1.0 - np.hypot(p[:, 0], p[:, 1]))


def annulus() -> Soup:
    def height(p: Floats) -> Floats:
        r = np.hypot(p[:, 0], p[:, 1])
        return np.minimum(1.0 - r, r - 0.35)

    return cut(flat(2.2, 2.2), height)


def sheet_with_holes() -> Soup:
    """A wavy rectangle with five round holes."""
    holes = np.array([[-0.7, -0.3, 0.15], [0, 0.25, 0.2], [0.6, -0.2, 0.25], [-0.6, 0.3, 0.1]])
    vertices, faces = cut(
        flat(2.0, 1.2, 120),
        lambda p: np.min([np.hypot(p[:, 0] - x, p[:, 1] - y) - r for x, y, r in holes], axis=0),
    )
    vertices[:, 2] = 0.12 * np.sin(4 * vertices[:, 0]) * np.cos(3 * vertices[:, 1])
    return vertices, faces


def open_cylinder() -> Soup:
    tube = implicit.level_set(
        lambda p: np.hypot(p[:, 0], p[:, 1]) - 0.5, [-0.6, -0.6, -1.2], [0.6, 0.6, 1.2], 100
    )
    return cut(tube, lambda p: 1.0 - np.abs(p[:, 2]))


def half_sphere() -> Soup:
    return cut(sphere(), lambda p: p[:, 2] + 0.2)


def bust_open() -> Soup:
    return cut(implicit.bust(), lambda p: p[:, 2] + 0.05)


# ---- tiny -----------------------------------------------------------------------------------


def tetrahedron() -> Soup:
    vertices = np.array([[1.0, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])
    return vertices, np.array([[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]])


def triangle() -> Soup:
    return np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]), np.array([[0, 1, 2]])


SMOOTH: dict[str, tuple[Callable[[], Soup], int]] = {
    "sphere": (sphere, 2500),
    "ellipsoid": (lambda: sphere((3.0, 2.0, 1.0)), 3000),
    "torus": (lambda: implicit.genus(1), 3000),
    **{f"genus_{g}": (lambda g=g: implicit.genus(g), 1500 + 1000 * g) for g in (2, 3, 4, 5, 6)},
    "octopus": (implicit.octopus, 9000),
    "disc": (disc, 2000),
    "annulus": (annulus, 2000),
    "sheet_with_holes": (sheet_with_holes, 4000),
    "open_cylinder": (open_cylinder, 2500),
    "half_sphere": (half_sphere, 2000),
    "bust_open": (bust_open, 6000),
}
"""Name, builder, vertices after remeshing."""

SHARP: dict[str, tuple[Callable[[], Soup], int]] = {
    "cube": (solids.cube, 2500),
    "bracket_made": (solids.bracket, 5000),
    "stepped_block": (solids.stepped_block, 5000),
    "cone": (solids.cone, 3000),
    "hexagon": (solids.hexagon, 2500),
    "gear": (solids.gear, 5000),
    "thin_plate": (lambda: solids.block([0, 0, 0], [1, 1, 0.02]), 3000),
}
"""Remeshed with their edges kept."""

AS_MADE: dict[str, Callable[[], Soup]] = {
    "noisy_sphere": noisy_sphere,
    "two_parts": two_parts,
    "fifty_parts": fifty_parts,
    "tetrahedron": tetrahedron,
    "triangle": triangle,
}


# ---- helpers --------------------------------------------------------------------------------


def remeshed(soup: Soup, count: int, feature: float = 30.0) -> Soup:
    """About so many vertices with near-equilateral triangles; edges over an angle are kept."""
    mesh = TriMesh(*soup)
    length = np.sqrt(2.0 * mesh.area / (np.sqrt(3.0) * count))
    meshes = pymeshlab.MeshSet(verbose=False)
    meshes.add_mesh(pymeshlab.Mesh(soup[0], soup[1].astype(np.int32)))
    meshes.meshing_isotropic_explicit_remeshing(
        iterations=10,
        targetlen=pymeshlab.PercentageValue(100.0 * length / mesh.diagonal),
        featuredeg=feature,
    )
    meshes.meshing_remove_unreferenced_vertices()
    made = meshes.current_mesh()
    return made.vertex_matrix(), made.face_matrix().astype(np.int64)


def joined(parts: list[Soup]) -> Soup:
    start = np.cumsum([0, *(len(v) for v, _ in parts)])
    faces = [f + s for (_, f), s in zip(parts, start, strict=False)]
    return np.concatenate([v for v, _ in parts]), np.concatenate(faces)


def shifted(soup: Soup, by: float, scale: float) -> Soup:
    return soup[0] * scale + [by, 0.0, 0.0], soup[1]


def write(path: Path, soup: Soup) -> None:
    mesh = TriMesh(*soup)  # refuses what is not manifold and oriented
    lines = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in mesh.vertices]
    lines += [f"f {a} {b} {c}" for a, b, c in mesh.faces + 1]
    path.write_text("\n".join(lines) + "\n")
    print(
        f"{path.name}: {mesh.n_vertices} vertices, {mesh.n_components} components, "
        f"Euler characteristic {mesh.euler_characteristic}, {len(mesh.boundary_loops)} loops"
    )


def generated(folder: Path) -> None:
    for name, (build, count) in SMOOTH.items():
        write(folder / f"{name}.obj", remeshed(build(), count))
    for name, (build, count) in SHARP.items():
        write(folder / f"{name}.obj", remeshed(build(), count))
    for name, build_all in AS_MADE.items():
        write(folder / f"{name}.obj", build_all())


def from_quads(quads: Path, folder: Path, count: int) -> None:
    for path in sorted(quads.glob("*.obj")):
        soup = read_polygons(path)
        faces, _ = soup.of_size(4)
        if len(faces) < soup.n_faces:
            print(f"{path.name}: left out, {soup.n_faces - len(faces)} faces are no quads")
            continue
        fine = catmull_clark(soup.vertices, faces)
        triangles = split_quads(fine.quads, np.random.default_rng(0))[0]
        write(folder / path.name, remeshed((fine.vertices, triangles), count))


def exported(folder: Path, count: int) -> None:
    rng, made = np.random.default_rng(0), 0
    while made < count:
        soup = random_part(rng)
        try:
            mesh = TriMesh(*soup)
        except MeshError:  # what a boolean now and then makes of faces that nearly coincide
            continue
        if mesh.n_components == 1 and mesh.has_manifold_vertices:
            write(folder / f"part_{made:02}.obj", soup)
            made += 1


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    kinds = parser.add_subparsers(dest="kind", required=True)
    made = kinds.add_parser("generated", help="shapes made in code")
    made.add_argument("out", type=Path)
    quads = kinds.add_parser("from-quads", help="a folder of quad meshes, as triangles")
    quads.add_argument("quads", type=Path)
    quads.add_argument("out", type=Path)
    quads.add_argument("--vertices", type=int, default=6000)
    parts = kinds.add_parser("exported", help="random machine parts")
    parts.add_argument("out", type=Path)
    parts.add_argument("--count", type=int, default=24)
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    if options.kind == "generated":
        generated(options.out)
    elif options.kind == "exported":
        exported(options.out, options.count)
    else:
        from_quads(options.quads, options.out, options.vertices)


if __name__ == "__main__":
    main()

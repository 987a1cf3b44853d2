"""CPU time of the extraction alone: 100,000 quads out of an integer-grid map of a torus.

    python benchmarks/extraction.py

The torus has 40,000 triangles whose vertices are shaken in the map, so that isolines cross them
anyhow; nothing is folded. Prints the median of five runs.
"""

from __future__ import annotations

import statistics
import time

import numpy as np

from vhquad.mesh.triangle import TriMesh
from vhquad.quad.extract import Extraction, extract_polygons
from vhquad.quad.grid import GRID, IntegerGridMap

VERTICES = (200, 100)  # around and along
CELLS = (500, 200)
RUNS = 5


def torus_map() -> IntegerGridMap:
    """A torus of radii 3 and 1, mapped to CELLS cells."""
    rng = np.random.default_rng(0)
    nu, nv = VERTICES
    i, j = (a.ravel() for a in np.meshgrid(np.arange(nu), np.arange(nv), indexing="ij"))
    angles = 2.0 * np.pi * np.stack([i / nu, j / nv])
    ring = 3.0 + np.cos(angles[1])
    x = np.stack([ring * np.cos(angles[0]), ring * np.sin(angles[0]), np.sin(angles[1])], axis=1)
    steps = np.array([[[0, 0], [1, 0], [1, 1]], [[0, 0], [1, 1], [0, 1]]])
    at = np.stack([i, j], axis=1)[:, None, None] + steps  # (cells, 2 triangles, 3 corners, 2)
    at = at.reshape(-1, 3, 2)
    vertex = (at[..., 0] % nu) * nv + at[..., 1] % nv
    cell = GRID * np.array(CELLS) // np.array(VERTICES)
    shake = rng.integers(-cell // 4, cell // 4, size=(nu * nv, 2))
    uv = at * cell + shake[vertex]
    mesh = TriMesh(x, vertex)
    flat, tail = uv.reshape(-1, 2), np.arange(3 * mesh.n_faces)
    head_across = 3 * (mesh.twin // 3) + (mesh.twin + 1) % 3
    return IntegerGridMap(mesh, uv, np.zeros(len(tail), np.int64), flat[head_across] - flat[tail])


def extracted(grid_map: IntegerGridMap) -> Extraction:
    return extract_polygons(grid_map.mesh, grid_map.uv, grid_map.rotation, grid_map.translation)


def main() -> None:
    grid_map = torus_map()
    seconds = []
    for _ in range(RUNS):
        start = time.process_time()
        found = extracted(grid_map)
        seconds.append(time.process_time() - start)
    sides = np.diff(found.polygons.start)
    if len(sides) != CELLS[0] * CELLS[1] or (sides != 4).any():
        raise SystemExit(f"{len(sides)} polygons of {sides.min()} to {sides.max()} sides")
    print(f"{len(sides)} quads: {statistics.median(seconds):.2f} CPU s (median of {RUNS})")


if __name__ == "__main__":
    main()

"""Which way to the summit? A vector field (order 1) learned on terrains, shown on another.

    python examples/terrain.py --picture terrain.png

The paper's navigation experiment, small: on random terrains, each with hills and one mountain, a
Vector Heat Network learns the direction of the shortest path along the ground to the top of the
mountain. Nobody tells it where that is; on a terrain that it has never seen it must find out from
the shape. The truth is the gradient of the exact geodesic distance (libigl). Beside the network
stand the simplest guide there is, to go uphill, which ends on the next hill, and the best of the
network's own inputs (gradients of the heat kernel signature), which shows what learning adds.

Two and a half CPU minutes on one core. The picture needs the extra ``viz``.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import igl
import numpy as np
import torch
from numpy.typing import NDArray
from scipy.spatial import Delaunay

from vhquad.geometry.delaunay import intrinsic_delaunay
from vhquad.geometry.frames import build_frames, to_3d, vertex_axes
from vhquad.geometry.laplacian import gradient_operator
from vhquad.learn.dataset import Dataset, SampleEntry, open_dataset, write_index, write_sample
from vhquad.learn.predict import predict_input
from vhquad.learn.runstate import Record
from vhquad.learn.samples import PreprocessSettings, operator_arrays
from vhquad.learn.schedule import TrainSettings
from vhquad.learn.train import train
from vhquad.mesh.triangle import TriMesh
from vhquad.nn.checkpoint import load_model
from vhquad.nn.settings import ModelSettings

Floats = NDArray[np.float64]
Complexes = NDArray[np.complex128]

POINTS = 40  # along a side
PREPARED = PreprocessSettings(features="hks", k=96)
MODEL = ModelSettings(order=1, channels=64, blocks=4, times=4, hidden_layers=1, head_terms=7)


@dataclass(frozen=True, eq=False)
class Terrain:
    """A height field over a square, and the vertex at the top of its mountain."""

    mesh: TriMesh
    summit: int

    def way(self) -> Complexes:
        """The direction of the shortest path to the summit in the vertex frames, (n,).

        Its modulus is 1 but where paths part.
        """
        mesh = self.mesh
        distance = igl.exact_geodesic(
            mesh.vertices,
            mesh.faces,
            VS=np.array([self.summit]),
            VT=np.arange(mesh.n_vertices),
        )
        return self._gradient(-distance)

    def uphill(self) -> Complexes:
        """The direction of steepest ascent, in the vertex frames; (n,)."""
        return self._gradient(self.mesh.vertices[:, 2])

    def _gradient(self, values: Floats) -> Complexes:
        tri = intrinsic_delaunay(self.mesh, build_frames(self.mesh))
        return np.asarray(gradient_operator(tri) @ values)


def make_terrain(rng: np.random.Generator) -> Terrain:
    """Hills of any width, roughness, and one mountain, over a square of side 2."""
    line = np.linspace(-1.0, 1.0, POINTS)
    flat = np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2)
    inside = np.abs(flat).max(axis=1) < 1.0 - 1e-9
    flat[inside] += rng.uniform(-0.35, 0.35, (inside.sum(), 2)) * 2.0 / POINTS
    height = np.zeros(len(flat))
    for _ in range(rng.integers(5, 10)):
        place = rng.uniform(-1.0, 1.0, 2)
        height += _hill(flat, place, rng.uniform(0.05, 0.2), rng.uniform(0.12, 0.3))
    for octave in (2.0, 4.0, 8.0):
        wave, phase = rng.normal(0.0, octave, (6, 2)), rng.uniform(0.0, 2.0 * np.pi, 6)
        height += (0.02 / octave) * np.cos(flat @ wave.T + phase).sum(axis=1)
    place = rng.uniform(-0.75, 0.75, 2)
    height += _hill(flat, place, rng.uniform(0.45, 0.6), rng.uniform(0.15, 0.2))
    near = np.linalg.norm(flat - place, axis=1) < 0.15
    summit = int(np.where(near, height, -np.inf).argmax())
    mesh = TriMesh(np.column_stack([flat, height]), Delaunay(flat).simplices.astype(np.int64))
    return Terrain(mesh, summit)


def _hill(flat: Floats, place: Floats, height: float, width: float) -> Floats:
    return height * np.exp(-((flat - place) ** 2).sum(axis=1) / (2.0 * width**2))


def write_dataset(folder: Path, terrains: dict[str, Terrain]) -> None:
    """Terrains as a dataset that ``vhquad.learn.train`` takes; by name, "test" ones apart."""
    entries = []
    for name, terrain in terrains.items():
        way = terrain.way()
        length = np.abs(way)
        arrays = operator_arrays(terrain.mesh, PREPARED, keep=False)
        arrays["z"] = np.divide(way, length, out=np.zeros_like(way), where=length > 0)
        arrays["coherence"] = length.clip(0.0, 1.0)
        arrays["size"] = np.zeros(len(way))  # not known, hence not learned
        write_sample(folder, name, arrays)
        split = "test" if name.startswith("test") else "train"
        n = terrain.mesh.n_vertices
        entries.append(SampleEntry(name, name, "terrain.py", split, True, n, None, "whole", name))
    write_index(
        Dataset(
            folder=folder,
            features=PREPARED.features,
            turned=PREPARED.turned,
            k=PREPARED.k,
            in_channels=arrays["features"].shape[1],
            in_lines=arrays["lines"].shape[1],
            order=1,
            samples=tuple(entries),
        )
    )


def arrivals(terrain: Terrain, field: Complexes) -> float:
    """Share of the vertices from which one gets to the summit by the field.

    At every vertex one walks along the edge that is closest to the field, and arrives within two
    mean edges of the summit.
    """
    mesh = terrain.mesh
    edge = np.exp(1j * build_frames(mesh).halfedge_angle.reshape(-1))
    cosine = (edge * field.conj()[mesh.tail]).real
    order = np.lexsort((-cosine, mesh.tail))
    first = np.searchsorted(mesh.tail[order], np.arange(mesh.n_vertices))
    following = mesh.head[order][first]
    gap = np.linalg.norm(mesh.vertices - mesh.vertices[terrain.summit], axis=1)
    there = gap < 2.0 * mesh.edge_lengths.mean()
    at = np.arange(mesh.n_vertices)
    for _ in range(mesh.n_vertices):
        at = np.where(there[at], at, following[at])
    return float(there[at].mean())


def degrees(field: Complexes, way: Complexes, mesh: TriMesh) -> tuple[float, float]:
    """Mean and median angle to the shortest path, weighted as in training."""
    angle = np.degrees(np.abs(np.angle(field * way.conj())))
    weight = mesh.vertex_areas * np.abs(way).clip(0.0, 1.0)
    order = np.argsort(angle)
    below = np.cumsum(weight[order]) / weight.sum()
    return float(weight @ angle / weight.sum()), float(angle[order][np.searchsorted(below, 0.5)])


def best_input(dataset: Dataset) -> tuple[int, float]:
    """The input that is closest to the way on the terrains to learn from: channel and sign."""
    total = np.zeros(dataset.in_channels)
    for entry in dataset.split("train"):
        arrays = dataset.archive(entry)
        length = np.maximum(np.abs(arrays["features"]), 1e-12)
        cosine = (arrays["features"] / length * arrays["z"].conj()[:, None]).real
        total += (arrays["mass"] * arrays["coherence"]) @ cosine
    channel = int(np.abs(total).argmax())
    return channel, float(np.sign(total[channel]))


def draw(path: Path, terrain: Terrain, fields: dict[str, Complexes]) -> None:
    """A panel a field: arrows on the terrain, the summit in red."""
    from vhquad.picture import View, open_panel, picture

    mesh = terrain.mesh
    view = View(np.zeros(3), np.array([0.8, -4.0, 3.6]), (0.0, 0.0, 1.0), 1.1)
    chosen = np.arange(mesh.n_vertices) % 3 == 0
    with picture(path, len(fields), (560, 460)) as (plotter, pv):
        for column, (name, field) in enumerate(fields.items()):
            open_panel(plotter, column, name, view)
            surface = pv.PolyData.from_regular_faces(mesh.vertices, mesh.faces)
            plotter.add_mesh(
                surface,
                scalars=mesh.vertices[:, 2],
                cmap=["#b9c9a5", "#d9d2b0", "#c9b08f", "#e8e4df"],
                smooth_shading=True,
                ambient=0.2,
                specular=0.0,
                show_scalar_bar=False,
            )
            unit = field / np.maximum(np.abs(field), 1e-12)
            vectors = to_3d(unit[:, None], vertex_axes(mesh))[:, 0]
            arrows = pv.PolyData((mesh.vertices + 0.02 * mesh.vertex_normals)[chosen])
            arrow = pv.Arrow(tip_radius=0.16, tip_length=0.45, shaft_radius=0.06)
            arrows["way"] = vectors[chosen]
            plotter.add_mesh(
                arrows.glyph(geom=arrow, orient="way", scale=False, factor=0.09), color="#20407a"
            )
            top = mesh.vertices[terrain.summit]
            plotter.add_mesh(pv.Sphere(radius=0.045, center=top), color="#d7301f")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--terrains", type=int, default=60, help="to learn from")
    parser.add_argument("--steps", type=int, default=2000)
    parser.add_argument("--picture", type=Path, help="a PNG file")
    options = parser.parse_args()
    torch.set_num_threads(1)
    rng = np.random.default_rng(0)
    names = [f"train{i:03d}" for i in range(options.terrains)] + [f"test{i}" for i in range(10)]
    terrains = {name: make_terrain(rng) for name in names}
    with tempfile.TemporaryDirectory() as scratch:
        folder, run = Path(scratch) / "terrains", Path(scratch) / "run"
        began = time.process_time()
        write_dataset(folder, terrains)
        print(f"{len(terrains)} terrains prepared in {time.process_time() - began:.0f} CPU s")

        def watch(record: Record) -> None:
            if record.step % 250 == 0:
                print(f"step {record.step}: loss {record.direction:.3f}")

        began = time.process_time()
        settings = TrainSettings(steps=options.steps, rate=2e-3, weigh="area")
        result = train(folder, run, settings, MODEL, on_record=watch, device="cpu")
        print(f"trained in {time.process_time() - began:.0f} CPU s")
        network = load_model(result.model).network
        dataset = open_dataset(folder)
        channel, sign = best_input(dataset)
        rows: dict[str, list[tuple[float, float, float]]] = {}
        for entry in dataset.split("test"):
            terrain = terrains[entry.name]
            way = terrain.way()
            fields = {
                "the shortest way": way,
                "the network": predict_input(network, dataset.load(entry).input).z,
                "its best input": sign * dataset.archive(entry)["features"][:, channel],
                "uphill": terrain.uphill(),
            }
            for name, field in fields.items():
                row = (*degrees(field, way, terrain.mesh), arrivals(terrain, field))
                rows.setdefault(name, []).append(row)
            if options.picture is not None and entry.name == "test0":
                draw(options.picture, terrain, fields)
    print(f"on {len(rows['uphill'])} terrains never seen: angle to the shortest way, arrivals")
    for name, values in rows.items():
        mean, median, there = np.mean(values, axis=0)
        print(f"{name:17s} mean {mean:5.1f}°  median {median:5.1f}°  {100.0 * there:3.0f} % arrive")


if __name__ == "__main__":
    main()

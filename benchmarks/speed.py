"""How long a remesh takes, step by step, and how that grows with the mesh.

    python benchmarks/speed.py examples/head.obj --out speed/
    python benchmarks/speed.py MESH --vertices 3000 60000 --quads 2000 --repeat 5 --out speed/
    python benchmarks/speed.py MESH --second --peers --eigsh 20000 --out speed/

The mesh is subdivided (Loop) and decimated to each number of vertices. Each run is a process of its
own with one thread and an empty cache; of several the one of the median CPU time is kept.
``--second`` runs each time again with more and with fewer quads, each with the cache as the first
run left it. Beside it stand, as often and in turn with ours, the whole of QuadriFlow and Instant
Meshes (``pip install '.[bench]'``) on the same file, and what SciPy's eigsh takes for the same
eigenpairs (up to so many vertices). Writes speed.json and, with matplotlib, speed.png; prints
tables. This process imports little: the memory of a child is at least that of its parent.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
SIZES = {3_000: 2_000, 10_000: 4_000, 60_000: 2_000, 200_000: 10_000, 500_000: 10_000}
PEERS = ("instant-meshes", "quadriflow")
SECOND = {"second, more": 1.3, "second, fewer": 1 / 1.3, "second, twice": 2.0, "second, half": 0.5}
"""Of the quads of the first run."""
FIELD_TO_QUADS = (
    "stand-in", "polish of the field", "map", "quantise", "embedding", "smoothing", "limbs",
    "unfolding",
    "creases",
)  # fmt: skip
EXTRA = {10_000: 8_000}  # quads that peers make as well: what QuadriFlow takes there is a bar
Result = dict[str, Any]

MAKE = """
import sys, fast_simplification, numpy, trimesh, vhquad
from vhquad.mesh.io import write_triangle_mesh
from vhquad.mesh.triangle import TriMesh
mesh = vhquad.load(sys.argv[1]).mesh
v, f, wanted = mesh.vertices, mesh.faces, int(sys.argv[2])
while len(v) < wanted:
    v, f = trimesh.remesh.subdivide_loop(v, f, iterations=1)
if len(v) > 1.1 * wanted:
    low, size = v.min(axis=0), numpy.ptp(v, axis=0).max()
    v, f = fast_simplification.simplify(
        (v - low) / size, numpy.asarray(f, numpy.int32), target_count=int(len(f) * wanted / len(v))
    )
    v = v * size + low
write_triangle_mesh(sys.argv[3], TriMesh(v, f))
"""

EIGSH = """
import json, sys, time, numpy, vhquad
from vhquad.geometry.delaunay import intrinsic_delaunay
from vhquad.geometry.frames import build_frames
from vhquad.geometry.laplacian import connection_laplacian, cotan_laplacian, lumped_mass
from vhquad.geometry.spectral import smallest_eigenpairs
mesh, k = vhquad.load(sys.argv[1]).mesh, 128
tri = intrinsic_delaunay(mesh, build_frames(mesh))
mass = lumped_mass(tri)
for name, matrix in (("connection", connection_laplacian(tri)), ("scalar", cotan_laplacian(tri))):
    found, seconds = [], []
    for exact in (True, False):
        start = time.process_time()
        found.append(smallest_eigenpairs(matrix, mass, k, exact=exact))
        seconds.append(time.process_time() - start)
    true, ours = found
    mixed = true.eigenvectors.conj().T @ (mass[:, None] * ours.eigenvectors)
    cosine = numpy.linalg.svd(mixed, compute_uv=False).min()
    off = numpy.abs(ours.eigenvalues - true.eigenvalues).max() / true.eigenvalues[-1]
    errors = {"span": float(numpy.sqrt(max(0.0, 1.0 - cosine**2))), "values": float(off)}
    print(json.dumps({"laplacian": name, "eigsh": seconds[0], "ours": seconds[1], **errors}))
"""


def child(words: list[str], cache: Path, log: Path) -> Result:
    """A process to its end: CPU and wall seconds, peak memory in MB, exit code."""
    threads = {f"{name}_NUM_THREADS": "1" for name in ("OMP", "MKL", "OPENBLAS")}
    start = time.time()
    environment = {**os.environ, **threads, "VHQUAD_CACHE": str(cache), "SPEED_BEGAN": str(start)}
    environment.pop("PYTHONDONTWRITEBYTECODE", None)  # what pip installs is compiled already
    with log.open("w") as file:
        process = subprocess.Popen(words, stdout=file, stderr=subprocess.STDOUT, env=environment)
        _, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    unit = 1024 if sys.platform != "darwin" else 1024**2  # KB on Linux, bytes on macOS
    return {
        "cpu": usage.ru_utime + usage.ru_stime,
        "wall": time.time() - start,
        "memory": usage.ru_maxrss / unit,
        "code": process.returncode,
    }


def remesh(mesh: Path, quads: int, cache: Path, folder: Path) -> Result:
    """One run of ours with its steps; 3 is a code of a run that ended with an invalid mesh."""
    times, report, log = (folder / name for name in ("times.json", "report.json", "log.txt"))
    words = ["remesh", str(mesh), "--out", str(folder / "quads.obj"), "--target-quads", str(quads)]
    words = [str(HERE / "speed_run.py"), str(times), *words, "--quiet", "--json", str(report)]
    result = child([sys.executable, *words], cache, log)
    if result["code"] not in (0, 3):
        return {**result, "error": log.read_text()[-500:]}
    steps = json.loads(times.read_text())["steps"]
    about = json.loads(report.read_text())
    return {**result, "steps": steps, "made": about["made"], "stand_in": about["stand_in"]}


def measure(mesh: Path, quads: int, extra: tuple[int, ...], options: argparse.Namespace) -> Result:
    """All runs on one mesh; peers make the extra counts as well."""
    entry: Result = {}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        runs: dict[str, list[Result]] = {}
        for number in range(options.repeat):
            cache = folder / f"cache{number}"
            runs.setdefault("remesh", []).append(remesh(mesh, quads, cache, folder))
            for title, share in SECOND.items() if options.second else ():
                after = folder / "after"  # the first run, and none of the others
                shutil.copytree(cache, after)
                again = remesh(mesh, round(quads * share), after, folder)
                shutil.rmtree(after)
                runs.setdefault(title, []).append(again)
            for peer in PEERS if options.peers else ():
                for count in (quads, *extra):
                    words = [sys.executable, str(HERE / "peers.py"), peer, str(mesh)]
                    words += [str(folder / "peer.obj"), str(count)]
                    title = peer if count == quads else f"{peer} at {count}"
                    once = child(words, folder / "none", folder / "peer.txt")
                    runs.setdefault(title, []).append(once)
        entry |= {title: middle(several) for title, several in runs.items()}
        vertices = sum(line.startswith("v ") for line in mesh.read_text().splitlines())
        entry |= {"vertices": vertices, "quads": quads}
        if vertices <= options.eigsh:
            log = folder / "eigsh.txt"
            found = []
            for _ in range(options.repeat):
                child([sys.executable, "-c", EIGSH, str(mesh)], folder / "none", log)
                found.append([json.loads(line) for line in log.read_text().splitlines()])
            entry["eigenpairs"] = [
                sorted(pairs, key=lambda one: one["eigsh"] / one["ours"])[len(pairs) // 2]
                for pairs in zip(*found, strict=True)
            ]
    return entry


def middle(runs: list[Result]) -> Result:
    """The run of the median CPU time, with the times of all."""
    ordered = sorted(runs, key=lambda run: run["cpu"])
    return {**ordered[len(runs) // 2], "all": [run["cpu"] for run in runs]}


def show(entries: list[Result]) -> None:
    """A table of CPU seconds."""
    from rich.console import Console
    from rich.table import Table

    table = Table("CPU seconds", title="remesh, one thread")
    for entry in entries:
        table.add_column(f"{entry['vertices']:,} to {entry['quads']:,}", justify="right")
    steps = dict.fromkeys(step for entry in entries for step in entry["remesh"].get("steps", ()))

    def row(name: str, value: Any) -> None:
        cells = [value(entry) for entry in entries]
        if any(cell is not None for cell in cells):
            table.add_row(name, *("" if cell is None else f"{cell:,.2f}" for cell in cells))

    for step in steps:
        row(step, lambda e, s=step: e["remesh"].get("steps", {}).get(s, {}).get("cpu"))
    table.add_section()

    def to_quads(entry: Result) -> float | None:
        found = entry["remesh"].get("steps")
        return found and sum(found[name]["cpu"] for name in FIELD_TO_QUADS if name in found)

    row("from the field to quads", to_quads)
    whole = dict.fromkeys(
        name
        for entry in entries
        for name in entry
        if isinstance(entry[name], dict) and "all" in entry[name]
    )
    for name in whole:
        title = "whole process" if name == "remesh" else name
        row(title, lambda e, n=name: e[n]["cpu"] if n in e and e[n]["code"] in (0, 3) else None)
        row(f"  {title}: GB", lambda e, n=name: e[n]["memory"] / 1024 if n in e else None)
    Console(width=120).print(table)
    pairs = Table(
        "vertices", "Laplacian", "eigsh", "ours", "ratio", "span", "values", title="eigenpairs"
    )
    for entry in entries:
        for one in entry.get("eigenpairs", ()):
            times = (one["eigsh"], one["ours"], one["eigsh"] / one["ours"])
            errors = (f"{one[name]:.1e}" for name in ("span", "values"))
            texts = (f"{value:.2f}" for value in times)
            pairs.add_row(f"{entry['vertices']:,}", one["laplacian"], *texts, *errors)
    if pairs.rows:
        Console(width=120).print(pairs)


def plot(entries: list[Result], path: Path) -> None:
    """CPU seconds against vertices, both logarithmic."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8, 5.5), layout="constrained")
    axes = figure.add_subplot(xscale="log", yscale="log", xlabel="vertices", ylabel="CPU seconds")
    done = [entry for entry in entries if "steps" in entry["remesh"]]
    whole = [(entry["vertices"], entry["remesh"]["cpu"]) for entry in done]
    axes.plot(*zip(*whole, strict=True), "k-o", linewidth=2, label="whole process")
    shares: dict[str, float] = {}
    for entry in done:
        for step, spent in entry["remesh"]["steps"].items():
            shares[step] = max(shares.get(step, 0.0), spent["cpu"] / entry["remesh"]["cpu"])
    for step in [step for step, share in shares.items() if share > 0.05]:
        points = [(e["vertices"], e["remesh"]["steps"].get(step, {"cpu": 0})["cpu"]) for e in done]
        axes.plot(*zip(*points, strict=True), "-", marker=".", label=step)
    for peer in PEERS:
        points = [(e["vertices"], e[peer]["cpu"]) for e in done if e.get(peer, {}).get("code") == 0]
        if points:
            axes.plot(*zip(*points, strict=True), "--s", label=peer)
    axes.grid(which="both", alpha=0.2)
    axes.legend(fontsize=8, ncols=2)
    figure.savefig(path, dpi=120)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("mesh", type=Path)
    parser.add_argument("--vertices", type=int, nargs="+", default=list(SIZES))
    parser.add_argument("--quads", type=int, help="for all; default 2,000 to 10,000 by the size")
    parser.add_argument("--repeat", type=int, default=1)
    parser.add_argument("--second", action="store_true")
    parser.add_argument("--peers", action="store_true")
    parser.add_argument("--eigsh", type=int, default=0, metavar="VERTICES")
    parser.add_argument("--out", type=Path, default=Path("speed"))
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    entries = []
    for vertices in options.vertices:
        mesh = options.out / f"{options.mesh.stem}_{vertices}.obj"
        if not mesh.exists():
            words = [sys.executable, "-c", MAKE, str(options.mesh), str(vertices), str(mesh)]
            subprocess.run(words, check=True)
        near = min(SIZES, key=lambda size: abs(size - vertices))
        extra = (EXTRA[near],) if near in EXTRA and options.peers else ()
        entries.append(measure(mesh, options.quads or SIZES[near], extra, options))
        (options.out / "speed.json").write_text(json.dumps(entries, indent=1) + "\n")
    show(entries)
    try:
        plot(entries, options.out / "speed.png")
    except ImportError:
        print("no picture: pip install '.[bench]' for matplotlib", file=sys.stderr)


if __name__ == "__main__":
    main()

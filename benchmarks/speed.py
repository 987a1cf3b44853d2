"""How long a remesh takes, step by step, and how that grows with the mesh.

    python benchmarks/speed.py examples/head.obj --out speed/
    python benchmarks/speed.py MESH --vertices 3000 60000 --quads 2000 --repeat 5 --out speed/
    python benchmarks/speed.py MESH --second --peers --eigsh 20000 --out speed/

The mesh is subdivided (Loop) and decimated to each number of vertices. Each run is a process of its
own with one thread and an empty cache; of several the least CPU time counts, since other work on
the machine only ever adds. ``--second`` runs once more with another count and a filled cache.
Beside it stand what SciPy's eigsh takes for the same eigenpairs (up to so many vertices), and the
whole of QuadriFlow and Instant Meshes (``pip install '.[bench]'``) on the same file. Writes
speed.json and, with matplotlib, speed.png; prints a table. This process imports little: the memory
of a child is at least that of its parent.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
SIZES = {3_000: 2_000, 10_000: 4_000, 60_000: 2_000, 200_000: 10_000, 500_000: 10_000}
PEERS = ("instant-meshes", "quadriflow")
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
import json, sys, time, vhquad
from vhquad.geometry.delaunay import intrinsic_delaunay
from vhquad.geometry.frames import build_frames
from vhquad.geometry.laplacian import connection_laplacian, lumped_mass
from vhquad.geometry.spectral import smallest_eigenpairs
mesh = vhquad.load(sys.argv[1]).mesh
tri = intrinsic_delaunay(mesh, build_frames(mesh))
args = connection_laplacian(tri, 1), lumped_mass(tri), 128
for exact in (True, False):
    start = time.process_time()
    smallest_eigenpairs(*args, exact=exact)
    print(json.dumps(time.process_time() - start))
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


def measure(mesh: Path, quads: int, options: argparse.Namespace) -> Result:
    """All runs on one mesh."""
    entry: Result = {}
    with tempfile.TemporaryDirectory() as name:
        folder, runs = Path(name), []
        for number in range(options.repeat):
            cache = folder / f"cache{number}"
            runs.append(remesh(mesh, quads, cache, folder))
        entry["remesh"] = min(runs, key=lambda run: run["cpu"])
        if options.second:
            entry["second"] = remesh(mesh, round(quads * 1.3), cache, folder)
        vertices = sum(line.startswith("v ") for line in mesh.read_text().splitlines())
        entry |= {"vertices": vertices, "quads": quads}
        if vertices <= options.eigsh:
            log = folder / "eigsh.txt"
            child([sys.executable, "-c", EIGSH, str(mesh)], folder / "none", log)
            eigsh, ours = map(json.loads, log.read_text().split())
            entry["eigenpairs"] = {"eigsh": eigsh, "ours": ours}
        for peer in PEERS if options.peers else ():
            words = [sys.executable, str(HERE / "peers.py"), peer, str(mesh)]
            words += [str(folder / "peer.obj"), str(quads)]
            entry[peer] = child(words, folder / "none", folder / "peer.txt")
    return entry


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
    for name in ("remesh", "second", *PEERS):
        title = "whole process" if name == "remesh" else name
        row(title, lambda e, n=name: e[n]["cpu"] if n in e and e[n]["code"] in (0, 3) else None)
        row(f"  {title}: GB", lambda e, n=name: e[n]["memory"] / 1024 if n in e else None)
    for name in ("eigsh", "ours"):
        row(f"eigenpairs, {name}", lambda e, n=name: e.get("eigenpairs", {}).get(n))
    Console(width=120).print(table)


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
        entries.append(measure(mesh, options.quads or SIZES[near], options))
        (options.out / "speed.json").write_text(json.dumps(entries, indent=1) + "\n")
    show(entries)
    try:
        plot(entries, options.out / "speed.png")
    except ImportError:
        print("no picture: pip install '.[bench]' for matplotlib", file=sys.stderr)


if __name__ == "__main__":
    main()

"""Remesh every mesh of a folder by the command line, and write a table of what came out.

    python benchmarks/remesh_folder.py MESHES/ --target-quads 2000 --out benchmarks/remesh_2000

writes ``OUT.md`` and ``OUT.json``. Each mesh is a process of its own, one thread, with a limit;
the figures are those of ``vhquad remesh --json``, the time is that of the whole process, start
included, and the memory its peak.
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

SUFFIXES = {".obj", ".ply", ".stl", ".off", ".glb"}
HEADER = (
    "mesh",
    "vertices",
    "quads",
    "asked",
    "topology",
    "irregular",
    "folded",
    "flipped",
    "SJ min",
    "SJ mean",
    "Hausdorff %",
    "method",
    "CPU s",
    "wall s",
    "MB",
)


def remesh(path: Path, target: int, method: str, limit: float, folder: Path) -> dict[str, object]:
    """One run: the report of ``vhquad remesh`` with time and memory, or what went wrong."""
    out, report = folder / "quads.obj", folder / "report.json"
    report.unlink(missing_ok=True)
    command = [sys.executable, "-m", "vhquad", "remesh", str(path), "--out", str(out)]
    command += ["--target-quads", str(target), "--method", method, "--json", str(report)]
    threads = {f"{name}_NUM_THREADS": "1" for name in ("OMP", "MKL", "OPENBLAS")}
    start = time.monotonic()
    process = subprocess.Popen(
        command,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, **threads, "VHQUAD_CACHE": str(folder / "cache")},
    )
    try:
        _, errors = process.communicate(timeout=limit)
    except subprocess.TimeoutExpired:
        process.kill()
        process.communicate()
        return {"mesh": path.name, "error": f"over {limit:.0f} s"}
    wall = time.monotonic() - start
    if process.returncode != 0 or not report.exists():
        last = errors.strip().splitlines()[-1:] or ["no message"]
        return {"mesh": path.name, "error": f"exit {process.returncode}: {last[0]}"}
    values = json.loads(report.read_text())
    return {"mesh": path.name, "report": values, "wall": wall}


def row(result: dict[str, object], usage: tuple[float, float]) -> list[str]:
    """A line of the table."""
    name = str(result["mesh"])
    if "error" in result:
        return [name, *["-"] * (len(HEADER) - 2), str(result["error"])]
    report = result["report"]
    assert isinstance(report, dict)
    quality = report["quality"]
    cpu, memory = usage
    methods = sorted({part["method"] for part in report["components"]})
    return [
        name,
        str(report["input"]["vertices"]),
        str(report["made"]),
        str(report["asked"]),
        "kept" if report["topology_kept"] else "CHANGED",
        str(sum(quality["irregular_interior"].values())),
        str(quality["folded_quads"]),
        str(quality["flipped_quads"]),
        f"{quality['scaled_jacobian_min']:.2f}",
        f"{quality['scaled_jacobian_mean']:.3f}",
        f"{quality['distance']['hausdorff']:.2f}",
        "; ".join(methods),
        f"{cpu:.1f}",
        f"{float(str(result['wall'])):.1f}",
        f"{memory:.0f}",
    ]


def children_usage() -> tuple[float, float]:
    """CPU seconds of all ended children so far, and the largest memory of one, MB."""
    import resource

    usage = resource.getrusage(resource.RUSAGE_CHILDREN)
    unit = 1e6 if sys.platform == "darwin" else 1e3
    return usage.ru_utime + usage.ru_stime, usage.ru_maxrss / unit


def one(argument: str) -> None:
    """Run one mesh and print its result with its own usage: memory peaks do not reset."""
    options = json.loads(argument)
    with tempfile.TemporaryDirectory() as folder:
        result = remesh(
            Path(options["path"]),
            options["target"],
            options["method"],
            options["limit"],
            Path(folder),
        )
    print(json.dumps({"result": result, "usage": children_usage()}))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("meshes", type=Path)
    parser.add_argument("--target-quads", type=int, default=2000)
    parser.add_argument("--method", default="learned", choices=("learned", "curvature"))
    parser.add_argument("--limit", type=float, default=180.0, help="seconds a mesh")
    parser.add_argument("--out", type=Path, required=True, help="stem of the .md and .json files")
    options = parser.parse_args()
    paths = sorted(p for p in options.meshes.iterdir() if p.suffix.lower() in SUFFIXES)
    rows, results = [], []
    for path in paths:
        call = {
            "path": str(path),
            "target": options.target_quads,
            "method": options.method,
            "limit": options.limit,
        }
        done = subprocess.run(
            [sys.executable, __file__, "--one", json.dumps(call)],
            capture_output=True,
            text=True,
            check=True,
        )
        value = json.loads(done.stdout)
        rows.append(row(value["result"], tuple(value["usage"])))
        results.append(value)
        print(" | ".join(rows[-1]), flush=True)
    lines = [
        f"`python benchmarks/remesh_folder.py MESHES/ --target-quads {options.target_quads} "
        f"--method {options.method} --out {options.out.name}`",
        "",
        "| " + " | ".join(HEADER) + " |",
        "|" + "---|" * len(HEADER),
        *("| " + " | ".join(line) + " |" for line in rows),
    ]
    options.out.with_suffix(".md").write_text("\n".join(lines) + "\n")
    options.out.with_suffix(".json").write_text(json.dumps(results, indent=1) + "\n")


if __name__ == "__main__":
    if sys.argv[1:2] == ["--one"]:
        one(sys.argv[2])
    else:
        main()

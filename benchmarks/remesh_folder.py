"""Remesh every mesh of some folders at some counts by some tools; judge and note each result.

    python benchmarks/remesh_folder.py MESHES/ MORE/ --quads 500 2000 8000 \
        --tools learned curvature instant-meshes quadriflow --out results.jsonl

Each run is a process of its own with one thread and a limit on CPU time; ``judge.py`` measures what
came out in another. A result is a line of JSON; runs that are there already are not repeated, so
this can be stopped at any time and goes on where it was. ``--redo-failed`` repeats those that
missed something and were made by another commit; the last line for a run counts. ``summary.py``
makes tables of the results.

This process imports little: the memory of a child is at least that of its parent.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

HERE = Path(__file__).parent
SUFFIXES = {".obj"}
OURS = ("learned", "curvature")
TOOLS = (*OURS, "instant-meshes", "quadriflow")
Result = dict[str, object]


def command(tool: str, mesh: Path, target: int, out: Path, report: Path) -> list[str]:
    """What makes the quads."""
    if tool in OURS:
        start = [sys.executable, "-m", "vhquad", "remesh", str(mesh), "--out", str(out)]
        return [*start, "--target-quads", str(target), "--method", tool, "--json", str(report)]
    return [sys.executable, str(HERE / "peers.py"), tool, str(mesh), str(out), str(target)]


def run(words: list[str], limit: int, log: Path, cache: Path) -> Result:
    """A process to its end: exit code, CPU and wall seconds, peak memory in MB."""
    threads = {f"{name}_NUM_THREADS": "1" for name in ("OMP", "MKL", "OPENBLAS")}
    start = time.monotonic()
    with log.open("w") as file:
        process = subprocess.Popen(
            words,
            stdout=file,
            stderr=subprocess.STDOUT,
            env={**os.environ, **threads, "VHQUAD_CACHE": str(cache)},
            preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_CPU, (limit, limit + 5)),
        )
        try:
            _, status, usage = os.wait4(process.pid, 0)
        except BaseException:
            process.kill()
            raise
    process.returncode = os.waitstatus_to_exitcode(status)
    unit = 1e6 if sys.platform == "darwin" else 1e3
    return {
        "exit": process.returncode,
        "cpu": round(usage.ru_utime + usage.ru_stime, 2),
        "wall": round(time.monotonic() - start, 2),
        "mb": round(usage.ru_maxrss / unit),
    }


def one(tool: str, mesh: Path, target: int, limit: int, folder: Path) -> Result:
    """Remesh and judge."""
    out, report, log = folder / "quads.obj", folder / "report.json", folder / "log"
    for old in (out, report):
        old.unlink(missing_ok=True)
    cache = folder / "cache"
    result = run(command(tool, mesh, target, out, report), limit, log, cache)
    if not out.exists() or result["exit"] != 0:
        last = log.read_text(errors="replace").strip().splitlines()[-1:]
        slow = result["exit"] in (-signal.SIGXCPU, -signal.SIGKILL)
        what = f"over {limit} s of CPU" if slow else f"exit {result['exit']}"
        result["error"] = ": ".join([what, *last])[:300]
    if not out.exists():
        return result
    if report.exists():
        values = json.loads(report.read_text())
        kept = ("method", "reason", "singularities", "crease_corners", "cancelled", "target")
        result["parts"] = [{k: part[k] for k in kept} for part in values["components"]]
        result["seconds"] = {k: round(v, 2) for k, v in values["seconds"].items()}
    verdict = folder / "verdict"
    words = [sys.executable, str(HERE / "judge.py"), str(out), str(mesh)]
    judged = run(words + [str(report)] * report.exists(), 300, verdict, cache)
    if judged["exit"] == 0:
        result["figures"] = json.loads(verdict.read_text().splitlines()[-1])
    else:
        result["error"] = "not judged: " + verdict.read_text().strip().splitlines()[-1][:300]
    return result


def missed(result: Result) -> bool:
    """Whether a run is worth repeating with other code: something is not as it should be."""
    figures, parts = result.get("figures"), result.get("parts")
    if "error" in result or not isinstance(figures, dict):
        return True
    bad = ("non_quads", "nonmanifold_edges", "nonmanifold_vertices", "misoriented_edges")
    count, target = figures["faces"], int(str(result["target"]))
    return (
        any(figures[k] for k in (*bad, "folded", "flipped"))
        or not figures["kept"]
        or abs(count - target) > 0.05 * target
        or figures.get("border_off", 0.0) > 1e-4
        or any(part["reason"] for part in (parts if isinstance(parts, list) else []))
    )


def commit() -> str:
    """Which code runs: the commit, marked if the package differs from it."""
    git = ["git", "-C", str(HERE.parent)]
    name = subprocess.run([*git, "rev-parse", "--short", "HEAD"], capture_output=True, text=True)
    changed = subprocess.run(
        [*git, "status", "--porcelain", "vhquad"], capture_output=True, text=True
    )
    return name.stdout.strip() + ("+" if changed.stdout.strip() else "")


def key(result: Result) -> tuple[object, ...]:
    return result["folder"], result["mesh"], result["target"], result["tool"]


def load(path: Path) -> dict[tuple[object, ...], Result]:
    """The last result of each run; a line cut short by a kill is passed over."""
    found: dict[tuple[object, ...], Result] = {}
    for line in path.read_text().splitlines() if path.exists() else ():
        try:
            result = json.loads(line)
        except json.JSONDecodeError:
            continue
        found[key(result)] = result
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folders", type=Path, nargs="+")
    parser.add_argument("--quads", type=int, nargs="+", default=[500, 2000, 8000])
    parser.add_argument("--tools", nargs="+", default=["learned"], choices=TOOLS)
    parser.add_argument("--meshes", nargs="+", help="names without suffix; default: all")
    parser.add_argument("--limit", type=int, default=240, help="CPU seconds a run")
    parser.add_argument("--redo-failed", action="store_true")
    parser.add_argument("--out", type=Path, required=True, help="JSON lines")
    options = parser.parse_args()
    paths = [p for d in options.folders for p in sorted(d.iterdir()) if p.suffix in SUFFIXES]
    if options.meshes:
        paths = [p for p in paths if p.stem in options.meshes]
    known = load(options.out)
    for tool in options.tools:
        for target in options.quads:
            for path in paths:
                start: Result = {
                    "folder": path.parent.name,
                    "mesh": path.stem,
                    "target": target,
                    "tool": tool,
                    "commit": commit(),
                }
                old = known.get(key(start))
                if old is not None and not (
                    options.redo_failed and missed(old) and old["commit"] != start["commit"]
                ):
                    continue
                with tempfile.TemporaryDirectory() as folder:
                    result = {**start, **one(tool, path, target, options.limit, Path(folder))}
                with options.out.open("a") as file:
                    file.write(json.dumps(result) + "\n")
                mark = "MISS" if missed(result) else "ok"
                print(mark, path.stem, target, tool, result.get("error", ""), flush=True)


if __name__ == "__main__":
    main()

"""Tables of what ``remesh_folder.py`` measured.

    python benchmarks/summary.py results.jsonl --out benchmarks/

writes ``bars.md`` (each bar: held in how many runs, and the worst), ``peers.md`` (the tools side by
side on the meshes that all of them were given) and ``runs.md`` (a line for every run).
"""

from __future__ import annotations

import argparse
import os
from collections import Counter, defaultdict
from collections.abc import Callable, Sequence
from pathlib import Path
from statistics import mean, median

from bars import BARS, Result, figures_of, is_cad, is_valid
from remesh_folder import OURS, TOOLS, load

Row = Sequence[str]


def table(head: Row, rows: Sequence[Row]) -> list[str]:
    lines = ["| " + " | ".join(row) + " |" for row in (head, *rows)]
    return [lines[0], "|" + "---|" * len(head), *lines[1:]]


# ---- bars -----------------------------------------------------------------------------------


def bars(runs: list[Result]) -> list[str]:
    """For each bar: the share asked for, in how many runs it held, and the worst run."""
    rows = []
    for bar in BARS:
        asked = [run for run in runs if bar.applies(run)]
        if not asked:
            continue
        held = sum(bar.held(run) for run in asked)
        made = [run for run in asked if figures_of(run)]
        worst = max(made, key=bar.value, default=None)
        text = "-"
        if worst is not None and bar.value(worst) > 0:
            text = f"{bar.value(worst):.3g}: {worst['mesh']} {worst['target']} {worst['tool']}"
        mark = "yes" if held >= bar.share * len(asked) else "**no**"
        share = f"{100 * bar.share:.0f} %"
        rows.append((bar.text, share, f"{held} of {len(asked)}", mark, text))
    return table(("bar (unit)", "asked", "held in runs", "bar held", "worst"), rows)


# ---- side by side ---------------------------------------------------------------------------


def over(runs: list[Result], value: Callable[[Result], float], of: Callable = median) -> str:
    """A figure over the runs that made something."""
    values = [value(run) for run in runs if figures_of(run)]
    return f"{of(values):.3g}" if values else "-"


def shape(run: Result, name: str) -> float:
    return float(figures_of(run).get(name) or 0.0)


def irregular(run: Result) -> float:
    figures = figures_of(run)
    return 1000.0 * sum(figures["irregular"].values()) / figures["faces"]


def near_count(run: Result) -> bool:
    return bool(figures_of(run)) and abs(figures_of(run)["faces"] / run["target"] - 1) <= 0.05


def column(runs: list[Result]) -> list[str]:
    """The figures of one tool."""
    made = [run for run in runs if figures_of(run)]
    rims = [run for run in made if "border_off" in figures_of(run)]
    cad = [run for run in made if is_cad(run) and "crease_off" in figures_of(run)]
    return [
        f"{len(made)} of {len(runs)}",
        str(sum(is_valid(run) for run in runs)),
        str(sum(shape(run, "folded") == 0 for run in made)),
        over(runs, lambda r: shape(r, "folded"), sum),
        over(runs, lambda r: shape(r, "folded"), max),
        over(runs, irregular),
        str(sum(near_count(run) for run in runs)),
        over(runs, lambda r: shape(r, "jacobian_mean")),
        over(runs, lambda r: shape(r, "hausdorff")),
        over(runs, lambda r: shape(r, "mean_distance")),
        over(rims, lambda r: shape(r, "border_off"), max),
        over(cad, lambda r: shape(r, "crease_off"), mean),
        over(runs, lambda r: float(r["cpu"])),
        over(runs, lambda r: float(r["cpu"]), max),
        over(runs, lambda r: float(r["mb"]), max),
    ]


FIGURES = (
    "runs that made quads",
    "all quads, manifold, the input's topology (runs)",
    "no quad folded (runs)",
    "quads folded, all together",
    "… in the worst run",
    "irregular vertices inside, per 1,000 quads (median)",
    "count within 5 % (runs)",
    "scaled Jacobian, mean of the worst corners (median)",
    "Hausdorff distance, % of the diagonal (median)",
    "mean distance, % of the diagonal (median)",
    "boundary vertices off the boundary, %, worst",
    "CAD: crease to edge, %, mean",
    "CPU s (median)",
    "CPU s (most)",
    "MB (most)",
)


def peers(runs: list[Result]) -> list[str]:
    """A table for each target, over the meshes that every tool was given; of ours the default."""
    by: dict[int, dict[str, dict[tuple[str, str], Result]]] = defaultdict(lambda: defaultdict(dict))
    for run in runs:
        by[run["target"]][run["tool"]][(run["folder"], run["mesh"])] = run
    lines: list[str] = []
    for target, tools in sorted(by.items()):
        names = [tool for tool in TOOLS if tool in tools and tool != "curvature"]
        if len(names) < 2:
            continue
        common = sorted(set.intersection(*(set(tools[name]) for name in names)))
        columns = [column([tools[name][key] for key in common]) for name in names]
        rows = [(text, *values) for text, *values in zip(FIGURES, *columns, strict=True)]
        heads = ["vhquad" if name in OURS else name for name in names]
        lines += [f"## {target} quads, {len(common)} meshes", "", *table(("", *heads), rows), ""]
    return lines


# ---- all ------------------------------------------------------------------------------------

HEADER = (
    *("mesh", "tool", "asked", "quads", "valid", "folded", "flipped", "irregular", "SJ mean"),
    *("Hausdorff %", "border off %", "crease off %", "how", "CPU s", "MB", "commit"),
)


def line(run: Result) -> Row:
    figures = figures_of(run)
    start = [run["mesh"], run["tool"], str(run["target"])]
    end = [f"{run['cpu']:.1f}", str(run["mb"]), run["commit"]]
    if not figures:
        return [*start, *["-"] * 9, run.get("error", "nothing made").replace("|", "/"), *end]
    methods = sorted({part["method"] for part in run.get("parts", [])})
    rim, crease = figures.get("border_off"), figures.get("crease_off")
    return [
        *start,
        str(figures["faces"]),
        "yes" if is_valid(run) else "NO",
        str(figures["folded"]),
        str(figures["flipped"]),
        str(sum(figures["irregular"].values())),
        f"{figures['jacobian_mean']:.3f}",
        f"{shape(run, 'hausdorff'):.2f}",
        "-" if rim is None else f"{rim:.1g}",
        "-" if crease is None else f"{crease:.3f}",
        "; ".join(methods) or "-",
        *end,
    ]


TITLES = {
    "bars": "What vhquad is held to",
    "peers": "Side by side",
    "runs": "Every run",
}


def heading(name: str, runs: list[Result], out: Path) -> list[str]:
    """Title, commands and what was run, of a file in a folder."""
    about = Path(os.path.relpath(Path(__file__).with_name("README.md"), out)).as_posix()
    count = Counter((run["target"], run["tool"]) for run in runs)
    said = [f"{n} x {tool} at {target}" for (target, tool), n in sorted(count.items())]
    commits = sorted({run["commit"] for run in runs if run["tool"] in OURS})
    return [
        f"# {TITLES[name]}",
        "",
        f"Made by `make_suite.py`, `remesh_folder.py` and `summary.py`, see [README.md]({about});",
        "one thread a run; CPU time and memory are those of the whole process, start included.",
        "",
        f"Runs: {', '.join(said)}. Commits: {', '.join(commits)}.",
    ]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("results", type=Path)
    parser.add_argument("--out", type=Path, required=True, help="folder")
    options = parser.parse_args()
    runs = list(load(options.results).values())
    ours = [run for run in runs if run["tool"] in OURS]
    order = sorted(
        runs, key=lambda r: (r["target"], TOOLS.index(r["tool"]), r["folder"], r["mesh"])
    )
    texts = {
        "bars": bars(ours),
        "peers": peers(runs),
        "runs": table(HEADER, [line(run) for run in order]),
    }
    options.out.mkdir(parents=True, exist_ok=True)
    for name, lines in texts.items():
        text = "\n".join([*heading(name, runs, options.out), "", *lines])
        (options.out / f"{name}.md").write_text(text.rstrip() + "\n")


if __name__ == "__main__":
    main()

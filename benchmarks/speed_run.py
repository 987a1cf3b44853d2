"""One remesh with a clock on every step: CPU and wall seconds of each, nested ones taken out.

    python benchmarks/speed_run.py TIMES.json remesh MESH --out QUADS.obj --target-quads 2000

All after the first argument is for vhquad. Libraries are imported before the clocks start: what
that takes, with Python's own start, is the step "start". Those of the network are left out where
the cache holds a field.
"""

from __future__ import annotations

import importlib
import json
import os
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from vhquad.cache import default_cache_dir

STEPS = {
    "read": ["vhquad.mesh.load.read_polygons", "vhquad.api.load_kept"],
    "repair": ["vhquad.mesh.load.repair"],
    "stand-in": [
        f"vhquad.quad.place.{name}" for name in ("make_stand_in", "refine_planes", "refine_curves")
    ],
    "proxy": ["vhquad.learn.proxy.make_proxy", "vhquad.learn.proxy.carry_back"],
    "operators": ["vhquad.geometry.operators.build_operators"],
    "eigenpairs": ["vhquad.geometry.operators.smallest_eigenpairs"],
    "features": ["vhquad.geometry.operators.compute_features"],
    "network": ["vhquad.learn.predict.predict_input", "vhquad.nn.checkpoint.load_model"],
    "blend": ["vhquad.learn.blend.curvature_field"],
    "field": ["vhquad.api.predict"],
    "polish of the field": ["vhquad.quad.continuous.align_field"],
    "map": ["vhquad.quad.continuous.solve_seamless_map"],
    "quantise": [f"vhquad.quad.mapping.{name}" for name in ("trace", "build_tmesh", "quantise")],
    "embedding": ["vhquad.quad.mapping.embed_layout"],
    "smoothing": ["vhquad.quad.component.smooth_quads"],
    "limbs": ["vhquad.quad.component.polished_onto_limbs"],
    "unfolding": ["vhquad.quad.component.lifted"],
    "creases": ["vhquad.quad.component.attach_to_creases", "vhquad.quad.component.straddled"],
    "report": ["vhquad.quad.pipeline.check_quads"],
    "write": ["vhquad.mesh.io.write_quad_mesh"],
}
"""Functions of each step, by the names under which they are called."""


class Clock:
    """Seconds by step; a step's own, without those of steps inside it."""

    def __init__(self) -> None:
        self.seconds: dict[str, list[float]] = {}
        self._inside: list[list[float]] = []

    def timed(self, step: str, function: Callable[..., Any]) -> Callable[..., Any]:
        """The function with a clock around it."""

        def run(*args: Any, **kwargs: Any) -> Any:
            start = now()
            self._inside.append([0.0, 0.0])
            try:
                return function(*args, **kwargs)
            finally:
                spent = [after - before for after, before in zip(now(), start, strict=True)]
                nested = self._inside.pop()
                own = self.seconds.setdefault(step, [0.0, 0.0])
                for k in (0, 1):
                    own[k] += spent[k] - nested[k]
                    if self._inside:
                        self._inside[-1][k] += spent[k]

        return run


def now() -> tuple[float, float]:
    """CPU and wall seconds."""
    return time.process_time(), time.perf_counter()


def main() -> None:
    times, arguments = Path(sys.argv[1]), sys.argv[2:]
    began = float(os.environ.get("SPEED_BEGAN", time.time()))
    clock = Clock()
    known = any(default_cache_dir().glob("field-*"))
    for step, names in STEPS.items():
        for name in names:
            home, attribute = name.rsplit(".", 1)
            if known and home.startswith(("vhquad.learn.", "vhquad.nn.")):
                continue
            module = importlib.import_module(home)
            setattr(module, attribute, clock.timed(step, getattr(module, attribute)))
    importlib.import_module("vhquad.cli.show")
    clock.seconds["start"] = [time.process_time(), time.time() - began]
    from vhquad.cli.app import main as vhquad

    code = 0
    run = clock.timed("other", vhquad)
    try:
        run(arguments)
    except SystemExit as left:
        code = int(left.code or 0)
    cpu_wall = {step: {"cpu": cpu, "wall": wall} for step, (cpu, wall) in clock.seconds.items()}
    times.write_text(json.dumps({"code": code, "steps": cpu_wall}))
    sys.exit(code)


if __name__ == "__main__":
    main()

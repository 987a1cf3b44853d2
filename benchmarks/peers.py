"""Run another remesher on one mesh, in this process.

    python benchmarks/peers.py instant-meshes INPUT.obj OUT.obj 2000
    python benchmarks/peers.py quadriflow INPUT.obj OUT.obj 2000

Both come with ``pip install '.[bench]'``. Each is given its own switches for borders and creases,
as anyone would who wants them kept.
"""

from __future__ import annotations

import sys
from pathlib import Path

CREASE = 40.0  # degrees


def instant_meshes(source: Path, out: Path, target: int) -> None:
    """Instant Meshes (Jakob et al. 2015), extrinsic, pure quads.

    To make all faces quads it splits each of them at the end: a quarter is asked for.
    """
    import pyinstantmeshes

    pyinstantmeshes.remesh_file(
        str(source),
        str(out),
        target_face_count=target // 4,
        extrinsic=True,
        pure_quad=True,
        deterministic=True,
        crease_angle=CREASE,
        align_to_boundaries=True,
    )


def quadriflow(source: Path, out: Path, target: int) -> None:
    """QuadriFlow (Huang et al. 2018), sharp edges and borders kept."""
    from pyQuadriFlow.pyQuadriFlow import pyquadriflow

    points, faces = [], []
    for line in source.read_text().splitlines():
        words = line.split()
        if words[:1] == ["v"]:
            points.append([float(word) for word in words[1:4]])
        elif words[:1] == ["f"]:
            faces.append([int(word.split("/")[0]) - 1 for word in words[1:]])
    made = pyquadriflow(target, 0, points, faces, True, True, False, False, False)
    lines = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in made["vertices"]]
    lines += ["f " + " ".join(str(v + 1) for v in face) for face in made["faces"]]
    out.write_text("\n".join(lines) + "\n")


def main() -> None:
    tool, source, out, target = sys.argv[1:5]
    run = {"instant-meshes": instant_meshes, "quadriflow": quadriflow}[tool]
    run(Path(source), Path(out), int(target))


if __name__ == "__main__":
    main()

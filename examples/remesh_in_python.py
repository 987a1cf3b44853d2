"""Remesh from a script: read, predict, make quads, look at the report, write.

python examples/remesh_in_python.py examples/head.obj quad.obj --quads 4000
"""

from __future__ import annotations

import argparse

import vhquad
from vhquad.mesh.io import write_quad_mesh


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("mesh")
    parser.add_argument("out")
    parser.add_argument("--quads", type=int, default=4000)
    parser.add_argument("--method", choices=("learned", "curvature"), default="learned")
    options = parser.parse_args()

    loaded = vhquad.load(options.mesh)  # triangles, repaired; what was done is in .report
    for line in loaded.lines():
        print(line)
    mesh = loaded.mesh

    field = vhquad.predict(mesh, method=options.method)  # a cross at every vertex or face
    print(f"{len(field)} crosses on {field.domain}")

    result = vhquad.remesh(mesh.vertices, mesh.faces, field=field, target_quads=options.quads)
    write_quad_mesh(options.out, result.quads)

    report = result.report
    print(f"{report.made} quads of {report.asked} asked for")
    print(f"irregular vertices: {dict(result.quads.irregular_interior)}")
    for line in report.shortfalls():
        print(f"note: {line}")


if __name__ == "__main__":
    main()

"""Write what QuadWild-BiMDF takes: the repaired mesh, the predicted field, the edges to keep.

    python examples/field_for_quadwild.py examples/head.obj quadwild/head
    quadwild quadwild/head.obj 3 basic_setup.txt quadwild/head.rosy quadwild/head.sharp

QuadWild matches rows by order, so it must get this mesh, not the one that was read.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import vhquad
from vhquad.field.features import find_creases
from vhquad.field.io import write_field
from vhquad.field.sharp import write_sharp
from vhquad.mesh.io import write_triangle_mesh


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("mesh")
    parser.add_argument("stem", help="folder and name of the three files")
    parser.add_argument("--crease", type=float, default=40.0, help="degrees")
    parser.add_argument("--method", choices=("learned", "curvature"), default="learned")
    options = parser.parse_args()

    stem = Path(options.stem)
    stem.parent.mkdir(parents=True, exist_ok=True)
    mesh = vhquad.load(options.mesh).mesh
    field = vhquad.predict(mesh, method=options.method)
    creases = find_creases(mesh, options.crease)
    write_triangle_mesh(stem.with_suffix(".obj"), mesh)
    write_field(stem.with_suffix(".rosy"), mesh, field)
    write_sharp(stem.with_suffix(".sharp"), mesh, creases)
    print(f"{stem}.obj, .rosy and .sharp: {mesh.n_faces} triangles, {len(creases)} creases")


if __name__ == "__main__":
    main()

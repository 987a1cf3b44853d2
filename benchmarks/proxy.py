"""How far the field predicted on a decimated proxy is from the one predicted on the mesh itself.

    python benchmarks/proxy.py MESH [MESH ...] --model default

For meshes of more than 15,000 vertices a component, of which `vhquad predict` takes a proxy. Prints
the mean angle between the two crosses, by area, over all of the surface and over the part where the
prediction on the mesh itself is trusted; how far sizes are apart (mean relative difference); and
the mean angle between what `vhquad predict` makes of the two with the help of the curvature.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import vhquad
from vhquad.field.cross import CrossField
from vhquad.learn.blend import lean_on_curvature
from vhquad.learn.predict import predict_field
from vhquad.learn.proxy import PROXY_ABOVE
from vhquad.nn.checkpoint import load_model

TRUSTED = 0.8  # confidence


def mean(values: NDArray[np.float64], weight: NDArray[np.float64]) -> float:
    """Weighted mean; NaN where nothing weighs."""
    return float(values @ weight / weight.sum()) if weight.any() else float("nan")


def apart(one: CrossField, other: CrossField) -> NDArray[np.float64]:
    """Degrees between the crosses of two fields."""
    return np.asarray(np.degrees(np.abs(np.angle(one.z * other.z.conj()))) / 4.0)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("meshes", type=Path, nargs="+")
    parser.add_argument("--model", default="default")
    options = parser.parse_args()
    model = load_model(options.model)
    print(
        f"{'mesh':<24}{'vertices':>9}{'degrees':>9}{'trusted':>9}{'share':>7}{'size':>7}{'predict':>9}"
    )
    for path in options.meshes:
        mesh = vhquad.load(path).mesh
        parts = [mesh.submesh(mesh.face_component == c)[0] for c in range(mesh.n_components)]
        if max(part.n_vertices for part in parts) <= PROXY_ABOVE:
            print(f"{path.stem:<24}{mesh.n_vertices:>9,}  needs no proxy")
            continue
        full, near = (predict_field(mesh, model, resolution=r) for r in ("full", "auto"))
        assert full.size is not None
        assert near.size is not None
        assert full.confidence is not None
        weight = np.where((full.z != 0) & (near.z != 0), mesh.vertex_areas, 0.0)
        angle = apart(full, near)
        leaning = apart(lean_on_curvature(mesh, full), lean_on_curvature(mesh, near))
        trusted = weight * (full.confidence >= TRUSTED)
        both = np.where(weight > 0, full.size, 1.0), np.where(weight > 0, near.size, 1.0)
        print(
            f"{path.stem:<24}{mesh.n_vertices:>9,}{mean(angle, weight):>9.2f}"
            f"{mean(angle, trusted):>9.2f}{trusted.sum() / weight.sum():>7.2f}"
            f"{mean(np.abs(both[1] / both[0] - 1.0), weight):>7.3f}{mean(leaning, weight):>9.2f}",
            flush=True,
        )


if __name__ == "__main__":
    main()

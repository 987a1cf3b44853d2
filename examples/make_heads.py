"""Make quad meshes of random heads with anny (CC0 shapes), as training data or as a test scan.

    pip install 'vhquad[heads]'
    python examples/make_heads.py quads/ --count 300          # head_0000.obj ... and split.json
    python examples/make_heads.py --scan examples/head.obj    # one unseen head as triangles
    vhquad preprocess quads/ --out dataset/
    vhquad train dataset/ --out run/

A head is drawn by phenotype (age, weight, ...), local changes of the face's parts (left equal to
right up to a small difference) and up to three facial actions. Every third head or so is the bare
skin, with holes for eyes and mouth; the others have eye sockets and a mouth bag. Draws in which the
surface cuts through itself too much are drawn again. ``split.json`` puts a fifteenth of the heads
aside for validation and two fifteenths for the test; ``vhquad preprocess`` obeys it.

The first start of anny takes a minute or two (it builds its data), later ones a second.
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Mapping
from pathlib import Path

import anny
import numpy as np
import pymeshlab
import torch
from anny.face_segmentation import get_face_segmentation_mask
from numpy.typing import NDArray
from quad_sets import Drawn, write_obj, write_set

from vhquad.learn.subdivide import catmull_clark
from vhquad.learn.targets import isotropic_remesh, split_quads

HEAD_PARTS = re.compile(r"^(head|forehead|eyebrows|mouth|nose|chin|neck|(l|r)-(eye|ear|cheek))-")
CAVITIES = ["eye_cavity.L", "eye_cavity.R", "mouth_cavity"]
SIDES = (("l-", "r-"), ("Left", "Right"))
PERSON = "random person, anny (MakeHuman shapes)"
SCAN_IDENTITY = 1_000_000  # never reached by --count
SCAN_VERTICES = 13_000


class HeadMaker:
    """Draws heads: ``draw(identity)`` gives the same vertices and quads for the same identity."""

    kind = "head"
    most_self_intersections = 150  # triangles

    model_options: Mapping[str, str] = {
        "rig": "makehuman-head",
        "topology": "head-noeyes-notongue-quads",
    }
    parts = HEAD_PARTS  # whose local changes are drawn

    def __init__(self, seed: int = 0) -> None:
        self.seed = seed
        self.model = anny.Anny(
            **self.model_options,
            phenotypes="all",
            local_changes="default",
            facial_actions="all",
        )
        self.quads = self.model.faces.numpy()
        self.skin = ~get_face_segmentation_mask(self.model, CAVITIES).numpy()
        self.local_names = [n for n in self.model.local_change_labels if self.parts.match(n)]

    def draw(
        self, identity: int, skin_only: bool | None = None
    ) -> tuple[NDArray[np.float64], NDArray[np.int64], str]:
        """Vertices (n, 3), quads (k, 4) and the variant's name, "full" or "skin"."""
        rng = np.random.default_rng([self.seed, identity])
        skin = bool(rng.random() < 0.4) if skin_only is None else skin_only
        while True:
            vertices = self._vertices(rng)
            if self_intersections(vertices, self.quads) <= self.most_self_intersections:
                break
        used, quads = np.unique(self.quads[self.skin if skin else slice(None)], return_inverse=True)
        return vertices[used], quads.reshape(-1, 4).astype(np.int64), "skin" if skin else "full"

    def _vertices(self, rng: np.random.Generator) -> NDArray[np.float64]:
        phenotype = {name: float(rng.random()) for name in self.model.phenotype_labels}
        spread = rng.uniform(0.15, 0.2)
        local: dict[str, float] = {}
        for name in self.local_names:
            twin = "l-" + name[2:] if name.startswith("r-") else None
            if twin in local:
                value = local[twin] + 0.05 * rng.standard_normal()
            else:
                value = spread * rng.standard_normal()
            if name in ("head-trans-out", "mouth-trans-out", "neck-trans-out", "nose-trans-out"):
                value *= 0.15  # these push a whole part to one side
            local[name] = float(np.clip(value, -1.0, 1.0))
        actions = {}
        for name in rng.choice(self.model.facial_action_labels, rng.integers(0, 4), replace=False):
            strength = float(rng.uniform(0.1, 0.8))
            actions[str(name)] = strength
            if rng.random() < 0.7:  # mostly both sides of a face act together
                other = name.replace("Left", "Right") if "Left" in name else name
                actions[str(other)] = strength
        with torch.no_grad():
            output = self.model(
                pose_parameters=self._pose(rng),
                phenotype_kwargs=phenotype,
                local_changes_kwargs=local,
                facial_actions=actions,
            )
        return np.asarray(output["vertices"][0], dtype=np.float64)

    def _pose(self, rng: np.random.Generator) -> dict[str, torch.Tensor] | None:
        """Turns of the joints, (1, 4, 4) each; a head has none."""
        return None


def self_intersections(vertices: NDArray[np.float64], quads: NDArray[np.int64]) -> int:
    """How many triangles of the split quads cut through others."""
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    meshes = pymeshlab.MeshSet(verbose=False)
    meshes.add_mesh(pymeshlab.Mesh(vertices, triangles.astype(np.int32)))
    meshes.compute_selection_by_self_intersections_per_face()
    return int(meshes.current_mesh().selected_face_number())


def make_set(folder: Path, count: int, maker: HeadMaker) -> None:
    """Write ``count`` people and the split into ``folder``; files that are there are kept."""

    def draw(identity: int) -> Drawn:
        vertices, quads, _ = maker.draw(identity)
        return PERSON, vertices, quads

    write_set(folder, maker.kind, count, draw)


def make_scan(path: Path, seed: int) -> None:
    """One head that no training set of this script holds, as triangles that hide its quads."""
    vertices, quads, _ = HeadMaker(seed).draw(SCAN_IDENTITY, skin_only=False)
    fine = catmull_clark(vertices, quads)
    triangles, _, _ = split_quads(fine.quads, np.random.default_rng(seed))
    mesh = isotropic_remesh(fine.vertices, triangles, SCAN_VERTICES)
    write_obj(path, (PERSON, 10.0 * mesh.vertices, mesh.faces))  # decimetres


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", nargs="?", type=Path, help="where the quad meshes go")
    parser.add_argument("--count", type=int, default=300, help="how many heads (300)")
    parser.add_argument("--seed", type=int, default=0, help="another seed, other people (0)")
    parser.add_argument("--scan", type=Path, help="write one unseen head as triangles here")
    arguments = parser.parse_args()
    if arguments.scan:
        make_scan(arguments.scan, arguments.seed)
    if arguments.folder:
        make_set(arguments.folder, arguments.count, HeadMaker(arguments.seed))
    if not (arguments.scan or arguments.folder):
        parser.error("give a folder, or --scan FILE")


if __name__ == "__main__":
    main()

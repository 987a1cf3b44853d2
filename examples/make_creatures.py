"""Make quad meshes of random creatures and things by box modelling, as training data.

    python examples/make_creatures.py creatures/ --count 300  # creature_0000.obj ... and split.json
    vhquad preprocess creatures/ --out creatures_dataset/
    vhquad train dataset/ creatures_dataset/ --out run/

A creature is drawn by its kind (``creature_kinds.py``: four-legged, upright, bird, fish,
many-legged, plant, hand, pot, swim ring, furniture, or anything), then modelled as artists do
(``box_model.py``): a box of a few dozen quads, faces extruded in segments to limbs, necks, tails,
ears and fins, sunk to eyes, mouths and hollows, bridged to handles, some loops cut in, most of it
mirrored; then Catmull-Clark steps and a smooth deformation. Edge loops hence run round and along
the limbs, with poles at their roots. Draws that cut through themselves too much are drawn again.
``split.json`` puts a fifteenth of them aside for validation and two fifteenths for the test, as
``make_heads.py`` does.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
from box_model import Cage, Model, Unfit
from creature_kinds import KINDS
from creature_parts import Rng
from quad_sets import Drawn, write_set

from vhquad.learn.augment import deform
from vhquad.mesh.intersections import self_intersections
from vhquad.mesh.quad import QuadMesh

MOST_SELF_INTERSECTIONS = 0.004  # pairs of quads, of all quads
LEAST_FACES, MOST_FACES = 40, 420  # of the cage
FINE_CAGE = 260  # faces, above which one Catmull-Clark step may do
COARSE_CAGE = 70  # faces, below which three steps may be taken


def draw(identity: int, seed: int = 0) -> tuple[Model, str]:
    """A creature and its kind: the same for the same identity and seed."""
    rng = np.random.default_rng([seed, identity])
    kind = list(KINDS)[int(rng.choice(len(KINDS), p=list(KINDS.values())))]
    while True:
        try:
            model = draw_kind(rng, kind)
        except Unfit:
            continue
        mesh = QuadMesh(model.vertices, model.quads)
        crossing = len(self_intersections(mesh))
        if mesh.is_manifold and crossing <= MOST_SELF_INTERSECTIONS * mesh.n_quads:
            return model, kind.__name__.replace("_", " ")


def draw_kind(rng: Rng, kind: Callable[[Rng], Cage]) -> Model:
    """A creature of a kind, which may cut through itself; Unfit if it could not be modelled."""
    cage = kind(rng)
    for _ in range(int(rng.integers(0, 4))):
        edges = sorted(cage.edges())
        share = rng.uniform(0.35, 0.65) if rng.random() < 0.8 else rng.uniform(0.1, 0.2)
        cage.cut(edges[int(rng.integers(len(edges)))], share)
    if rng.random() < 0.6:
        cage.even_out(int(rng.integers(1, 9)), rng.uniform(1.4, 2.0))
    if rng.random() < 0.5:
        for _ in range(int(rng.integers(1, 4))):
            cage.relax(rng.uniform(0.1, 0.4))
    count = sum(1 for face in cage.faces if face) * (2 if cage.half else 1)
    if not LEAST_FACES <= count <= MOST_FACES:
        raise Unfit("too simple or too rich")
    levels = 2
    if count > FINE_CAGE and rng.random() < 0.2:
        levels = 1
    elif count < COARSE_CAGE and rng.random() < 0.5:
        levels = 3
    model = cage.finished(levels)
    moved, mate = deform(model.vertices, rng, rng.uniform(0.0, 1.2)), model.mate
    if cage.half and rng.random() < 0.8:
        moved = 0.5 * (moved + moved[mate] * [-1.0, 1.0, 1.0])
    else:
        mate = np.arange(len(moved))
    return Model(2.0 * moved / np.ptp(moved, axis=0).max(), model.quads, mate, model.genus)


def drawn(identity: int, seed: int) -> Drawn:
    """A creature as ``write_set`` takes it."""
    model, kind = draw(identity, seed)
    return f"random {kind}, box modelled", model.vertices, model.quads


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, help="where the quad meshes go")
    parser.add_argument("--count", type=int, default=300, help="how many creatures (300)")
    parser.add_argument("--seed", type=int, default=0, help="another seed, others (0)")
    arguments = parser.parse_args()
    write_set(arguments.folder, "creature", arguments.count, partial(drawn, seed=arguments.seed))


if __name__ == "__main__":
    main()

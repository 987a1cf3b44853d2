"""Make quad meshes of random whole bodies with anny (CC0 shapes), as training data.

    pip install 'vhquad[heads]'
    python examples/make_bodies.py bodies/ --count 200        # body_0000.obj ... and split.json
    vhquad preprocess bodies/ --out bodies_dataset/ --triangulations 3
    vhquad train dataset/ bodies_dataset/ --out run/

A body is drawn like a head (``make_heads.py``), with changes of all its parts, in a pose near the
one that it rests in: each joint of limbs, spine and neck is turned by some ten degrees. Bodies have
eye sockets and a mouth bag; one in three lacks them, so that eyes and mouth are holes.
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import torch
from make_heads import HeadMaker, make_set
from scipy.spatial.transform import Rotation

JOINTS = re.compile(r"^(upperleg01|lowerleg01|upperarm01|lowerarm01|spine0[1-5]|neck01|head)")
TURN = {"upperleg01": 10.0, "lowerleg01": 10.0, "upperarm01": 20.0, "lowerarm01": 20.0}  # degrees
TURN_ELSEWHERE = 5.0


class BodyMaker(HeadMaker):
    """Draws bodies: ``draw(identity)`` gives the same vertices and quads for the same identity."""

    kind = "body"
    most_self_intersections = 500

    model_options: Mapping[str, str] = {"topology": "anny-noeyes-notongue-quads"}
    parts = re.compile("")  # all

    def _pose(self, rng: np.random.Generator) -> dict[str, torch.Tensor]:
        pose = {}
        for bone in self.model.bone_labels:
            if JOINTS.match(bone):
                degrees = TURN.get(bone.split(".")[0], TURN_ELSEWHERE) * rng.standard_normal(3)
                transform = np.eye(4)
                transform[:3, :3] = Rotation.from_rotvec(degrees, degrees=True).as_matrix()
                pose[bone] = torch.as_tensor(transform)[None]
        return pose


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, help="where the quad meshes go")
    parser.add_argument("--count", type=int, default=200, help="how many bodies (200)")
    parser.add_argument("--seed", type=int, default=0, help="another seed, other people (0)")
    arguments = parser.parse_args()
    make_set(arguments.folder, arguments.count, BodyMaker(arguments.seed))


if __name__ == "__main__":
    main()

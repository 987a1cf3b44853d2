"""Kinds of box-modelled creatures and things, and how often each is drawn."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from box_model import Cage, ring
from creature_parts import (
    AHEAD,
    BACK,
    DOWN,
    LEFT,
    UP,
    Rng,
    arch,
    body,
    branch,
    crest,
    cylinder,
    face_parts,
    handle,
    knobs,
    leg,
    limb,
    maybe,
    neck_and_head,
    one_of,
    tail,
)


def quadruped(rng: Rng) -> Cage:
    counts = (int(rng.integers(1, 3)), int(rng.integers(2, 4)), int(rng.integers(3, 8)))
    size = (rng.uniform(0.3, 0.6), rng.uniform(0.35, 0.65), 1.0)
    cage, where = body(rng, True, counts, size, rng.uniform(0.1, 0.7))
    kind = one_of(rng, "face", "edge", "vertex")
    sprawl, long = (rng.uniform(0.7, 2.0), 0.8) if rng.random() < 0.25 else (0.15, 1.0)
    for z in (0.65, -0.65):
        way = [sprawl * rng.uniform(0.5, 1.0), -1.0, rng.uniform(-0.2, 0.2)]
        region = cage.pick(kind, where(0.9, -1.0, z), DOWN + 0.4 * LEFT, off_plane=True)
        leg(rng, cage, region, long * rng.uniform(0.5, 1.6), way)
    y = rng.uniform(-0.2, 0.8)
    kind = one_of(rng, "vertex", "edge", "face", "block")
    region = cage.pick(kind, where(0, y, 1), AHEAD + 0.3 * UP)
    neck = AHEAD + rng.uniform(-0.2, 1.2) * UP
    neck_and_head(rng, cage, region, neck, AHEAD + rng.uniform(-0.5, 0.2) * UP)
    with maybe(cage):
        tail(rng, cage, where)
    if rng.random() < 0.2:
        with maybe(cage):
            crest(rng, cage, where)
    return cage


def upright(rng: Rng) -> Cage:
    """Standing on two legs: here z is up and -y to the front."""
    counts = (int(rng.integers(1, 3)), int(rng.integers(2, 4)), int(rng.integers(3, 6)))
    size = (rng.uniform(0.35, 0.7), rng.uniform(0.3, 0.65), rng.uniform(0.6, 1.0))
    cage, where = body(rng, True, counts, size, rng.uniform(0.1, 0.8), wave=0.25)
    kind = one_of(rng, "face", "edge", "vertex")
    region = cage.pick(kind, where(0.6, 0, -1), BACK + 0.3 * LEFT, off_plane=True)
    long = rng.uniform(0.4, 1.6)
    leg(rng, cage, region, long, [rng.uniform(0.0, 0.5), rng.uniform(-0.3, 0.1), -1.0])
    out = [1.0, rng.uniform(-0.8, 0.2), rng.uniform(-1.2, 0.6)]
    with maybe(cage):
        kind = one_of(rng, "face", "edge", "vertex")
        region = cage.pick(kind, where(1, 0, 0.65), LEFT + 0.2 * AHEAD, off_plane=True)
        leg(rng, cage, region, rng.uniform(0.4, 1.4), out)
    region = cage.pick(one_of(rng, "vertex", "edge", "block"), where(0, 0, 1), AHEAD)
    neck_and_head(rng, cage, region, AHEAD, [0, rng.uniform(-1.5, -0.2), rng.uniform(0.1, 1.0)])
    if rng.random() < 0.5:
        ways = [UP - 0.4 * AHEAD, UP + rng.uniform(-0.6, 0.8) * AHEAD]
        with maybe(cage):
            kind = one_of(rng, "face", "edge", "vertex")
            region = cage.pick(kind, where(0, 1, -0.7), UP - 0.5 * AHEAD, None, False)
            long, n = rng.uniform(0.3, 1.5), int(rng.integers(2, 7))
            limb(rng, cage, region, long, ways, n, (0.8, rng.uniform(0.2, 0.6)))
    return cage


def bird(rng: Rng) -> Cage:
    counts = (int(rng.integers(1, 3)), 2, int(rng.integers(3, 6)))
    size = (rng.uniform(0.3, 0.5), rng.uniform(0.3, 0.55), rng.uniform(0.6, 1.0))
    cage, where = body(rng, True, counts, size, rng.uniform(0.3, 0.9))
    ways = [LEFT + 0.2 * UP, LEFT + rng.uniform(-0.6, 0.8) * UP + rng.uniform(-1.0, 0.2) * AHEAD]
    kind = one_of(rng, "edge", "vertex", "face")
    wing = cage.pick(kind, where(1, 0.2, 0.2), LEFT + 0.2 * UP, off_plane=True)
    long, n = rng.uniform(0.5, 1.8), int(rng.integers(2, 7))
    ends, bulge = (rng.uniform(0.8, 1.3), rng.uniform(0.3, 1.0)), rng.uniform(0.0, 0.6)
    limb(rng, cage, wing, long, ways, n, ends, bulge, (UP, rng.uniform(0.15, 0.45)))
    region = cage.pick(
        one_of(rng, "vertex", "edge", "face"), where(0, 0.2, -1), BACK, off_plane=False
    )
    long, way = rng.uniform(0.2, 0.9), BACK + rng.uniform(-0.3, 0.6) * UP
    n, ends = int(rng.integers(1, 5)), (0.8, rng.uniform(0.6, 1.8))
    limb(rng, cage, region, long, [way], n, ends, thin=(UP, rng.uniform(0.2, 0.5)))
    if rng.random() < 0.7:
        with maybe(cage):
            down = DOWN + 0.1 * LEFT
            region = cage.pick("face", where(0.5, -1, -0.1), down, off_plane=True)
            leg(rng, cage, region, rng.uniform(0.3, 0.8), down)
    kind = one_of(rng, "vertex", "edge", "block")
    region = cage.pick(kind, where(0, 0.5, 1), AHEAD + 0.3 * UP)
    neck_and_head(rng, cage, region, AHEAD + rng.uniform(0.2, 1.5) * UP, AHEAD - 0.1 * UP)
    return cage


def fish(rng: Rng) -> Cage:
    counts = (int(rng.integers(1, 3)), int(rng.integers(2, 5)), int(rng.integers(5, 9)))
    size = (rng.uniform(0.12, 0.4), rng.uniform(0.25, 0.6), 1.0)
    cage, where = body(rng, True, counts, size, rng.uniform(0.4, 0.95), bend=0.1)
    base = list(range(len(cage.faces)))
    region = cage.pick(one_of(rng, "vertex", "edge"), where(0, 0, -1), BACK, off_plane=False)
    long, n = rng.uniform(0.1, 0.5), int(rng.integers(1, 4))
    stem = limb(rng, cage, region, long, [BACK], n, (0.7, rng.uniform(0.3, 0.6)), tip="flat")
    if rng.random() < 0.7:  # a forked fin
        last = stem.rings[-1]
        cage.taken -= set(last)
        for side in (UP, DOWN):
            way = side - rng.uniform(0.3, 1.5) * AHEAD
            with maybe(cage):
                region = cage.pick("face", cage.centre(stem.cap) + 0.2 * side, side, last, False)
                long, n = rng.uniform(0.2, 0.6), int(rng.integers(2, 5))
                limb(rng, cage, region, long, [way], n, (0.9, 0.5), thin=(LEFT, 0.5))
    else:
        cage.taken -= set(stem.cap)
        long, n = rng.uniform(0.2, 0.5), int(rng.integers(2, 5))
        ends = (1.3, rng.uniform(1.5, 2.5))
        limb(rng, cage, stem.cap, long, [BACK], n, ends, thin=(LEFT, 0.25))
    with maybe(cage):
        crest(rng, cage, where)
    for z, y in ((0.4, -0.3), (-0.3, -0.6)):
        if rng.random() < 0.7:
            out = [1.0, rng.uniform(-0.8, 0.2), rng.uniform(-1.2, -0.2)]
            with maybe(cage):
                kind = one_of(rng, "face", "edge")
                region = cage.pick(kind, where(1, y, z), LEFT + y * UP, off_plane=True)
                long, n = rng.uniform(0.2, 0.8), int(rng.integers(2, 5))
                ends = (0.9, rng.uniform(0.4, 1.0))
                limb(rng, cage, region, long, [out], n, ends, thin=(UP, rng.uniform(0.15, 0.4)))
    free = set(cage.free())
    face_parts(rng, cage, [f for f in base if f in free and cage.centre([f])[2] > 0.4], AHEAD)
    return cage


def many_legged(rng: Rng) -> Cage:
    """Insects, spiders, caterpillars."""
    pairs = int(rng.integers(3, 6))
    counts = (int(rng.integers(1, 3)), 2, int(rng.integers(pairs, pairs + 4)))
    size = (rng.uniform(0.25, 0.6), rng.uniform(0.2, 0.5), 1.0)
    cage, where = body(rng, True, counts, size, rng.uniform(0.1, 0.8), wave=0.25)
    long = rng.uniform(0.3, 1.3)
    n = int(rng.integers(2, 6))
    for z in np.linspace(-0.75, 0.75, pairs):
        ways = [[1.0, rng.uniform(0.0, 0.8), 0.8 * z], [1.0, -1.0, 0.8 * z], [0.3, -1.0, 0.5 * z]]
        with maybe(cage):
            region = cage.pick("face", where(1, -0.4, z), LEFT - 0.3 * UP, off_plane=True)
            reach = long * rng.uniform(0.8, 1.2)
            limb(rng, cage, region, reach, ways, n, (0.6, rng.uniform(0.2, 0.5)))
    region = cage.pick(one_of(rng, "vertex", "edge", "block"), where(0, 0, 1), AHEAD)
    neck_and_head(rng, cage, region, AHEAD + 0.2 * UP, AHEAD)
    if rng.random() < 0.4:
        with maybe(cage):
            tail(rng, cage, where)
    return cage


def plant(rng: Rng) -> Cage:
    """A cactus, a tree or a coral: a column along z with branches that turn up."""
    n = int(rng.integers(1, 3))
    counts = (n, n, int(rng.integers(4, 8)))
    thick = rng.uniform(0.15, 0.4)
    cage, where = body(rng, False, counts, (thick, thick, 1.0), rng.uniform(0.0, 0.7))
    rise = rng.uniform(-0.5, 1.0)
    for _ in range(int(rng.integers(2, 6))):
        a = rng.uniform(0.0, 2.0 * np.pi)
        out = np.array([np.cos(a), np.sin(a), 0.0])
        place = where(*(out / np.abs(out).max())[:2], rng.uniform(-0.6, 0.9))
        ways = [out, out + rise * AHEAD, 0.3 * out + (rise + 0.3) * AHEAD]
        with maybe(cage):
            branch(rng, cage, place, out, ways)
    return cage


def hand(rng: Rng) -> Cage:
    """A hand, a paw or a glove: fingers at one end of a slab, one at its side."""
    fingers = int(rng.integers(2, 6))
    counts = (fingers, int(rng.integers(1, 3)), int(rng.integers(2, 5)))
    size = (rng.uniform(0.12, 0.22) * fingers, rng.uniform(0.15, 0.3), rng.uniform(0.4, 0.9))
    cage, where = body(rng, False, counts, size, rng.uniform(0.0, 0.3), bend=0.15)
    kind = "face" if counts[1] == 1 else "edge"
    spread, curl = rng.uniform(0.0, 0.5), rng.uniform(-0.8, 0.3)
    long = rng.uniform(0.4, 1.0)
    for x in (np.arange(fingers) + 0.5) / fingers * 2.0 - 1.0:
        ways = [[spread * x, 0, 1.0], [spread * x, curl, 1.0], [spread * x, 2 * curl, 0.7]]
        with maybe(cage):
            region = cage.pick(kind, where(x, 0, 1), AHEAD)
            reach, n = long * (1.0 - 0.25 * x * x) * rng.uniform(0.8, 1.2), int(rng.integers(2, 6))
            ends, tip = (0.8, rng.uniform(0.5, 0.9)), one_of(rng, "round", "flat", "point")
            limb(rng, cage, region, reach, ways, n, ends, tip=tip)
    if rng.random() < 0.8:
        with maybe(cage):
            region = cage.pick(one_of(rng, "face", "edge"), where(1, 0, -0.3), LEFT)
            ways, n = [[1.0, 0, 0.4], [0.5, curl, 1.0]], int(rng.integers(2, 5))
            limb(rng, cage, region, 0.7 * long, ways, n, (0.9, 0.7))
    if rng.random() < 0.6:  # an arm
        low = [f for f in cage.free() if cage.normal([f])[2] < -0.8]
        with maybe(cage):
            reach, n = rng.uniform(0.2, 1.0), int(rng.integers(1, 5))
            limb(rng, cage, low, reach, [BACK], n, (0.8, rng.uniform(0.6, 1.1)), tip="flat")
    return cage


def pot(rng: Rng) -> Cage:
    """A pot, mug, jug or teapot along z, with a handle in the mirror plane or two at its sides."""
    n = int(rng.integers(1, 3))
    counts = (n, 2 * n, int(rng.integers(3, 7)))
    r = rng.uniform(0.4, 1.0)
    cage, where = body(rng, True, counts, (r, r, 1.0), rng.uniform(0.3, 0.8), 0.25, 0.0)
    cylinder(cage, rng.uniform(0.6, 1.0))
    if rng.random() < 0.75:
        with maybe(cage):
            handle(rng, cage, where, DOWN)
    elif rng.random() < 0.7:
        with maybe(cage):
            handle(rng, cage, where, LEFT)
    if rng.random() < 0.6:  # a spout
        rise = rng.uniform(0.3, 1.5)
        with maybe(cage):
            kind, z = one_of(rng, "vertex", "edge", "face"), rng.uniform(-0.4, 0.3)
            region = cage.pick(kind, where(0, 1, z), UP, off_plane=False)
            long, ways = rng.uniform(0.5, 1.2), [[0, 1.0, 0.2], [0, 0.6, rise], [0, 1.0, rise]]
            n, ends = int(rng.integers(2, 6)), (0.8, rng.uniform(0.25, 0.6))
            limb(rng, cage, region, long, ways, n, ends, tip="flat")
    top = [f for f in cage.free() if cage.normal([f])[2] > 0.8 and cage.centre([f])[2] > 0.5]
    if top and rng.random() < 0.6:  # hollow
        n = int(rng.integers(2, 5))
        deep = np.concatenate([[0.0], np.linspace(0.2, rng.uniform(0.5, 1.4), n)])
        with maybe(cage):
            cage.sink(top, deep, np.full(n + 1, rng.uniform(0.75, 0.9)))
    elif top:  # a lid and its knob
        with maybe(cage):
            cage.sink(top, [0.0, -0.1, -0.15, -0.3, -0.4], [0.8, 0.5, 0.15, 0.3, 0.2])
    return cage


def swim_ring(rng: Rng) -> Cage:
    """A ring with a head, or with knobs."""
    section = int(rng.integers(4, 9))
    half = rng.random() < 0.8
    around = int(rng.integers(4, 8)) * (1 if half else 2)
    wide = rng.uniform(1.6, 3.0)
    cage = ring(around, section, half, wide)
    squash = rng.uniform(0.6, 1.5)
    for v in cage.vertices:
        v[1] *= squash
    front = np.array([0.0, squash, wide])
    if half and rng.random() < 0.8:
        kind = one_of(rng, "vertex", "edge")
        region = cage.pick(kind, front, UP + 0.3 * AHEAD, off_plane=False)
        neck_and_head(rng, cage, region, UP + 0.2 * AHEAD, AHEAD + 0.2 * UP)
        if rng.random() < 0.7:
            with maybe(cage):
                kind, place = one_of(rng, "face", "edge", "vertex"), np.array([0.0, squash, -wide])
                region = cage.pick(kind, place, BACK + 0.5 * UP, off_plane=False)
                long, n = rng.uniform(0.5, 1.5), int(rng.integers(1, 4))
                limb(rng, cage, region, long, [UP - 0.6 * AHEAD], n, (0.8, 0.4))
    else:
        knobs(rng, cage, int(rng.integers(1, 5)))
    return cage


def furniture(rng: Rng) -> Cage:
    """A slab with legs, perhaps a back, perhaps rails between the legs."""
    counts = (int(rng.integers(2, 4)), int(rng.integers(1, 3)), int(rng.integers(3, 6)))
    size = (rng.uniform(0.4, 1.0), rng.uniform(0.08, 0.3), 1.0)
    cage, where = body(rng, True, counts, size, rng.uniform(0.0, 0.2), 0.05, 0.05)
    legs = []
    for z in (0.9, -0.9):
        region = cage.pick("face", where(0.9, -1, z), DOWN, off_plane=True)
        n, long = int(rng.integers(2, 5)), rng.uniform(0.5, 1.4)
        ends, tip = (rng.uniform(0.6, 0.9), rng.uniform(0.4, 0.8)), one_of(rng, "flat", "round")
        made = limb(rng, cage, region, long, [[0.1, -1.0, 0.1 * z]], n, ends, tip=tip)
        legs.append([f for faces in made.rings[:n] for f in faces])
    if rng.random() < 0.5:
        cage.taken -= {f for faces in legs for f in faces}
        with maybe(cage):
            one = cage.pick("face", cage.centre(legs[0]), BACK, legs[0], True)
            other = cage.pick("face", cage.centre(legs[1]), AHEAD, legs[1], True)
            arch(rng, cage, one, other, np.zeros(3), 0.05)
    if rng.random() < 0.7:
        row = [f for f in cage.free() if cage.normal([f])[1] > 0.8 and cage.centre([f])[2] < -0.4]
        with maybe(cage):
            long, way = rng.uniform(0.4, 1.2), UP + rng.uniform(-0.4, 0) * AHEAD
            n, ends = int(rng.integers(2, 5)), (0.95, rng.uniform(0.7, 1.0))
            limb(rng, cage, row, long, [way], n, ends, tip="flat")
    if rng.random() < 0.3:
        knobs(rng, cage, 2)
    return cage


def anything(rng: Rng) -> Cage:
    """A box with limbs anywhere."""
    half = rng.random() < 0.6
    n = rng.integers(1, 5, 3)
    counts = (int(max(1, n[0] // 2)) if half else int(n[0]), int(n[1]), int(n[2]))
    x, y, z = rng.uniform(0.4, 1.0, 3)
    cage, _ = body(rng, half, counts, (x, y, z), rng.uniform(0.0, 0.9))
    knobs(rng, cage, int(rng.integers(2, 7)))
    return cage


KINDS: dict[Callable[[Rng], Cage], float] = {
    quadruped: 0.22,
    upright: 0.16,
    bird: 0.1,
    fish: 0.1,
    many_legged: 0.07,
    plant: 0.06,
    hand: 0.05,
    pot: 0.08,
    swim_ring: 0.05,
    furniture: 0.03,
    anything: 0.08,
}

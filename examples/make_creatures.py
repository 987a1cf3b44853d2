"""Make quad meshes of random creatures and things by box modelling, as training data.

    python examples/make_creatures.py creatures/ --count 300  # creature_0000.obj ... and split.json
    vhquad preprocess creatures/ --out creatures_dataset/
    vhquad train dataset/ creatures_dataset/ --out run/

A creature is drawn by its kind (four-legged, upright, bird, fish, many-legged, plant, hand, pot,
swim ring, furniture, or anything), then modelled as artists do (``box_model.py``): a box of a few
dozen quads, faces extruded in segments to limbs, necks, tails, ears and fins, sunk to eyes, mouths
and hollows, bridged to handles, some loops cut in, most of it mirrored; then Catmull-Clark steps
and a smooth deformation. Edge loops hence run round and along the limbs, with poles at their roots.
Draws that cut through themselves too much are drawn again. ``split.json`` puts a fifteenth of them
aside for validation and two fifteenths for the test, as ``make_heads.py`` does.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path

import numpy as np
from box_model import Cage, Limb, Model, Unfit, box, ring
from numpy.typing import ArrayLike, NDArray
from quad_sets import Drawn, write_set

from vhquad.learn.augment import deform
from vhquad.mesh.intersections import self_intersections
from vhquad.mesh.quad import QuadMesh

Floats = NDArray[np.float64]
Rng = np.random.Generator
Where = Callable[..., Floats]

MOST_SELF_INTERSECTIONS = 0.004  # pairs of quads, of all quads
LEAST_FACES, MOST_FACES = 40, 420  # of the cage
FINE_CAGE = 260  # faces, above which one Catmull-Clark step may do
COARSE_CAGE = 70  # faces, below which three steps may be taken

LEFT, UP, AHEAD = np.eye(3)  # LEFT: of the plane, on the side that is modelled
BACK, DOWN = -AHEAD, -UP


# ---- bodies -------------------------------------------------------------------------------------


def body(
    rng: Rng,
    half: bool,
    counts: tuple[int, int, int],
    size: tuple[float, float, float],
    rounding: float,
    wave: float = 0.15,
    bend: float = 0.2,
) -> tuple[Cage, Where]:
    """A box along z, its cross-sections scaled and shifted smoothly; x is across, y up, z forward.

    Also gives the map from [-1, 1]^3 to space, to name places on it.
    """
    cage = box(counts, half)
    amplitude = wave * rng.standard_normal(3)
    phase = rng.uniform(0.0, 2.0 * np.pi, 3)
    arch, tilt = bend * rng.standard_normal(2)
    sway = 0.0 if half else bend * rng.standard_normal()
    uneven = rng.uniform(0.75, 1.3)

    def where(*place: float) -> Floats:
        u = np.array(place)
        u[2] = np.sign(u[2]) * np.abs(u[2]) ** uneven
        largest = np.abs(u).max()
        q = (1.0 - rounding) * u + rounding * largest * u / max(float(np.linalg.norm(u)), 1e-9)
        z = q[2]
        k = np.array([0.7, 1.3, 2.1])
        s = float(np.exp((amplitude * np.cos(np.pi * k * z + phase)).sum()))
        return np.array(
            [
                size[0] * s * q[0] + sway * size[2] * z * z,
                size[1] * s * q[1] + size[2] * (arch * z * z + 0.5 * tilt * z),
                size[2] * z,
            ]
        )

    for v, position in enumerate(cage.vertices):
        cage.vertices[v] = where(*position)
    return cage, where


def cylinder(cage: Cage, share: float) -> None:
    """Make the cross-sections of a body along z rounder."""
    for v in cage.vertices:
        flat = float(np.hypot(v[0], v[1]))
        if flat > 0:
            v[:2] *= 1.0 - share * (1.0 - float(np.abs(v[:2]).max()) / flat)


# ---- parts --------------------------------------------------------------------------------------


@contextmanager
def maybe(cage: Cage) -> Iterator[None]:
    """Leave the cage as it was if what is added does not fit."""
    before = cage.copy()
    try:
        yield
    except Unfit:
        cage.__dict__.update(before.__dict__)


def one_of(rng: Rng, *names: str) -> str:
    return str(rng.choice(names))


def limb(
    rng: Rng,
    cage: Cage,
    region: Sequence[int],
    length: float,
    ways: Sequence[ArrayLike],
    segments: int,
    ends: tuple[float, float],
    bulge: float = 0.0,
    thin: tuple[Floats, float] | None = None,
    tip: str = "any",
    twist: float = 0.0,
) -> Limb:
    """Extrude a region; its direction follows ``ways`` from the root to the tip.

    ``ends`` are the sizes of the first and the last ring, ``bulge`` is what the middle has more.
    """
    key = np.linspace(0.0, 1.0, len(ways) + 1)
    path = np.array([cage.normal(region), *[np.asarray(way, dtype=float) for way in ways]])
    path[1:] /= np.linalg.norm(path[1:], axis=1)[:, None]
    if cage.on_plane(region):
        path[:, 0] = 0.0
    t = (np.arange(segments) + 0.5) / segments
    steps = np.stack([np.interp(t, key, path[:, k]) for k in range(3)], axis=1)
    steps /= np.maximum(np.linalg.norm(steps, axis=1), 1e-9)[:, None]
    share = np.exp(0.15 * rng.standard_normal(segments))
    spine = cage.centre(region) + np.cumsum(steps * (length * share / share.sum())[:, None], axis=0)
    t = np.linspace(0.0, 1.0, segments)
    scales = ends[0] + (ends[1] - ends[0]) * t ** rng.uniform(0.7, 1.3)
    scales = scales * (1.0 + bulge * np.sin(np.pi * t))
    scales = scales * np.exp(0.04 * rng.standard_normal(segments))
    made = cage.sweep(region, spine, scales, rng.uniform(0.4, 1.0), thin, twist)
    kind = one_of(rng, "flat", "flat", "round", "point") if tip == "any" else tip
    if kind == "point" and segments > 1:
        cage.close_to_point(made)
    elif kind == "round":
        made.rings += cage.sink(made.cap, np.array([-0.35 * cage.radius(made.cap)]), [0.6]).rings
    return made


def leg(rng: Rng, cage: Cage, region: Sequence[int], length: float, down: ArrayLike) -> None:
    """A leg or an arm, perhaps bent at the knee, perhaps with a foot or toes."""
    d = np.asarray(down, dtype=float)
    knee = (rng.uniform(-0.6, 0.6) if rng.random() < 0.6 else 0.0) * AHEAD
    slim = rng.uniform(0.45, 0.95)
    segments = int(rng.integers(2, 7))
    foot = rng.random()
    ends = (slim, slim * rng.uniform(0.45, 1.05))
    bulge = rng.uniform(-0.2, 0.3)
    tip = "flat" if foot < 0.6 else "any"
    made = limb(
        rng, cage, region, length, [d, d + knee, d - knee, d], segments, ends, bulge, tip=tip
    )
    if foot < 0.35:
        long = cage.radius(made.cap) * rng.uniform(1.0, 3.0)
        with maybe(cage):
            last = made.rings[-1]
            cage.taken -= set(last)
            toe = cage.pick(one_of(rng, "face", "edge"), cage.centre(made.cap), AHEAD, last)
            limb(rng, cage, toe, long, [AHEAD - 0.2 * UP], int(rng.integers(1, 4)), (1.0, 0.8))
    elif foot < 0.6:
        cage.taken -= set(made.cap)
        for f in list(made.cap):
            long = cage.radius(made.cap) * rng.uniform(0.8, 2.5)
            way = d + 0.3 * rng.standard_normal(3) + 0.6 * AHEAD
            with maybe(cage):
                limb(rng, cage, [f], long, [way], int(rng.integers(1, 4)), (0.8, 0.5))


def eye(cage: Cage, region: Sequence[int], rim: float, deep: float) -> None:
    """An inset, and in it another that is sunk (or raised, if ``deep`` is negative)."""
    r = cage.radius(region)
    cage.sink(region, [0.0, deep * r, deep * r], [rim, 0.85 * rim, 0.45 * rim])


def face_parts(rng: Rng, cage: Cage, head: Sequence[int], ahead: ArrayLike) -> None:
    """Snout or beak, ears, horns, eyes and mouth on the faces of a head."""
    cage.taken -= set(head)
    front = np.asarray(ahead, dtype=float)
    front /= np.linalg.norm(front)
    up = UP if abs(front[1]) < 0.8 else BACK
    up = up - (up @ front) * front
    up /= np.linalg.norm(up)
    points = np.array([cage.vertices[v] for v in cage.corners([f for f in head if cage.faces[f]])])
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    r = 0.5 * float(np.ptp(points, axis=0).mean())

    def at(x: float, y: float, z: float) -> Floats:
        return np.asarray(middle + r * (x * LEFT + y * up + z * front))

    if rng.random() < 0.7:
        beak = rng.random() < 0.3
        kind = one_of(rng, "vertex", "edge", "face", "block")
        ends = (0.75, 0.4) if beak else (rng.uniform(0.6, 1.0), rng.uniform(0.5, 1.0))
        way = front - rng.uniform(0.0, 0.4) * up
        with maybe(cage):
            region = cage.pick(kind, at(0, -0.3, 0.9), front, head)
            long, n = r * rng.uniform(0.3, 1.2), int(rng.integers(1, 4))
            limb(rng, cage, region, long, [way], n, ends, tip="point" if beak else "any")
    for pair in range(int(rng.integers(0, 3))):  # ears, then horns
        x, z = rng.uniform(0.3, 0.9), rng.uniform(-0.7, 0.4)
        out = (x + 0.2) * LEFT + rng.uniform(0.3, 1.2) * up + z * front * 0.5
        kind = one_of(rng, "face", "face", "edge", "vertex")
        thin = (front, rng.uniform(0.2, 0.6)) if pair == 0 and rng.random() < 0.7 else None
        long, end = r * rng.uniform(0.4, 1.8), rng.uniform(0.2, 1.0)
        with maybe(cage):
            region = cage.pick(kind, at(x, 0.8, z), out, head, True)
            ways = [out, out + 0.5 * rng.standard_normal(3)]
            n = int(rng.integers(1, 5))
            limb(rng, cage, region, long, ways, n, (0.8, end), rng.uniform(0.0, 0.5), thin)
    if rng.random() < 0.6:  # eyes
        out = 0.8 * LEFT + 0.5 * front + 0.2 * up
        deep, rim = rng.uniform(-0.5, 0.5), rng.uniform(0.5, 0.8)
        with maybe(cage):
            kind = one_of(rng, "face", "face", "vertex")
            eye(cage, cage.pick(kind, at(0.6, 0.25, 0.5), out, head, True), rim, deep)
    if rng.random() < 0.5:  # mouth
        deep = rng.uniform(0.2, 1.0)
        with maybe(cage):
            kind = one_of(rng, "face", "edge", "vertex")
            region = cage.pick(kind, at(0, -0.4, 0.9), front - 0.3 * up, head, False)
            eye(cage, region, rng.uniform(0.6, 0.85), deep)


def neck_and_head(
    rng: Rng, cage: Cage, region: Sequence[int], way: ArrayLike, ahead: ArrayLike
) -> None:
    """A neck (perhaps none), a head that swells and narrows, and what belongs on it."""
    w, a = np.asarray(way, dtype=float), np.asarray(ahead, dtype=float)
    big = float(np.ptp(np.array(cage.vertices), axis=0).max())
    slim = rng.uniform(0.5, 0.9)
    if rng.random() < 0.75:
        long, n = big * rng.uniform(0.08, 0.4), int(rng.integers(1, 5))
        region = limb(
            rng, cage, region, long, [w], n, (rng.uniform(0.7, 1.0), slim), tip="flat"
        ).cap
    r = cage.radius(region)
    swell = rng.uniform(1.2, 2.2)
    n = int(rng.integers(3, 6))
    t = np.linspace(0.15, 1.0, n)
    scales = 1.0 + (swell - 1.0) * np.sin(np.pi * t) ** rng.uniform(0.4, 1.0)
    scales[-1] = rng.uniform(0.5, 0.9)
    heading = np.array([(1 - s) * w / np.linalg.norm(w) + s * a / np.linalg.norm(a) for s in t])
    if cage.on_plane(region):
        heading[:, 0] = 0.0
    heading /= np.linalg.norm(heading, axis=1)[:, None]
    long = 2.0 * swell * r * rng.uniform(0.8, 1.5)
    spine = cage.centre(region) + np.cumsum(heading * (long / n), axis=0)
    face_parts(rng, cage, cage.sweep(region, spine, scales, 0.8).faces, ahead)


def tail(rng: Rng, cage: Cage, where: Where) -> None:
    kind = one_of(rng, "face", "edge", "vertex")
    region = cage.pick(kind, where(0, 0.6, -1), BACK + 0.2 * UP, None, False)
    ways = [BACK + rng.uniform(-0.8, 0.8) * UP, BACK + rng.uniform(-1.2, 1.2) * UP]
    long, n = rng.uniform(0.3, 2.0), int(rng.integers(2, 8))
    ends = (rng.uniform(0.5, 1.0), rng.uniform(0.15, 0.8))
    limb(rng, cage, region, long, ways, n, ends, rng.uniform(-0.2, 0.6))


def crest(rng: Rng, cage: Cage, where: Where) -> None:
    """A fin or a hump on the back."""
    kind = one_of(rng, "edge", "vertex", "face")
    region = cage.pick(kind, where(0, 1, rng.uniform(-0.4, 0.4)), UP, None, False)
    thin = (LEFT, rng.uniform(0.2, 0.9))
    long, way = rng.uniform(0.15, 0.6), UP + rng.uniform(-1.0, 0.3) * AHEAD
    n, ends = int(rng.integers(1, 4)), (0.9, rng.uniform(0.3, 0.9))
    limb(rng, cage, region, long, [way], n, ends, thin=thin)


def branch(rng: Rng, cage: Cage, place: Floats, out: Floats, ways: Sequence[Floats]) -> None:
    """A branch, perhaps with one of its own."""
    region = cage.pick(one_of(rng, "face", "face", "edge", "vertex"), place, out)
    long, n = rng.uniform(0.4, 1.1), int(rng.integers(3, 6))
    ends, twist = (rng.uniform(0.7, 1.0), rng.uniform(0.4, 1.0)), 0.5 * rng.standard_normal()
    made = limb(rng, cage, region, long, ways, n, ends, tip="flat", twist=twist)
    if rng.random() < 0.4:
        cage.taken -= {f for faces in made.rings for f in faces}
        way = out + np.cross(out, AHEAD) * rng.choice([-1.0, 1.0])
        within = [f for faces in made.rings[1:] for f in faces]
        with maybe(cage):
            region = cage.pick("face", cage.centre(made.rings[-1]), way, within)
            long, n = rng.uniform(0.2, 0.6), int(rng.integers(2, 5))
            limb(rng, cage, region, long, [way, way + 0.5 * AHEAD], n, (0.8, 0.5))


def arch(
    rng: Rng, cage: Cage, one: Sequence[int], other: Sequence[int], out: Floats, reach: float
) -> None:
    """Bridge two regions by an arch that stands out by ``reach``."""
    a, b = cage.centre(one), cage.centre(other)
    p, q = a + reach * (out + cage.normal(one)), b + reach * (out + cage.normal(other))
    n = int(rng.integers(3, 7))
    t = (np.arange(1, n + 1) / (n + 1))[:, None]
    spine = (1 - t) ** 3 * a + 3 * t * (1 - t) ** 2 * p + 3 * t**2 * (1 - t) * q + t**3 * b
    cage.bridge(one, other, spine, np.full(n, rng.uniform(0.5, 0.85)))


def handle(rng: Rng, cage: Cage, where: Where, out: Floats) -> None:
    """A handle from below to above on the side ``out`` of a body."""
    kind = one_of(rng, "face", "face", "edge")
    free = [f for f in range(len(cage.faces)) if cage.faces[f] and cage.normal([f]) @ out > 0.3]
    ends = []
    for z in (0.6, -0.6):
        region = cage.pick(kind, where(out[0], out[1], z), out, free, off_plane=out[0] != 0.0)
        near = set(cage.corners(region))
        free = [f for f in free if not near & set(cage.faces[f])]
        ends.append(region)
    arch(rng, cage, ends[0], ends[1], out, rng.uniform(0.3, 0.9))


def knobs(rng: Rng, cage: Cage, count: int) -> None:
    """Limbs and sockets of all sorts anywhere that is free."""
    for _ in range(count):
        free = cage.free()
        if not free:
            return
        d = rng.standard_normal(3)
        if cage.half:
            d[0] = abs(d[0])
        d /= np.linalg.norm(d)
        place = cage.centre(free) + d
        kind = one_of(rng, "face", "edge", "vertex", "block")
        thin = (rng.standard_normal(3), rng.uniform(0.3, 0.8)) if rng.random() < 0.3 else None
        if rng.random() < 0.2:
            rim, deep = rng.uniform(0.5, 0.85), rng.uniform(-0.8, 0.8)
            with maybe(cage):
                eye(cage, cage.pick(kind, place, d), rim, deep)
            continue
        with maybe(cage):
            region = cage.pick(kind, place, d)
            long, ways = rng.uniform(0.3, 1.6), [d, d + 0.6 * rng.standard_normal(3)]
            n, ends = int(rng.integers(1, 6)), (rng.uniform(0.6, 1.0), rng.uniform(0.3, 1.2))
            bulge, twist = rng.uniform(-0.2, 0.5), 0.5 * rng.standard_normal()
            limb(rng, cage, region, long, ways, n, ends, bulge, thin, twist=twist)


# ---- kinds of creatures -------------------------------------------------------------------------


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


# ---- drawing ------------------------------------------------------------------------------------


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

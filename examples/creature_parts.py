"""Parts that box-modelled creatures are put together from: bodies, limbs, faces, tails, handles.

Each function changes a :class:`box_model.Cage`; chance decides how.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

import numpy as np
from box_model import Cage, Limb, Unfit, box
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]
Rng = np.random.Generator
Where = Callable[..., Floats]
"""Map from [-1, 1]^3 to space, to name places on a body."""

LEFT, UP, AHEAD = np.eye(3)  # LEFT: of the plane, on the side that is modelled
BACK, DOWN = -AHEAD, -UP


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

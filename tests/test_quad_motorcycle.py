"""Tracks: as many as the field has quads around each vertex, none through another, all end."""

from __future__ import annotations

from collections import Counter, defaultdict
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.map_stages import NAMES, Stages, made, noisy, stages
from tests.meshes import icosphere
from vhquad.errors import ParametrizationError
from vhquad.quad.motorcycle import Step, Track, trace


def check_ports(s: Stages) -> None:
    """Spokes of every special vertex: quads of its sectors, in order, gaps of a quarter."""
    aligned, mesh = s.aligned, s.aligned.mesh
    tracks = s.tracing.tracks
    assert set(s.tracing.ports) == set(np.flatnonzero(s.tracing.special).tolist())
    started = Counter(track.vertex for track in tracks)
    feature_spokes = np.bincount(mesh.tail[aligned.feature], minlength=mesh.n_vertices)
    for v, ports in s.tracing.ports.items():
        sectors = aligned.sector_vertex == v
        quads = int(aligned.sector_quads[sectors].sum())
        inner = aligned.sector_is_feature[sectors]
        # A sector of k quads between features has k - 1 tracks inside, a full fan has k.
        assert started[v] == quads - int(inner.sum())
        own = [p.track for p in ports if p.track >= 0]
        assert sorted(own) == [t for t, track in enumerate(tracks) if track.vertex == v]
        arrives = sum(p.track < 0 and p.halfedge < 0 for p in ports)
        assert arrives == int(mesh.is_boundary_vertex[v])
        assert len(ports) == started[v] + feature_spokes[v] + arrives
        assert sum(p.gap for p in ports) == quads


def check_paths(s: Stages) -> None:
    """Steps follow each other over edges, and each track ends on what its hit names."""
    mesh, m, tracks = s.aligned.mesh, s.seamless, s.tracing.tracks
    for number, track in enumerate(tracks):
        assert track.hit is not None
        assert track.length > 0
        first = track.steps[0]
        assert track.vertex in mesh.faces[first.face]
        for here, there in zip(track.steps[:-1], track.steps[1:], strict=True):
            h = int(mesh.twin[there.enter])
            assert (h // 3, there.enter // 3) == (here.face, there.face)
            # the chart's transition carries direction and level
            assert (here.direction + m.rotation[h]) % 4 == there.direction
            assert here.stop is None
            assert not s.aligned.feature[h]
        last = track.steps[-1]
        if track.hit.kind == "track":
            wall = tracks[track.hit.other].steps[track.hit.step]
            assert wall.face == last.face
            assert (wall.direction - last.direction) % 2 == 1
            assert (wall.level, last.level) == (last.stop, track.hit.coordinate)
        elif track.hit.kind == "feature":
            assert s.aligned.feature[track.hit.other]
            assert track.hit.other // 3 == last.face
            assert 0 < track.hit.coordinate < 1
        else:
            back = tracks[track.hit.other].hit
            assert back is not None
            assert (back.kind, back.other) == ("meet", number)
            assert last.face in [
                int(t) // 3
                for t in mesh.twin[3 * tracks[track.hit.other].steps[-1].face + np.arange(3)]
            ]


def span(step: Step, uv: np.ndarray) -> tuple[float, float]:
    """Interval of the moving coordinate that a step covers, ends left out."""
    axis = step.direction % 2
    p = uv[step.face].astype(float)
    places = []
    for k in range(3):
        a, b = p[k], p[(k + 1) % 3]
        low, high = sorted((a[1 - axis], b[1 - axis]))
        if low <= step.level <= high and low < high:
            f = (step.level - a[1 - axis]) / (b[1 - axis] - a[1 - axis])
            places.append(a[axis] + f * (b[axis] - a[axis]))
    ends = [min(places), max(places)]
    forward = step.direction < 2
    if step.start is not None:
        ends[0 if forward else 1] = step.start
    if step.stop is not None:
        ends[1 if forward else 0] = step.stop
    return ends[0], ends[1]


def check_no_crossing(s: Stages) -> int:
    """No two tracks cross inside a face, except where one ends; number of pairs looked at."""
    by_face: dict[int, list[tuple[Track, Step]]] = defaultdict(list)
    for track in s.tracing.tracks:
        for step in track.steps:
            by_face[step.face].append((track, step))
    pairs = 0
    for steps in by_face.values():
        across = [x for x in steps if x[1].direction % 2 == 0]
        along = [x for x in steps if x[1].direction % 2 == 1]
        for _, a in across:
            low_a, high_a = span(a, s.seamless.uv)
            for _, b in along:
                low_b, high_b = span(b, s.seamless.uv)
                pairs += 1
                assert not (low_a < b.level < high_a and low_b < a.level < high_b)
    return pairs


@pytest.mark.parametrize("name", NAMES)
def test_ports_paths_and_no_crossings(name: str) -> None:
    s = stages(name)
    check_ports(s)
    check_paths(s)
    check_no_crossing(s)


def test_crossings_are_looked_for() -> None:
    assert check_no_crossing(stages("blob")) > 10


@given(seed=st.integers(0, 10_000), strength=st.floats(0.3, 1.0))
@settings(max_examples=8)
def test_noisy_fields(seed: int, strength: float) -> None:
    mesh = icosphere(2)
    s = made(mesh, z=noisy(mesh, strength, np.random.default_rng(seed)))
    if s.seamless.is_valid:
        check_ports(s)
        check_paths(s)
        check_no_crossing(s)


def test_a_rectangle_has_no_tracks() -> None:
    s = stages("grid")
    assert s.tracing.tracks == []
    for ports in s.tracing.ports.values():  # at each corner: out along the boundary, and in
        assert [p.gap for p in ports] == [1, 0]
        assert ports[0].halfedge >= 0 > ports[1].halfedge


def test_a_cylinder_has_one_track_from_each_rim() -> None:
    s = stages("cylinder")
    kinds = [track.hit.kind for track in s.tracing.tracks if track.hit is not None]
    # The seeds face each other, or each track runs to the other rim.
    assert kinds in (["meet", "meet"], ["feature", "feature"])
    height = 1.0 if kinds[0] == "meet" else 2.0
    for track in s.tracing.tracks:
        assert track.length * s.seamless.unit * s.edge == pytest.approx(height, rel=1e-4)


def test_a_regular_torus_has_four_tracks_from_its_seed() -> None:
    s = stages("torus")
    assert len(s.tracing.tracks) == 4
    assert s.tracing.special.sum() == 1


def test_cube_creases_leave_nothing_to_trace() -> None:
    s = stages("cube")
    assert s.tracing.tracks == []  # every edge of the T-mesh is a crease
    assert all(len(ports) == 3 for ports in s.tracing.ports.values())


def test_all_tracks_advance_at_one_speed() -> None:
    # A track that ends on another was not there first.
    s = stages("blob")
    for track in s.tracing.tracks:
        hit = track.hit
        if hit is None or hit.kind != "track":
            continue
        other = s.tracing.tracks[hit.other]
        until = sum(
            abs(span(step, s.seamless.uv)[1] - span(step, s.seamless.uv)[0])
            for step in other.steps[: hit.step]
        )
        assert until <= track.length * (1 + 1e-9)


def test_a_folded_map_is_refused() -> None:
    s = stages("blob")
    mirrored = s.seamless.uv[:, :, ::-1].copy()
    with pytest.raises(ParametrizationError, match="isoline"):
        trace(s.aligned, replace(s.seamless, uv=mirrored))


def test_feature_halfedges_are_not_crossed() -> None:
    s = stages("plate")
    on = set(np.flatnonzero(s.aligned.feature).tolist())
    crossed = {step.enter for track in s.tracing.tracks for step in track.steps}
    assert not crossed & on
    assert any(t.hit is not None and t.hit.kind == "feature" for t in s.tracing.tracks)

"""When the beam of a radar passes the gate of a track, and at which marks that look may be and has to be decided."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.contracts.filter import Column
from pipeline.sites import RadarSite
from pipeline.tables import MARKS_A_TURN, VideoFormat, mark_row
from pipeline.tables.arrays import Array, Floats
from pipeline.track.schedule import Looks, Marks, close_looks, plan_looks
from pipeline.track.store import ENDED, TrackStore
from tests.pipeline.track.scene import T0, A

GATE, MAX_GATE_M = 13.8, 150.0
SITE = RadarSite("smr", 200.0, -100.0, 22.0, VideoFormat(range_step_m=4.0, beamwidth_rad=0.02))


def mark_at(turns: float) -> int:
    """The first mark of the 16th of a turn that begins so many turns after row 0."""
    return round(turns * MARKS_A_TURN)


def at_marks(*number: int, period: float = 1.0, azimuths: int = A) -> Marks:
    """Marks of an antenna that was at row 0 at T0."""
    row = mark_row(np.array(number), azimuths)
    return Marks(0, np.array(number), row, T0 + row / azimuths * period, np.full(len(number), period))


def store_of(
    state: Any, covariance: Any, *, time: Any = T0 + 4.0, length: Any = np.nan, looked: Any = 4 * A,
    site: RadarSite = SITE,
) -> TrackStore:  # fmt: skip
    """Tracks that stand at `state` (n, 4) relative to the radar at `time`, last looked at at these absolute rows."""
    state = np.atleast_2d(state)
    store = TrackStore(len(state), 1, {"nothing": Column("?")})
    store.append(len(state))
    store.phase[:] = 0
    store.state[:] = state + np.array([site.east, site.north, 0.0, 0.0])
    store.covariance[:], store.time[:], store.length[:] = covariance, time, length
    store.look["last"][:, 0] = looked
    return store


def plan(store: TrackStore, marks: Marks, site: RadarSite = SITE) -> Looks:
    n = store.n
    return plan_looks(site, marks, store.rows[:n], store.time[:n], store.look[:n, 0], GATE, MAX_GATE_M)


def look(state: Any, covariance: Any, *mark: int, period: float = 1.0, site: RadarSite = SITE, **words: Any) -> Array:
    """The planned look of one radar at one track."""
    store = store_of(state, covariance, site=site, **words)
    plan(store, at_marks(*mark, period=period), site)
    made: Array = store.look[0, 0]
    assert made["planned"]
    return made


def guard_m(one: Array, distance: float) -> float:
    """m to one side that the guard of a look covers, without the row by which azimuths are rounded."""
    return float(one["guard"] - 1.0) / A * 2 * math.pi * distance


def expected_guard_m(covariance: Floats, ahead: float, distance: float, length: float) -> float:
    """What a gate covers: moved track, random acceleration, beam, cell, centroid; half the target and two cells."""
    move = np.eye(4) + ahead * np.eye(4, k=2)
    variance = np.trace((move @ covariance @ move.T)[:2, :2]) + 4.0 * abs(ahead) ** 3
    variance += (distance * SITE.video.beamwidth_rad) ** 2 + SITE.video.range_step_m**2 + 0.1 * length**2
    return min(math.sqrt(GATE * variance), MAX_GATE_M) + 0.5 * length + 2 * SITE.video.range_step_m


@settings(max_examples=60, deadline=None, derandomize=True)
@given(
    st.lists(st.floats(-2.0, 2.0), min_size=16, max_size=16),
    st.floats(0.1, 2.9),
    st.floats(300.0, 2500.0),
    st.floats(0.0, 40.0),
)
def test_a_guard_covers_what_the_gate_can_hold(root: list[float], ahead: float, distance: float, length: float) -> None:
    """Standing due south, so that the beam passes half a turn after north; the covariance is any there can be."""
    half = np.array(root).reshape(4, 4)
    covariance = half @ half.T
    south = (0.0, -distance, 0.0, 0.0)
    most = 0.25 * distance
    for long in (0.0, length):
        one = look(south, covariance, mark_at(4.5), time=T0 + 4.5 - ahead, looked=3 * A + A // 2, length=long)
        assert one["row"] == 4 * A + A // 2
        assert one["time"] == pytest.approx(T0 + 4.5, abs=1e-3)
        assert guard_m(one, distance) == pytest.approx(
            min(expected_guard_m(covariance, ahead, distance, long), most), rel=2e-3
        )


def test_a_target_in_fragments_is_as_long_as_it_must_be_at_least() -> None:
    south, words = (0.0, -900.0, 0.0, 0.0), {"time": T0 + 4.5, "looked": 3 * A + A // 2}
    store = store_of(south, np.eye(4), **words)
    store.least_half_extent[:] = 20.0
    plan(store, at_marks(mark_at(4.5)))
    assert store.look["guard"][0, 0] == look(south, np.eye(4), mark_at(4.5), length=40.0, **words)["guard"]


def test_a_track_far_away_is_waited_for_as_long_as_the_beam_is_wide_there() -> None:
    """What is known to a metre and stands is felt 40 m wide at 2 km by a beam of 0.02 rad, 10 m at 500 m."""
    sure = np.diag([0.01, 0.01, 1e-4, 1e-4])
    wide = [
        guard_m(look((0.0, -d, 0.0, 0.0), sure, mark_at(4.5), time=T0 + 4.5, looked=3 * A + A // 2), d)
        for d in (500.0, 2000.0)
    ]
    assert wide[1] > math.sqrt(GATE) * 40.0
    assert wide[0] < math.sqrt(GATE) * 12.0 + 8.0


@pytest.mark.parametrize("period", [0.5, 1.0, 2.5])
def test_a_look_is_when_the_beam_passes_where_the_track_will_be(period: float) -> None:
    """Due south of the radar and 60 m/s to the west: the beam, which turns clockwise, meets it later than due south."""
    begin = T0 + 29 * period
    one = look((0.0, -800.0, -60.0, 0.0), np.eye(4), mark_at(29.375), period=period, time=begin, looked=28 * A + A // 2)
    ahead = one["time"] - begin
    azimuth = math.atan2(-60.0 * ahead, -800.0) % (2 * math.pi)
    assert ahead == pytest.approx(period * azimuth / (2 * math.pi), abs=0.002 * period)
    assert one["row"] == pytest.approx(29 * A + azimuth / (2 * math.pi) * A, abs=0.002 * A)
    assert azimuth > math.pi + 0.015 * period


def test_what_was_looked_at_in_this_half_turn_is_looked_at_in_the_next_turn() -> None:
    store = store_of((0.0, -800.0, 0.0, 0.0), np.eye(4), looked=4 * A + A // 2 + 1)
    assert len(plan(store, at_marks(mark_at(5.0))).row) == 0
    one = store.look[0, 0]
    assert (one["row"], one["planned"], one["covered"]) == (5 * A + A // 2, True, True)
    assert mark_at(5.0) < one["near"] == one["wake"] < one["due"]


@pytest.mark.parametrize("silent", [1, 2, 3, 10])
def test_turns_left_out_are_one_look(silent: int) -> None:
    """The feed was silent for some turns: the look is the last one that is over, not the first that was missed."""
    closed = 5 + silent
    one = look((0.0, -800.0, 0.0, 0.0), 0.01 * np.eye(4), mark_at(closed), time=T0 + 3.5, looked=3 * A + A // 2)
    assert one["row"] == (closed - 1) * A + A // 2
    assert one["due"] <= mark_at(closed)
    assert one["time"] == pytest.approx(T0 + closed - 0.5, abs=1e-3)


def test_a_radar_never_looked_with_before_begins_at_its_present_turn() -> None:
    one = look((0.0, -800.0, 0.0, 0.0), 0.01 * np.eye(4), mark_at(9.0), time=T0 + 8.9, looked=-(1 << 40))
    assert one["row"] == 8 * A + A // 2


def test_after_an_interruption_the_beam_is_expected_where_the_target_has_moved_to() -> None:
    """20 m/s to the west for eleven seconds, 800 m south of the radar."""
    one = look((0.0, -800.0, -20.0, 0.0), 0.01 * np.eye(4), mark_at(15.0), time=T0 + 3.5, looked=3 * A + A // 2)
    azimuth = math.atan2(-20.0 * (one["time"] - T0 - 3.5), -800.0) % (2 * math.pi)
    assert one["row"] == pytest.approx(14 * A + azimuth / (2 * math.pi) * A, abs=0.002 * A)
    assert azimuth > math.pi + 0.25


@pytest.mark.parametrize(
    ("distance", "covered"), [(90.0, False), (110.0, True), (400.0, True), (460.0, True), (480.0, False)]
)
def test_a_radar_covers_its_own_ranges(distance: float, covered: bool) -> None:
    video = VideoFormat(ranges=91, first_range_m=104.0, range_step_m=4.0)
    site = RadarSite("short", 200.0, -100.0, 22.0, video)
    south = (0.0, -distance, 0.0, 0.0)
    assert look(south, np.eye(4), mark_at(4.25), looked=3 * A + A // 2, site=site)["covered"] == covered
    store = store_of(south, np.eye(4), looked=3 * A + A // 2, site=site)
    last = store.look["last"][0, 0]
    for number in range(mark_at(4.375), mark_at(5.3125)):
        plan(store, at_marks(number), site)
    assert (store.look["last"][0, 0] > last) == (not covered)  # what it does not cover counts as looked at


def test_a_look_is_given_from_the_mark_that_reaches_its_gate_until_it_is_closed() -> None:
    store = store_of((0.0, -800.0, 0.0, 0.0), np.eye(4), time=T0 + 3.5, looked=3 * A + A // 2)
    given_at, closing = {}, mark_at(5.125)
    for number in range(mark_at(4.0), mark_at(5.375)):
        looks = plan(store, at_marks(number))
        if len(looks.row):
            given_at[number] = looks
            if number == closing:
                close_looks(store.look[:, 0], looks.row, looks.at, A)
    one = given_at[mark_at(4.5)]
    assert (one.row.tolist(), one.at.tolist()) == ([0], [4 * A + A // 2])
    row, guard = float(one.at[0]), float(one.guard[0])
    assert mark_row(int(one.near[0]), A) > row - guard >= mark_row(int(one.near[0]) - 1, A)
    assert mark_row(int(one.due[0]), A) > row + guard >= mark_row(int(one.due[0]) - 1, A)
    assert list(given_at) == list(range(int(one.near[0]), closing + 1))
    assert store.look["last"][0, 0] == row


def test_ended_tracks_are_not_looked_at() -> None:
    store = store_of(np.tile((0.0, -800.0, 0.0, 0.0), (2, 1)), np.eye(4), time=T0 + 3.5, looked=3 * A + A // 2)
    store.phase[0] = ENDED
    assert plan(store, at_marks(mark_at(4.6875))).row.tolist() == [1]


def slow_look(
    site: RadarSite, marks: Marks, b: int, state: Floats, covariance: Floats, time: float, length: float, last: int
) -> dict[str, Any]:
    """The look of a track after the row `last`, in matrices, as it is known at the mark b."""
    a, now, period, row = site.video.azimuths, float(marks.time[b]), float(marks.period[b]), int(marks.row[b])

    def seen_at(at: float) -> tuple[Floats, int]:
        place = state[:2] + (at - time) * state[2:] - (site.east, site.north)
        return place, int(np.arctan2(*place) % (2 * np.pi) / (2 * np.pi) * a)

    after = last + a // 2
    r = after + 1 + (seen_at(now)[1] - after - 1) % a
    if r < row - 2 * a:
        r += (row - r) // a * a
    place, own = seen_at(now - (row - r) * period / a)
    r = min((r - r % a + own + turn * a for turn in (-1, 0, 1)), key=lambda one: (abs(one - r), one))
    at, distance = now - (row - r) * period / a, float(np.hypot(*place))
    move = np.eye(4) + (at - time) * np.eye(4, k=2)
    variance = np.trace((move @ covariance @ move.T)[:2, :2]) + 4.0 * abs(at - time) ** 3 + 0.1 * length**2
    variance += (distance * site.video.beamwidth_rad) ** 2 + site.video.range_step_m**2
    reach = min(math.sqrt(GATE * variance), MAX_GATE_M) + 0.5 * length + 2 * site.video.range_step_m
    guard = min(reach / max(distance, 1.0), 0.25) / (2 * np.pi) * a + 1.0
    while r + guard + a <= row:
        r, at = r + a, at + period
    farthest = site.video.first_range_m + (site.video.ranges - 0.5) * site.video.range_step_m
    nearest = max(site.video.first_range_m - site.video.range_step_m, 0.0)
    first, end = (16 * ((r + turns * a) // a) for turns in (-2, 3))
    stands = [(16 * k + 15) * a / 256 for k in range(first, end)]
    return {
        "row": r, "time": at, "guard": guard, "covered": nearest <= distance <= farthest,
        "near": first + sum(one <= r - guard for one in stands), "due": first + sum(one <= r + guard for one in stands),
    }  # fmt: skip


def anything(seed: int, n: int, azimuths: int = A) -> tuple[TrackStore, RadarSite]:
    """A store of tracks about the radar, at any stage of their looks, as known before turn 10 is over."""
    rng = np.random.default_rng(seed)
    video = VideoFormat(azimuths=azimuths, ranges=400, range_step_m=4.0, first_range_m=60.0, beamwidth_rad=0.01)
    site = RadarSite("any", 200.0, -100.0, 22.0, video)
    state = np.column_stack([rng.uniform(-1300, 1300, (n, 2)), rng.uniform(-40, 40, (n, 2))])
    root = rng.uniform(-2, 2, (n, 4, 4))
    store = store_of(
        state, root @ root.transpose(0, 2, 1), time=T0 + 10 - rng.uniform(0, 2, n), site=site,
        length=np.where(rng.random(n) < 0.3, np.nan, rng.uniform(0, 60, n)),
        looked=10 * azimuths - rng.integers(1, 2 * azimuths, n),
    )  # fmt: skip
    store.phase[rng.random(n) < 0.1] = ENDED
    return store, site


@settings(deadline=None, derandomize=True, max_examples=60)
@given(st.integers(0, 2**32 - 1), st.sampled_from([A, 1000, 509, 96]), st.sampled_from([0.5, 1.0, 2.5]))
def test_any_look_is_planned_as_by_the_slow_twin(seed: int, azimuths: int, period: float) -> None:
    store, site = anything(seed, 12, azimuths)
    at = mark_at(10.0)
    marks = at_marks(at, azimuths=azimuths)._replace(period=np.array([period]))
    before = store.look["last"][:, 0].copy()
    looks = plan(store, marks, site)
    for row in range(store.n):
        one = store.look[row, 0]
        if store.phase[row] == ENDED:
            assert not one["planned"]
            continue
        length = store.length[row] if np.isfinite(store.length[row]) else 0.0
        expected = slow_look(
            site, marks, 0, store.state[row], store.covariance[row], store.time[row], length, int(before[row])
        )
        if not expected["covered"] and expected["due"] <= at:
            assert one["last"] == expected["row"]
            continue
        assert one["planned"]
        for name, value in expected.items():
            assert one[name] == pytest.approx(value, rel=1e-9), name
        assert one["wake"] == (expected["near"] if expected["covered"] else expected["due"])
        assert (row in looks.row) == (expected["covered"] and expected["near"] <= at)
    for name, column in (("time", "time"), ("guard", "guard"), ("at", "row"), ("near", "near"), ("due", "due")):
        assert getattr(looks, name).tolist() == store.look[column][looks.row, 0].tolist()


@settings(deadline=None, derandomize=True, max_examples=60)
@given(st.integers(0, 2**32 - 1), st.integers(1, 8), st.sampled_from([A, 1000, 509, 96]), st.integers(157, 165))
def test_marks_planned_together_give_the_bits_of_one_after_the_other(
    seed: int, many: int, azimuths: int, first: int
) -> None:
    """Their times drift, so that it matters at which of them a look is planned."""
    (together, site), (alone, _) = anything(seed, 12, azimuths), anything(seed, 12, azimuths)
    marks = at_marks(*range(first, first + many), azimuths=azimuths)
    drift = 0.006 * np.arange(many)
    marks = marks._replace(time=marks.time + drift, period=marks.period + drift)
    for store in (together, alone):  # what is overdue is looked at by itself
        decide(store, at_marks(first - 1, azimuths=azimuths), site)
    decided = decide(together, marks, site)
    seen = [decide(alone, Marks(0, *(column[b : b + 1] for column in marks[1:5])), site) for b in range(many)]
    assert sorted(decided) == sorted(one for each in seen for one in each)
    for store in (together, alone):
        plan(store, at_marks(first + many, azimuths=azimuths), site)
    assert together.look.tobytes() == alone.look.tobytes()


def decide(store: TrackStore, marks: Marks, site: RadarSite) -> list[tuple[Any, ...]]:
    """The looks that are due at one of the marks are over; all that is known of them."""
    looks = plan(store, marks, site)
    due = looks.due <= marks.number[-1]
    close_looks(store.look[:, 0], looks.row[due], looks.at[due], site.video.azimuths)
    return [tuple(one) for one in zip(*(column[due].tolist() for column in looks), strict=True)]

"""Radars of half a second, one second and two and a half, alone and side by side: nothing is tied to one period."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import pytest

from pipeline.tables import TargetClass, TrackPhase, Tracks
from tests.pipeline.track.scene import Target, line, make_tracker, truth_at
from tests.pipeline.track.sensors import Antenna, antenna, nearest, off, play

SIDE_BY_SIDE = (
    antenna("half", 0.0, 0.0, period=0.5, false=1.0),
    antenna("one", 1500.0, -400.0, period=1.0, phase=0.37, false=2.0),
    antenna("slow", -800.0, 600.0, period=2.5, phase=0.81, false=4.0),
)
ALONE = {period: (antenna(period=period, false=2.0),) for period in (0.5, 1.0, 2.5)}
EVERYTHING = {**{f"{period} s": radars for period, radars in ALONE.items()}, "side by side": SIDE_BY_SIDE}

TURNS_TO_CONFIRM = 8
TURNS_TO_PART = 12
"""Turns until two targets side by side are two tracks: their first plots may be paired in two ways."""

HEADING_S = 20.0
"""s until a heading is judged: 8 turns of the slowest, and enough for a speed that is known well."""

SLOW = [
    Target(line(500, 300, 10, 0), 12, 4, 0.95),
    Target(line(400, -800, 0, 0), 38, 30, 0.95),
    Target(line(40, 1500, -8, 0), 6, 3, 0.95),
    Target(line(-3, 900, 1.5, -15), 6, 3, 0.95),
    Target(line(-900, -900, 3, 3), 20, 18, 0.95),
]
FAST = Target(line(-2500, 120, 70, -1), 38, 30, 0.95)


def longest(radars: tuple[Antenna, ...]) -> float:
    return max(one.period for one in radars)


def shortest(radars: tuple[Antenna, ...]) -> float:
    return min(one.period for one in radars)


@dataclass
class Found:
    """What was found at each look: m, m/s, rad, and the shares of tracks too many and coasting."""

    position: list[float] = field(default_factory=list)
    speed: list[float] = field(default_factory=list)
    course: list[float] = field(default_factory=list)
    coasting: list[bool] = field(default_factory=list)
    counts: set[int] = field(default_factory=set)
    numbers: list[set[int]] = field(default_factory=list)

    def judge(self, tracks: Tracks, targets: list[Target]) -> None:
        self.counts.add(len(tracks))
        self.numbers = self.numbers or [set() for _ in targets]
        for target, numbers in zip(targets, self.numbers, strict=True):
            k = nearest(tracks, target)
            t = tracks.time[k]
            numbers.add(int(tracks.id[k]))
            self.position.append(off(tracks, target, k))
            self.coasting.append(tracks.phase[k] == TrackPhase.COASTING)
            true = (truth_at(target, t + 0.05)[0] - truth_at(target, t - 0.05)[0]) / 0.1
            self.speed.append(float(np.hypot(*(tracks.state[k, 2:] - true))))
            if np.hypot(*true) > 3:
                turn = np.arctan2(*tracks.state[k, 2:]) - np.arctan2(*true)
                self.course.append(float(abs((turn + np.pi) % (2 * np.pi) - np.pi)))


@pytest.mark.parametrize("name", EVERYTHING)
def test_targets_are_confirmed_in_eight_turns_and_held_within_the_figures_of_ed_87(name: str) -> None:
    """7.5 m in 95 % of looks, 4 m/s and 15 degrees in 90 %; one number each, none too many, for 40 s and 30 turns."""
    radars = EVERYTHING[name]
    period = longest(radars) if len(radars) == 1 else 1.0
    targets = [*SLOW, FAST] if period <= 1.0 else SLOW
    found = Found()
    seconds = max(40.0, 30 * period)
    tracker = make_tracker(radars=[one.site for one in radars])
    for t, tracks in play(tracker, radars, targets, seconds, every=shortest(radars)):
        if t >= TURNS_TO_CONFIRM * period:
            assert len(tracks) >= len(targets), f"{len(tracks)} tracks at {t} s"
            found.judge(tracks, targets)
    assert found.counts == {len(targets)}
    assert np.percentile(found.position, 95) < 7.5
    assert np.percentile(found.speed, 90) < 4
    assert np.degrees(np.percentile(found.course, 90)) < 15
    assert [len(one) for one in found.numbers] == [1] * len(targets)
    # two looks in a row fail once in 400
    assert np.mean(found.coasting) <= (0.0 if len(radars) > 1 else 0.01)


@pytest.mark.parametrize("name", EVERYTHING)
def test_nothing_that_every_turn_sees_coasts(name: str) -> None:
    radars = EVERYTHING[name]
    target = Target(line(500, 300, 10, 0), 12, 4)
    tracker = make_tracker(radars=[one.site for one in radars])
    period = longest(radars)
    phases = set()
    for t, tracks in play(tracker, radars, [target], 25 * period, every=0.5):
        tracker.advance(tracker.time)
        if t > 6 * period:
            phases.add(int(tracks.phase[nearest(tracks, target)]))
            assert len(tracks) == 1
    assert phases == {TrackPhase.CONFIRMED}


@pytest.mark.parametrize("name", EVERYTHING)
def test_extent_heading_and_class(name: str) -> None:
    radars = EVERYTHING[name]
    taxi, parked, car = Target(line(-400, 420, 9, -3), 38, 30), SLOW[1], SLOW[2]
    tracker = make_tracker(radars=[one.site for one in radars])
    *_, (_, tracks) = play(tracker, radars, [taxi, parked, car], 30 * longest(radars))
    moving, standing, vehicle = (tracks[nearest(tracks, one)] for one in (taxi, parked, car))
    assert moving.category[0] == standing.category[0] == TargetClass.AIRCRAFT
    assert vehicle.category[0] == TargetClass.VEHICLE
    assert moving.length[0] == pytest.approx(38, abs=3)
    assert moving.width[0] == pytest.approx(30, abs=3)
    assert standing.length[0] == pytest.approx(38, abs=3)
    assert np.degrees(moving.heading[0]) == pytest.approx(np.degrees(np.arctan2(9, -3)), abs=8)
    assert np.isnan(standing.heading[0])


@pytest.mark.parametrize("name", EVERYTHING)
@pytest.mark.parametrize(("apart", "speed"), [(14.0, 8.0), (18.0, 0.0)])
def test_near_but_distinct_stay_two(name: str, apart: float, speed: float) -> None:
    """Two cars side by side, in 3 of 3 seeded runs."""
    radars = EVERYTHING[name]
    pair = [Target(line(300, 500 + off_by, speed, 0), 5, 2, 0.95) for off_by in (0.0, apart)]
    for seed in range(3):
        tracker = make_tracker(radars=[one.site for one in radars])
        numbers: list[set[int]] = [set(), set()]
        for t, tracks in play(tracker, radars, pair, 25 * longest(radars), seed=seed):
            if t >= TURNS_TO_PART * longest(radars):
                assert len(tracks) == 2
                rows = [nearest(tracks, one) for one in pair]
                assert len(set(rows)) == 2
                for row, known in zip(rows, numbers, strict=True):
                    known.add(int(tracks.id[row]))
        assert [len(one) for one in numbers] == [1, 1]


def stop_and_go(t: float) -> tuple[float, float]:
    """10 m/s, braking with 1.5 m/s^2 at t = 30, standing until 60, then 1 m/s^2 up to 10 m/s again."""
    brake = min(max(t - 30, 0), 10 / 1.5)
    go = max(t - 60, 0)
    up = min(go, 10)
    east = 10 * min(t, 30) + 10 * brake - 0.75 * brake**2 + 0.5 * up**2 + 10 * max(go - 10, 0)
    return 200 + east, 500.0


@pytest.mark.parametrize("name", EVERYTHING)
def test_stop_and_go_keeps_number_and_heading(name: str) -> None:
    radars = EVERYTHING[name]
    target = Target(stop_and_go, 38, 30)
    numbers, errors, headings = set(), [], []
    tracker = make_tracker(radars=[one.site for one in radars])
    for t, tracks in play(tracker, radars, [target], 90.0):
        if t >= TURNS_TO_CONFIRM * longest(radars):
            assert len(tracks) == 1
            numbers.add(int(tracks.id[0]))
            errors.append(off(tracks, target))
        if t >= HEADING_S:
            headings.append(float(np.degrees(tracks.heading[0])))
    assert len(numbers) == 1
    assert max(errors) < 12
    assert np.abs(np.array(headings) - 90).max() < 20


@pytest.mark.parametrize("period", ALONE)
def test_what_is_gone_ends_after_the_same_number_of_turns(period: float) -> None:
    """By radar alone a track ends within 10 turns of its last plot, or ten seconds for a fast antenna."""
    radars = ALONE[period]
    leaves = 20 * period
    gone = Target(line(500, 300, 10, 0), 12, 4, gone=leaves)
    stays = SLOW[1]
    tracker = make_tracker(radars=[one.site for one in radars])
    left = []
    for t, tracks in play(tracker, radars, [gone, stays], 35 * period, every=period):
        if t > 10 * period and len(tracks) == 2:
            left.append(t)
    assert leaves + period < max(left) < leaves + max(10 * period, 10.0) + period
    assert len(tracker.tracks()) == 1

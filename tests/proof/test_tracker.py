"""The tracker runs, as it is, with a filter of two models, one with height, and an association of two hypotheses."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
import pytest

from pipeline.associate.gnn import GlobalNearestNeighbour
from pipeline.contracts.associate import AssociatePart
from pipeline.contracts.filter import FilterPart
from pipeline.filter.kalman import Kalman
from pipeline.tables import TargetReports
from pipeline.track.tracker import Tracker
from tests.pipeline.track.scene import T0, Target, crossing, line, make_tracker, run, truth_at
from tests.proof.air_filter import AirFilter
from tests.proof.imm_two_models import TwoModels
from tests.proof.two_hypotheses import TwoHypotheses

SCANS = 300
SETTLED_SCANS = 10
"""Scans after which every target must have been confirmed."""

STRAIGHT_M, RADIUS_M, SPEED = 300.0, 50.0, 10.0
"""Of a racetrack whose turns take 2 m/s^2."""

HALF_LAP_S = (STRAIGHT_M + math.pi * RADIUS_M) / SPEED


def racetrack(t: float) -> tuple[float, float]:
    """Two straights, driven east and west, and two left turns."""
    half, along = divmod(SPEED * t, STRAIGHT_M + math.pi * RADIUS_M)
    angle = max(along - STRAIGHT_M, 0.0) / RADIUS_M
    east = min(along, STRAIGHT_M) - STRAIGHT_M / 2 + RADIUS_M * math.sin(angle)
    side = 1.0 if half % 2 == 0 else -1.0
    return 400.0 + side * east, 600.0 - side * RADIUS_M * math.cos(angle)


TRAFFIC = [
    Target(racetrack, detection=0.95),
    Target(line(-900.0, -300.0, 6.0, 0.5), detection=0.9),
    Target(line(800.0, -900.0, 0.0, 4.0), detection=0.9),
    Target(line(-400.0, 500.0, 0.0, 0.0), detection=0.9),
]


class Watch:
    """Keeps, for each target and scan, the number of the track nearest to it and how far that is."""

    def __init__(self, tracker: Tracker, targets: Sequence[Target]) -> None:
        self.tracker, self.targets = tracker, targets
        self.number: list[list[int]] = []
        self.error: list[list[float]] = []
        self.shown: list[int] = []

    def __call__(self, scan: int) -> None:
        if scan < SETTLED_SCANS:
            return
        tracks = self.tracker.tracks()
        assert len(set(tracks.id.tolist())) == len(tracks.id)
        self.shown.append(len(tracks.id))
        off = [np.hypot(*(tracks.state[:, :2] - truth_at(one, tracks.time)).T) for one in self.targets]
        self.number.append([int(tracks.id[np.argmin(one)]) for one in off])
        self.error.append([float(one.min()) for one in off])

    def rms(self, target: int = 0) -> float:
        return float(np.sqrt(np.mean(np.square([one[target] for one in self.error]))))


def followed(
    targets: Sequence[Target], after: Callable[[Tracker, int], None] | None = None, sd: float = 2.0,
    false: float = 0.0, seed: int = 1, **parts: FilterPart | AssociatePart,
) -> Watch:  # fmt: skip
    tracker = make_tracker(**parts)
    watch = Watch(tracker, targets)

    def each(scan: int) -> None:
        if after is not None:
            after(tracker, scan)
        watch(scan)

    run(tracker, targets, SCANS, watch=each, seed=seed, sd=sd, false=false)
    return watch


@pytest.mark.slow
@pytest.mark.parametrize(
    "parts",
    [
        {"filter": TwoModels()},
        {"filter": AirFilter()},
        {"associate": TwoHypotheses()},
        {"filter": TwoModels(), "associate": TwoHypotheses()},
    ],
)
def test_targets_among_false_plots_are_confirmed_and_held(parts: dict[str, FilterPart | AssociatePart]) -> None:
    watch = followed(TRAFFIC, false=4.0, **parts)
    assert [len(set(numbers)) for numbers in zip(*watch.number, strict=True)] == [1] * len(TRAFFIC)
    assert max(max(one) for one in watch.error) < 25.0
    assert max(watch.rms(k) for k in range(len(TRAFFIC))) < 4.0
    assert watch.shown.count(len(TRAFFIC)) > 0.95 * len(watch.shown)


def test_two_models_follow_turns_better_than_either_alone() -> None:
    part, targets = TwoModels(), [Target(racetrack)]
    two = followed(targets, sd=3.0, filter=part)
    alone = [
        followed(targets, sd=3.0, filter=Kalman(still_sd=sd, along_sd=1e-9, across_sd=1e-9, turn_rate=1e-9))
        for sd in (part.quiet_sd, part.agile_sd)
    ]
    assert {numbers[0] for numbers in two.number} == {two.number[0][0]}
    assert max(one[0] for one in two.error) < 12.0
    assert two.rms() < 0.95 * min(one.rms() for one in alone)


def ghosts() -> list[Target]:
    """At the end of each straight something is seen to go straight on for eight scans, while the target turns."""
    made = []
    for half in range(int(SCANS / HALF_LAP_S)):
        t = half * HALF_LAP_S + STRAIGHT_M / SPEED
        (e, n), side = racetrack(t), SPEED if half % 2 == 0 else -SPEED
        made.append(Target(line(e - side * t, n, side, 0.0), born=t + 0.5, gone=t + 8.5))
    return made


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("filter", [Kalman(), TwoModels()])
def test_a_wrong_choice_is_taken_back(filter: FilterPart, seed: int) -> None:
    """One hypothesis goes after the ghosts and leaves the target to a new track; two come back to it."""
    targets = [Target(racetrack), *ghosts()]
    assert len(targets) == 7
    nearest = followed(targets, seed=seed, filter=filter, associate=GlobalNearestNeighbour())
    assert len({numbers[0] for numbers in nearest.number}) >= 3
    two = followed(targets, seed=seed, filter=filter, associate=TwoHypotheses())
    assert {numbers[0] for numbers in two.number} == {two.number[0][0]}
    assert set(two.shown) == {1}  # a target of two rows is shown once
    over = [one[0] for one in two.error]
    assert max(over) < 90.0
    assert np.mean(np.array(over) < 10.0) > 0.8
    counted = two.tracker.counters
    assert counted["hypotheses_branched"] == counted["hypotheses_ended"] >= 6


def test_altitudes_of_reports_reach_a_filter_with_height() -> None:
    climbing = Target(line(-900.0, 300.0, 8.0, 0.0))

    def report(tracker: Tracker, scan: int) -> None:
        t = crossing(climbing.path, scan)
        east, north = climbing.path(t)
        tracker.target_reports(
            TargetReports.build(
                1, time=T0 + t, east=east, north=north, accuracy=5.0, altitude=50.0 + 2.0 * t, address="3C6444",
                on_ground=False, speed=np.nan, course=np.nan,
            )
        )  # fmt: skip

    watch = followed([climbing, TRAFFIC[2]], after=report, filter=AirFilter())
    core = watch.tracker._core
    named = np.flatnonzero(core.column("named") & (core.column("id") > 0))
    assert len(named) == 1
    up, climb = core.store.filter["state"][named[0], [2, 5]]
    assert up == pytest.approx(50.0 + 2.0 * (core.store.time[named[0]] - T0), abs=10.0)
    assert climb == pytest.approx(2.0, abs=0.5)
    assert watch.rms() < 4.0


@pytest.mark.parametrize("sectors", [1, 7])
def test_any_cut_of_a_turn_gives_the_same_bits(sectors: int) -> None:
    targets = [*TRAFFIC, *ghosts()[:1]]
    made = []
    for cut in (32, sectors):
        tracker = make_tracker(filter=TwoModels(), associate=TwoHypotheses())
        run(tracker, targets, 45, sectors=cut, false=5.0)
        made.append(tracker.tracks())
    assert len(made[0].id) >= len(TRAFFIC)
    for name in ("id", "time", "state", "covariance"):
        np.testing.assert_array_equal(getattr(made[0], name), getattr(made[1], name))


def test_a_tracker_restored_between_two_hypotheses_goes_on_as_the_other_does() -> None:
    targets = [Target(racetrack), *ghosts()[:1]]
    first, second = (make_tracker(filter=TwoModels(), associate=TwoHypotheses()) for _ in range(2))
    run(first, targets, 36)
    assert first.counters["hypotheses_branched"] > first.counters.get("hypotheses_ended", 0)
    second.restore(first.save())
    made = [run(one, targets, 10, first=36).tracks() for one in (first, second)]
    for name in ("id", "time", "state", "covariance"):
        np.testing.assert_array_equal(getattr(made[0], name), getattr(made[1], name))

"""The picture of the demonstration against its truth: the figures this program stands for, in a short seeded run."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from app.bench.picture import START, demo_quality
from app.demo.scene import demo_settings, demo_world
from app.settings import Settings
from pipeline.lab.measure.picture_quality import PictureScorer, QualityRow, Score
from pipeline.lab.simulate.world import World
from pipeline.tables import Tracks


@cache
def score() -> Score:
    """56 turns, the last 26 counted: the first incident, at 45 s, is in them."""
    return demo_quality(56, settle=30.0)


def figures() -> dict[str, QualityRow]:
    return {row.name: row for row in score().rows()}


@pytest.mark.parametrize(
    "name",
    [
        "target report, manoeuvring area",
        "target report, apron",
        "position, manoeuvring area, 95 %",
        "position, apron, 95 %",
        "velocity, 90 %",
        "course of what moves, 90 %",
        "heading of moving aircraft, 90 %",
        "gap of 3 to 5 s",
        "gap of more than 5 s",
        "false target report",
        "false tracks a minute",
        "of these on the pavement",
        "false identification",
        "identification",
        "alert after passing the hold, latest",
        "incidents without an alert",
    ],
)
def test_the_demonstration_keeps_the_bound(name: str) -> None:
    row = figures()[name]
    assert row.met, row


def test_enough_was_scored_to_mean_something() -> None:
    made = score()
    assert made.seconds == 26
    assert made.asked["manoeuvring"] > 200
    assert made.asked["apron"] > 300
    assert len(made.course) > 100
    assert made.should_be_named > 200


def tracks_of(world: World, time: float, shift: float = 0.0, keep: slice = slice(None)) -> Tracks:
    truth = world.truth(time)[keep]
    state = np.stack([truth.east + shift, truth.north, np.zeros(len(truth)), np.zeros(len(truth))], axis=1)
    return Tracks.build(
        len(truth), id=np.arange(1, len(truth) + 1), time=time, state=state, covariance=np.eye(4), phase=1,
        callsign=truth.callsign,
    )  # fmt: skip


class _EverythingInSight:
    """Stands for a radar whose picture has no shadows."""

    def __init__(self) -> None:
        from app.assembly import radar_site

        settings = demo_settings(Settings())
        self.site = radar_site(settings.radars[0], demo_world(settings, START).airport)
        video = self.site.video
        self.clutter = type("Map", (), {"slope": np.full((video.azimuths, video.ranges), -32767, np.int16)})()


def scored(shift: float, keep: slice = slice(None)) -> dict[str, QualityRow]:
    world = demo_world(demo_settings(Settings()), START)
    scorer = PictureScorer(world, _EverythingInSight(), settle=10.0)  # type: ignore[arg-type]
    for second in range(14):
        scorer.look(tracks_of(world, START + second, shift, keep), START + second)
    return {row.name: row for row in scorer.score.rows()}


def test_the_truth_itself_is_without_fault() -> None:
    rows = scored(0.0)
    assert rows["target report, manoeuvring area"].value == 1.0
    assert rows["position, manoeuvring area, 95 %"].value < 1e-6
    assert rows["identification"].value == 1.0
    assert rows["false tracks a minute"].value == 0.0
    assert rows["velocity, 90 %"].met is False  # these tracks say that nothing moves


def test_displaced_tracks_are_false_and_their_targets_missed() -> None:
    rows = scored(5000.0)
    assert rows["target report, manoeuvring area"].value == 0.0
    assert rows["false target report"].value > 0.5
    assert rows["longest gap"].value == 4.0


def test_a_bias_is_seen_as_position_error() -> None:
    assert scored(9.0)["position, manoeuvring area, 95 %"].value == pytest.approx(9.0, abs=0.5)


def test_targets_left_out_are_missed_and_nothing_else() -> None:
    rows = scored(0.0, slice(0, 20))
    assert 0.0 < rows["target report, apron"].value < 0.9
    assert rows["false target report"].value == 0.0

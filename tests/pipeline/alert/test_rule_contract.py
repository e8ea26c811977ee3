"""What every alert rule must keep to, whoever writes it: this suite runs over all parts of `pipeline.alert`."""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np
import pytest

from pipeline import parts
from pipeline.airport.runway_frames import HoldFrames, RunwayFrames
from pipeline.contracts.alert import Conflict, Situation, SituationSettings
from pipeline.picture import RunwayState
from pipeline.situation.observe import observe
from pipeline.tables import TargetClass, Tracks
from tests.pipeline.alert.scene import arrival, departure, parked, small_airport, tracks_at

NAMES = sorted(parts.available("alert"))


def situation(tracks: Tracks, time: float, state: RunwayState) -> Situation:
    airport = small_airport()
    frames, holds = RunwayFrames.build(airport), HoldFrames.build(airport)
    return observe(airport, frames, holds, tracks, time, (state,), SituationSettings())


def busy(open: bool) -> Situation:
    movers = [arrival(1, 60), arrival(4, 70, way=-1), departure(2, 40, way=-1), parked(3, 200, 0)]
    return situation(tracks_at(movers, 52.0), 52.0, RunwayState("09/27", open=open, in_use="09" if open else None))


def test_the_first_four_rules_are_there() -> None:
    assert {"runway_occupied", "hold_entry", "opposite_direction", "closed_runway"} <= set(NAMES)


@pytest.mark.parametrize("name", NAMES)
class TestRuleContract:
    def test_it_is_a_frozen_part_with_defaults(self, name: str) -> None:
        rule = parts.build("alert", name)
        assert is_dataclass(rule)
        with pytest.raises(AttributeError):
            rule.alarm_s = 1.0
        assert {"information_s", "alarm_s", "information_low_s", "alarm_low_s", "runways"} <= {
            f.name for f in fields(rule)
        }

    def test_settings_are_taken_and_wrong_ones_refused(self, name: str) -> None:
        assert parts.build("alert", name, {"alarm_s": 1.0}).alarm_s == 1.0
        with pytest.raises(parts.PartError):
            parts.build("alert", name, {"alarm_s": 1e9})

    def test_an_empty_airport_gives_nothing(self, name: str) -> None:
        rule = parts.build("alert", name)
        assert rule(situation(Tracks.empty(), 0.0, RunwayState("09/27", in_use="09"))) == ()

    @pytest.mark.parametrize("open", [True, False])
    def test_conflicts_are_well_formed_and_repeatable(self, name: str, open: bool) -> None:
        rule, scene = parts.build("alert", name), busy(open)
        found = rule(scene)
        assert found == rule(scene)
        present = set(scene.tracks.id.tolist())
        keys: set[Any] = set()
        for one in found:
            assert isinstance(one, Conflict)
            assert one.rule == name
            assert one.runway == "09/27"
            assert one.stage in ("information", "alarm")
            assert one.text
            assert set(one.tracks) <= present
            assert len(set(one.tracks)) == len(one.tracks) > 0
            assert one.intruder is None if name == "opposite_direction" else one.intruder in one.tracks
            assert one.cat004_type > 0
            key = (one.runway, frozenset(one.tracks))
            assert key not in keys
            keys.add(key)
            numbers = (one.time_to_threshold, one.time_to_conflict, one.separation, one.predicted_separation)
            assert all(value is None or (np.isfinite(value) and value >= 0) for value in numbers)

    def test_nobody_conflicts_alone_far_from_the_runway(self, name: str) -> None:
        rule = parts.build("alert", name)
        movers = [parked(i, 100.0 * i, 600.0, TargetClass(i % 3)) for i in range(1, 20)]
        assert rule(situation(tracks_at(movers, 0.0), 0.0, RunwayState("09/27", open=False))) == ()


def test_depth_and_frames_agree_with_plain_geometry() -> None:
    frames = RunwayFrames.build(small_airport())
    points = np.array([[0.0, 0.0], [0.0, 80.0], [0.0, 100.0], [1590.0, 0.0], [-1605.0, 0.0]])
    assert frames.depth(0, "normal", points) == pytest.approx([90, 10, -1, 10, -1])
    assert frames.depth(0, "low", points)[2] == pytest.approx(50)
    along, across = frames.project(points)
    assert along[0] == pytest.approx([1500, 1500, 1500, 3090, -105])
    assert across[0] == pytest.approx([0, -80, -100, 0, 0])

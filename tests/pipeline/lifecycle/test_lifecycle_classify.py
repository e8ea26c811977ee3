from __future__ import annotations

import numpy as np
import pytest

from pipeline.classify.extent_speed import ExtentSpeed
from pipeline.lifecycle.m_of_n import MOfN
from pipeline.lifecycle.score import Score
from pipeline.tables import TargetClass, TrackPhase
from tests.pipeline.contracts.track import ClassifyContract, LifecycleContract


class TestMOfNContract(LifecycleContract):
    part = MOfN()

    @pytest.mark.parametrize(
        ("history", "looks", "phase", "ended"),
        [
            (0b1111, 4, TrackPhase.CONFIRMED, False),
            (0b101011, 6, TrackPhase.CONFIRMED, False),
            (0b1110, 4, TrackPhase.TENTATIVE, False),
            (0b11100, 5, TrackPhase.TENTATIVE, False),
            (0b1000, 4, TrackPhase.TENTATIVE, True),  # 3 of 6 at best
            (0b1111 << 6, 10, TrackPhase.TENTATIVE, True),  # hits that left the window
        ],
    )
    def test_m_of_n(self, history: int, looks: int, phase: TrackPhase, ended: bool) -> None:
        assert self.judge(history=history, looks=looks) == (phase, ended)

    def test_a_named_track_may_be_silent_for_longer(self) -> None:
        confirmed = {"phase": TrackPhase.CONFIRMED, "silence": 15.0, "looks": 40}
        assert self.judge(**confirmed)[1]
        assert not self.judge(**confirmed, identified=True)[1]


class TestScoreContract(LifecycleContract):
    part = Score()

    @pytest.mark.parametrize(
        ("score", "history", "looks", "phase", "ended"),
        [
            (12.5, 0b111, 3, TrackPhase.CONFIRMED, False),
            (12.5, 0b11, 2, TrackPhase.TENTATIVE, False),  # too few to know how it moves
            (11.5, 0b1111, 4, TrackPhase.TENTATIVE, False),
            (-5.5, 0b1000, 4, TrackPhase.TENTATIVE, True),
            (9.0, 0b1010101, 15, TrackPhase.TENTATIVE, True),  # undecided for too long
            (np.inf, 0b111, 3, TrackPhase.CONFIRMED, False),
        ],
    )
    def test_the_score_decides(self, score: float, history: int, looks: int, phase: TrackPhase, ended: bool) -> None:
        assert self.judge(score=score, history=history, looks=looks) == (phase, ended)

    def test_what_is_confirmed_needs_less(self) -> None:
        confirmed = {"phase": TrackPhase.CONFIRMED, "looks": 40}
        assert self.judge(**confirmed, score=5.0) == (TrackPhase.CONFIRMED, False)
        assert self.judge(**confirmed, score=3.0)[1]
        assert not self.judge(**confirmed, score=3.0, identified=True)[1]


class TestExtentSpeedContract(ClassifyContract):
    part = ExtentSpeed()

    @pytest.mark.parametrize("before", list(TargetClass))
    def test_between_the_bounds_it_stays_what_it_was(self, before: TargetClass) -> None:
        assert self.call(before, 15.0, 5.0) == before

    def test_no_car_is_that_fast(self) -> None:
        assert self.call(TargetClass.VEHICLE, 8.0, 60.0, seen=1) == TargetClass.AIRCRAFT

    def test_the_extent_has_to_settle(self) -> None:
        assert self.call(0, 40.0, 5.0, seen=2) == TargetClass.UNKNOWN


@pytest.mark.parametrize(
    "words", [{"m": 7, "n": 6}, {"n": 40}, {"coast_after": 9}, {"delete_silence": 1.0}, {"start_speed_sd": 0.0}]
)
def test_lifecycle_settings_out_of_bounds(words: dict[str, float]) -> None:
    with pytest.raises(ValueError, match="must"):
        MOfN(**words)


@pytest.mark.parametrize("words", [{"drop": 1.0}, {"confirm": np.nan}, {"least_hits": 40}, {"coast_after": 9}])
def test_score_settings_out_of_bounds(words: dict[str, float]) -> None:
    with pytest.raises(ValueError, match="must"):
        Score(**words)


@pytest.mark.parametrize("words", [{"vehicle_length": 20.0}, {"vehicle_speed": 50.0}])
def test_classify_settings_out_of_bounds(words: dict[str, float]) -> None:
    with pytest.raises(ValueError, match="must"):
        ExtentSpeed(**words)

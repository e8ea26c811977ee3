from __future__ import annotations

import numpy as np
import pytest

from pipeline.lifecycle.m_of_n import MOfN
from pipeline.lifecycle.score import Score
from pipeline.tables import TrackPhase
from tests.pipeline.contracts.lifecycle import LifecycleContract


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

    def test_hits_of_several_radars_do_not_add_up_but_those_of_reports_do(self) -> None:
        halves = {"history": [0b11, 0b11, 0], "looks": [2, 2, 0]}
        assert self.judge(2, **halves) == (TrackPhase.TENTATIVE, False)
        assert self.judge(1, **halves) == (TrackPhase.CONFIRMED, False)

    def test_what_one_radar_has_given_up_another_may_still_find(self) -> None:
        lost, young = (0b1000, 4), (0b1, 1)
        assert self.judge(2, history=[lost[0], young[0]], looks=[lost[1], young[1]]) == (TrackPhase.TENTATIVE, False)
        assert self.judge(2, history=[lost[0], lost[0]], looks=[lost[1], lost[1]]) == (TrackPhase.TENTATIVE, True)

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

    def test_scores_of_sensors_that_speak_for_it_add_up(self) -> None:
        seen = {"history": [0b11, 0b1], "looks": [2, 1]}
        assert self.judge(2, **seen, score=[7.0, 6.0]) == (TrackPhase.CONFIRMED, False)
        assert self.judge(2, **seen, score=[11.0, -6.0]) == (TrackPhase.TENTATIVE, False)
        assert self.judge(2, **seen, score=[-6.0, -4.0]) == (TrackPhase.TENTATIVE, False)
        assert self.judge(2, **seen, score=[-6.0, -5.5]) == (TrackPhase.TENTATIVE, True)

    def test_undecided_for_too_long_is_so_for_every_radar_that_has_seen_it(self) -> None:
        seen = {"history": [0b1010101, 0b1], "score": [5.0, 4.0]}
        assert self.judge(2, **seen, looks=[15, 3]) == (TrackPhase.TENTATIVE, False)
        assert self.judge(2, **seen, looks=[15, 15]) == (TrackPhase.TENTATIVE, True)


@pytest.mark.parametrize(
    "words", [{"m": 7, "n": 6}, {"n": 40}, {"coast_after": 9}, {"delete_silence": 1.0}, {"max_position_sd": 0.0}]
)
def test_lifecycle_settings_out_of_bounds(words: dict[str, float]) -> None:
    with pytest.raises(ValueError, match="must"):
        MOfN(**words)


@pytest.mark.parametrize("words", [{"drop": 1.0}, {"confirm": np.nan}, {"least_hits": 40}, {"coast_after": 9}])
def test_score_settings_out_of_bounds(words: dict[str, float]) -> None:
    with pytest.raises(ValueError, match="must"):
        Score(**words)

"""How long tracks go on without measurements, whichever part confirms them."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.lifecycle.fading import Fading
from pipeline.lifecycle.m_of_n import MOfN
from pipeline.lifecycle.score import Score
from pipeline.tables import TrackPhase
from tests.pipeline.contracts.lifecycle import evidence


@pytest.mark.parametrize("part", [Fading, MOfN, Score])
@pytest.mark.parametrize(
    ("words", "message"),
    [
        ({"coast_silence": 0.0}, "coast_silence, delete_silence and identified_silence"),
        ({"coast_silence": -1.0}, "coast_silence, delete_silence and identified_silence"),
        ({"coast_silence": np.nan}, "coast_silence, delete_silence and identified_silence"),
        ({"coast_silence": 10.1}, "coast_silence, delete_silence and identified_silence"),
        ({"identified_silence": 9.9}, "coast_silence, delete_silence and identified_silence"),
        ({"coast_after": 0}, "coast_after"),
        ({"coast_after": 9}, "coast_after"),
        ({"max_position_sd": 0.0}, "max_position_sd"),
    ],
)
def test_settings_out_of_bounds_are_refused_by_name(part: type[Fading], words: dict[str, float], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        part(**words)  # type: ignore[arg-type]


@pytest.mark.parametrize("part", [Fading, MOfN, Score])
def test_settings_at_their_bounds_are_taken(part: type[Fading]) -> None:
    part(coast_silence=0.3, coast_after=8, delete_misses=8)  # a radar that turns several times a second
    part(coast_silence=7.0, delete_silence=7.0, identified_silence=7.0, max_position_sd=0.1)


def fade(
    misses: int = 0, silence: float = 0.0, *, confirmed: bool = True, identified: bool = False, sd: float = 1.0
) -> tuple[TrackPhase, bool]:
    """Of a target that one radar has seen."""
    given = evidence(
        phase=TrackPhase.CONFIRMED if confirmed else TrackPhase.TENTATIVE, history=1 << misses, looks=20,
        misses=misses, silence=silence, identified=identified, position_sd=sd,
    )  # fmt: skip
    phase, ended = Fading().fade(given, np.array([confirmed]))
    return TrackPhase(int(phase[0])), bool(ended[0])


@pytest.mark.parametrize(
    ("misses", "silence", "phase"),
    [
        (1, 2.5, TrackPhase.CONFIRMED),
        (2, 0.0, TrackPhase.COASTING),
        (0, 2.6, TrackPhase.COASTING),
    ],
)
def test_looks_without_a_hit_or_silence_let_a_track_coast(misses: int, silence: float, phase: TrackPhase) -> None:
    assert fade(misses, silence) == (phase, False)


@pytest.mark.parametrize(("identified", "last"), [(False, 10.0), (True, 20.0)])
def test_silence_ends_a_confirmed_track_later_when_it_is_named(identified: bool, last: float) -> None:
    assert fade(silence=last, identified=identified) == (TrackPhase.COASTING, False)
    assert fade(silence=last + 0.1, identified=identified)[1]


def test_a_tentative_track_ends_after_twice_the_silence_that_lets_others_coast() -> None:
    assert fade(silence=5.0, confirmed=False) == (TrackPhase.TENTATIVE, False)
    assert fade(silence=5.1, confirmed=False) == (TrackPhase.TENTATIVE, True)


def test_looks_without_a_hit_end_a_confirmed_track_that_no_report_has_named() -> None:
    assert not fade(misses=7)[1]
    assert fade(misses=8)[1]
    assert not fade(misses=8, identified=True)[1]
    assert not fade(misses=8, confirmed=False)[1]


@pytest.mark.parametrize(("sd", "ended"), [(120.0, False), (120.1, True), (np.nan, True)])
def test_a_track_of_which_nobody_knows_where_it_is_ends(sd: float, ended: bool) -> None:
    assert fade(sd=sd)[1] == ended

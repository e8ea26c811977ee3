from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from pipeline.engine_records import CODEC
from pipeline.tables import TargetReports, Tracks
from pipeline.track.numbers import LARGEST_NUMBER, LAST_ASTERIX_NUMBER, REST_S, TrackNumbers
from pipeline.track.settings import ReportingSettings, TrackerSettings
from pipeline.track.tracker import Tracker
from tests.pipeline.track.scene import T0, make_tracker

NUMBERED = TrackerSettings(reporting=ReportingSettings(asterix_numbers=True))


def report(tracker: Tracker, which: NDArray[Any], seconds: float) -> Tracks:
    """Targets that stand 100 m apart say where they are; the tracks shown then."""
    tracker.target_reports(
        TargetReports.build(
            len(which), time=T0 + seconds, address=[f"{one:06x}" for one in which], east=100.0 * (which % 80 - 40),
            north=100.0 * (which // 80 - 40), speed=0.0,
        )
    )  # fmt: skip
    tracker.advance(T0 + seconds)
    return tracker.tracks()


def confirmed(tracker: Tracker, which: NDArray[Any], seconds: float) -> Tracks:
    """Targets say three times where they are, a second apart."""
    for second in range(3):
        tracks = report(tracker, which, seconds + second)
    return tracks


def test_an_id_is_never_given_again() -> None:
    numbers = TrackNumbers(last=3)
    assert numbers.new_ids(2).tolist() == [1, 2]
    numbers.give_back(np.array([1, 2]), 0.0)
    made = numbers.new_ids(3)
    assert made.tolist() == [3, 4, 5]
    assert made.dtype == np.int64
    numbers.last_id = 2**31
    assert numbers.new_ids(1).tolist() == [2**31 + 1]


def test_numbers_come_in_turn_and_rest_before_they_come_again() -> None:
    numbers = TrackNumbers(rest=100.0)
    assert numbers.take(3, 0.0).tolist() == [1, 2, 3]
    numbers.give_back(np.array([1]), 10.0)
    numbers.give_back(np.array([2]), 11.0)
    assert numbers.take(4092, 50.0).tolist() == list(range(4, 4096))
    assert numbers.take(1, 50.0).tolist() == [1]  # none has rested, so the one that rests longest
    assert numbers.take(1, 120.0).tolist() == [2]
    assert numbers.take(1, 1e6).tolist() == [0]  # all are borne


def test_a_number_has_rested_when_its_rest_is_over_and_waits_for_its_turn() -> None:
    numbers = TrackNumbers(last=4, rest=REST_S)
    numbers.take(3, 0.0)
    numbers.give_back(np.array([2, 1]), 10.0)
    assert numbers.take(3, 10.0 + REST_S).tolist() == [4, 1, 2]
    numbers.give_back(np.array([3, 4]), 200.0)
    assert numbers.take(1, 200.0 + REST_S).tolist() == [3]
    assert numbers.take(3, 200.0 + REST_S).tolist() == [4, 0, 0]


def test_of_those_that_still_rest_the_longest_rested_comes_first() -> None:
    numbers = TrackNumbers(last=5)
    numbers.take(5, 0.0)
    for number, at in ((4, 3.0), (2, 1.0), (5, 2.0)):
        numbers.give_back(np.array([number]), at)
    assert numbers.take(4, 4.0).tolist() == [2, 5, 4, 0]


def test_zero_is_no_number_that_could_be_given_back() -> None:
    numbers = TrackNumbers(last=2)
    numbers.give_back(np.array([0, 0], np.uint16), 0.0)
    assert sorted(numbers.take(3, 1e6).tolist()) == [0, 1, 2]


@pytest.mark.parametrize(("last", "given"), [(0, []), (LARGEST_NUMBER, [LARGEST_NUMBER])])
def test_the_greatest_number_may_be_any_that_the_column_holds(last: int, given: list[int]) -> None:
    numbers = TrackNumbers(last=last)
    numbers.next = max(last, 1)
    taken = numbers.take(1, 0.0)
    assert taken[taken > 0].tolist() == given
    assert taken.dtype == Tracks.empty().number.dtype


@pytest.mark.parametrize("last", [-1, LARGEST_NUMBER + 1])
def test_a_greatest_number_out_of_bounds(last: int) -> None:
    with pytest.raises(ValueError, match="number"):
        TrackNumbers(last=last)


def test_numbers_outlive_their_byte_form() -> None:
    numbers = TrackNumbers(last=3)
    numbers.new_ids(7)
    numbers.take(2, 0.0)
    copy = CODEC.decode(CODEC.encode(numbers))
    assert copy.take(2, 0.0).tolist() == [3, 0]
    assert copy.new_ids(1).tolist() == [8]


def test_more_tracks_than_asterix_has_numbers_are_all_shown_with_ids_of_their_own() -> None:
    tracker = make_tracker(radars=(), capacity=10_000)
    tracks = confirmed(tracker, np.arange(5000), 0.0)
    assert len(tracks) == 5000
    assert sorted(tracks.id.tolist()) == list(range(1, 5001))
    assert not tracks.number.any()
    assert tracks.shown_number.tolist() == tracks.id.tolist()
    assert "no_number" not in tracker.counters
    assert "no_room" not in tracker.counters


def test_tracks_without_an_asterix_number_are_shown_and_take_the_first_that_is_free() -> None:
    tracker = make_tracker(radars=(), capacity=10_000, settings=NUMBERED)
    targets = np.arange(5000)
    tracks = confirmed(tracker, targets, 0.0)
    without = tracks.number == 0
    assert len(tracks) == 5000
    assert sorted(tracks.number[~without].tolist()) == list(range(1, LAST_ASTERIX_NUMBER + 1))
    assert without.sum() == 5000 - LAST_ASTERIX_NUMBER == tracker.counters["no_number"]
    assert tracks.id[without].min() > LAST_ASTERIX_NUMBER  # so that no id that is shown is another track's number
    assert len(set(tracks.shown_number.tolist())) == 5000
    before = dict(zip(tracks.id.tolist(), tracks.number.tolist(), strict=True))
    for second in range(3, 80):
        tracks = report(tracker, targets[2000:], second)
    assert len(tracks) == 3000
    assert sorted(set(tracks.number.tolist())) == sorted(tracks.number.tolist())
    assert tracks.number.min() >= 1
    assert tracks.number.max() <= LAST_ASTERIX_NUMBER
    kept = [(id, number) for id, number in zip(tracks.id.tolist(), tracks.number.tolist(), strict=True) if before[id]]
    assert all(before[id] == number for id, number in kept)
    assert tracker.counters["no_number"] == 5000 - LAST_ASTERIX_NUMBER  # each is counted once


def test_a_number_rests_after_its_track_ended_and_an_id_never_comes_again() -> None:
    tracker = make_tracker(radars=(), settings=NUMBERED)
    first = confirmed(tracker, np.arange(3), 0.0)
    assert first.number.tolist() == first.id.tolist() == [1, 2, 3]
    report(tracker, np.array([400]), 3.0)  # once only, so that it is never confirmed and takes neither
    for second in range(4, 60):
        report(tracker, np.arange(2), second)
    assert tracker.counters["ended"] == 1
    later = confirmed(tracker, np.arange(10, 12), 60.0)
    assert later.number.tolist()[-2:] == later.id.tolist()[-2:] == [4, 5]


def test_a_restored_tracker_goes_on_with_ids_and_numbers() -> None:
    first = make_tracker(radars=(), settings=NUMBERED)
    confirmed(first, np.arange(3), 0.0)
    second = make_tracker(radars=(), settings=NUMBERED)
    second.restore(first.save())
    tracks = confirmed(second, np.arange(5), 3.0)
    assert tracks.id.tolist() == tracks.number.tolist() == [1, 2, 3, 4, 5]

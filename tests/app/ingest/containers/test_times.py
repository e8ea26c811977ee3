"""Times of datagrams whose file has none."""

import math

import numpy as np
import pytest

from app.ingest.containers.packets import Datagram
from app.ingest.containers.times import UNTIMED_TURN_S, timed
from tests.support.capture_files import T0, video

NAN = math.nan


def of(payloads: list[bytes], times: dict[int, float] | None = None) -> np.ndarray:
    made = timed(Datagram((times or {}).get(i, NAN), None, one) for i, one in enumerate(payloads))
    return np.array([one.time for one in made])


def test_times_that_are_there_stay() -> None:
    assert of([b"", b"x", *video(1)[:1]], {0: T0, 1: T0 - 5, 2: T0 + 1}).tolist() == [T0, T0 - 5, T0 + 1]


def test_times_of_day_are_those_of_the_messages() -> None:
    assert np.allclose(of(video(2, time_of_day=43_000.0)), 43_000 + np.arange(128) / 64, atol=1 / 128)


@pytest.mark.parametrize("day", [0, 1_700_000_000 // 86400])
def test_midnight_is_passed(day: int) -> None:
    payloads = video(3, time_of_day=86_398.5)
    times = of(payloads, {0: day * 86400 + 86_398.5} if day else None)
    assert np.allclose(times, day * 86400 + 86_398.5 + np.arange(192) / 64, atol=1 / 128)


def test_the_day_is_that_of_a_datagram_with_a_time() -> None:
    times = of([b"other", *video(1, time_of_day=T0 % 86400)], {0: T0 - 3})
    assert np.allclose(times[1:], T0 + np.arange(64) / 64, atol=1 / 128)


def test_without_any_time_the_antenna_turns_once_a_second() -> None:
    payloads = video(3, time_of_day=None)
    assert np.allclose(of(payloads), np.arange(192) / 64 * UNTIMED_TURN_S, atol=1e-3)
    payloads[10], payloads[11] = payloads[11], payloads[10]
    payloads[20:20] = [b"other"]
    times = of(payloads)
    assert times[0] == 0
    assert bool((np.diff(times) >= 0).all())
    assert times[-1] == pytest.approx(3, abs=0.1)

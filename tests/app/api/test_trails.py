"""The last hour in chunks and files: what is kept, for how long, and when it begins anew."""

from __future__ import annotations

import gzip
import json

from app.api.trails import CHUNK_DOCUMENTS, CURRENT, INTERVAL_S, KEPT_S, THINNED, Trails
from pipeline.picture import Picture
from pipeline.tables import Tracks


def made(*times: float) -> Trails:
    trails = Trails(lambda picture: {"now": picture.time})
    for time in times:
        trails.show(Picture(time, Tracks.empty()))
    return trails


def in_chunks(trails: Trails) -> list[list[float]]:
    return [
        [one["now"] for one in json.loads(gzip.decompress(trails.chunk(name) or b""))["files"]]
        for name in trails.names()
    ]


def in_files(trails: Trails) -> list[float]:
    return [json.loads(gzip.decompress(trails.file(i) or b""))["now"] for i in range(trails.files)]


def test_before_the_first_picture_there_is_one_empty_chunk() -> None:
    assert in_chunks(made()) == [[]]
    assert made().files == 0
    assert made().file(0) is None


def test_pictures_that_follow_one_another_too_quickly_are_left_out() -> None:
    assert in_chunks(made(0.0, 1.0, INTERVAL_S - 0.1, INTERVAL_S, INTERVAL_S + 7.9, 16.5)) == [[0.0, 8.0, 16.5]]


def test_an_hour_is_kept() -> None:
    times = [INTERVAL_S * i for i in range(1200)]
    trails = made(*times)
    chunks = in_chunks(trails)
    assert [len(one) for one in chunks[:-1]] == [CHUNK_DOCUMENTS] * (len(chunks) - 1)
    kept = [time for chunk in chunks for time in chunk]
    assert kept == times[-len(kept) :]
    assert KEPT_S - CHUNK_DOCUMENTS * INTERVAL_S <= times[-1] - kept[0] <= KEPT_S + CHUNK_DOCUMENTS * INTERVAL_S
    files = in_files(trails)
    assert files == times[::THINNED][-len(files) :]
    assert KEPT_S - 2 * THINNED * INTERVAL_S <= times[-1] - files[0] <= KEPT_S


def test_a_chunk_that_is_whole_never_changes_and_has_a_name_of_its_own() -> None:
    times = [INTERVAL_S * i for i in range(150)]
    early, late = made(*times[:70]), made(*times)
    assert early.names()[0] == late.names()[0]
    assert early.chunk(early.names()[0]) == late.chunk(late.names()[0])
    assert len(set(late.names())) == 3
    assert late.names()[-1] == CURRENT
    assert late.chunk("chunk_1.json") is None


def test_a_time_before_the_newest_begins_anew() -> None:
    trails = made(*[INTERVAL_S * i for i in range(100)], 50.0, 60.0)
    assert in_chunks(trails) == [[50.0, 60.0]]
    assert in_files(trails) == [50.0]
    assert trails.names() == [CURRENT]

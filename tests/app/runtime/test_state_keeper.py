"""The keeper: states saved now and then and at the end, taken up at the start, and no fault of a disk ends anything."""

from __future__ import annotations

import logging
from pathlib import Path

import pytest

from app.runtime.radar_worker import RadarWorker
from app.runtime.state_keeper import StateKeeper
from pipeline.chain import RadarChain
from pipeline.detect.adaptive import Adaptive
from pipeline.detect.hybrid import Hybrid
from tests.app.runtime.small_radar import small_chain, turn


def keeper(folder: Path, scene: str = "live", **values: float) -> StateKeeper:
    return StateKeeper(folder, scene, **{"interval_s": 3600.0, "max_age_s": 3600.0, **values}, clock=lambda: 1000.0)


def turned(chain: RadarChain, scans: int) -> RadarWorker:
    for scan in range(scans):
        for block in turn(scan):
            chain.process(block)
    return RadarWorker(chain.site, chain, 4, lambda _: True)


def plots_of_first_turn(chain: RadarChain) -> int:
    return sum(len(chain.process(block).plots) for block in turn(0))


def test_a_detector_that_learns_for_long_detects_at_once_after_a_restart(tmp_path: Path) -> None:
    before = keeper(tmp_path)
    chain = small_chain(Adaptive())
    assert not before.take_up(chain)
    before.start([turned(chain, 15)])
    before.stop()
    assert before.counters("smr-1") == {"states_saved": 1, "state_saves_failed": 0, "states_resumed": 0}
    after, again = keeper(tmp_path), small_chain(Adaptive())
    assert after.take_up(again)
    assert after.counters("smr-1")["states_resumed"] == 1
    assert plots_of_first_turn(again) >= 2
    assert plots_of_first_turn(small_chain(Adaptive())) == 0


def test_what_did_not_resume_is_saved_all_the_same(tmp_path: Path) -> None:
    made = keeper(tmp_path)
    made.start([turned(small_chain(), 1)])
    made.stop()
    assert made.counters("smr-1") == {"states_saved": 1, "state_saves_failed": 0, "states_resumed": 0}


def test_what_was_not_swept_is_not_saved_over_what_is_there(tmp_path: Path) -> None:
    first = keeper(tmp_path)
    chain = small_chain()
    first.take_up(chain)
    first.start([turned(chain, 3)])
    first.save()
    first.save()
    assert first.counters("smr-1")["states_saved"] == 1
    first.stop()
    written = first.path("smr-1").stat().st_mtime_ns
    second, silent = keeper(tmp_path), small_chain()
    second.take_up(silent)
    second.start([RadarWorker(silent.site, silent, 4, lambda _: True)])
    second.stop()
    assert second.path("smr-1").stat().st_mtime_ns == written


def test_why_a_state_is_not_taken_up_is_logged(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO)
    first = keeper(tmp_path)
    chain = small_chain()
    first.take_up(chain)
    assert "nothing is saved" in caplog.text
    first.start([turned(chain, 3)])
    first.stop()
    for other, scene, words in (
        (small_chain(Hybrid(pfa=1e-5)), "live", "another detect"),
        (small_chain(east=1.0), "live", "another site"),
        (small_chain(), "demo", "another scene"),
    ):
        caplog.clear()
        assert not keeper(tmp_path, scene).take_up(other)
        assert words in caplog.text
        assert plots_of_first_turn(other) == 0
    assert not keeper(tmp_path, max_age_s=-1.0).take_up(small_chain())
    path = first.path("smr-1")
    path.write_bytes(path.read_bytes()[:-500])
    caplog.clear()
    assert not keeper(tmp_path).take_up(small_chain())
    assert "cannot be read" in caplog.text


def test_a_folder_that_takes_nothing_is_counted_and_survived(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    stands_in_the_way = tmp_path / "state"
    stands_in_the_way.write_text("a file where the folder should be")
    made = keeper(stands_in_the_way)
    chain = small_chain()
    assert not made.take_up(chain)
    worker = turned(chain, 2)
    made.start([worker])
    made.save()
    made.save()
    assert made.counters("smr-1")["state_saves_failed"] == 2
    assert caplog.text.count("cannot be saved") == 1
    stands_in_the_way.unlink()
    made.stop()
    assert made.counters("smr-1") == {"states_saved": 1, "state_saves_failed": 2, "states_resumed": 0}

"""A radar's thread: orders between blocks, one chain taking over from another, a flood that is told of and ends."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from app.runtime.radar_worker import RadarWorker
from pipeline.bearing.moments import Moments
from pipeline.chain import RadarChain
from pipeline.detect.adaptive import Adaptive
from pipeline.detect.hybrid import Hybrid
from pipeline.extract.manhattan import Manhattan
from pipeline.tables import SectorPlots, Sweeps
from tests.app.runtime.small_radar import AZIMUTHS, BLOCKS, T0, small_chain, turn
from tests.support.running import until


class Running:
    """A worker with its thread, and what it handed on."""

    def __init__(self, chain: RadarChain) -> None:
        self.sectors: list[SectorPlots] = []
        self.worker = RadarWorker(chain.site, chain, 64, self.take)

    def take(self, sector: SectorPlots) -> bool:
        self.sectors.append(sector)
        return True

    def turns(self, first: int, last: int, **how: Any) -> list[SectorPlots]:
        """Let it work on these turns; what came of them."""
        before = len(self.sectors)
        for scan in range(first, last):
            for block in turn(scan, **how):
                self.worker.put(block)
            until(lambda: not len(self.worker.queue), "the queue is empty")
        self.worker.ask(lambda _: None).result(10)
        return self.sectors[before:]


@pytest.fixture
def running() -> Iterator[Running]:
    made = Running(small_chain())
    made.worker.start()
    yield made
    made.worker.stop()


def plots(sectors: list[SectorPlots]) -> int:
    return sum(len(one.plots) for one in sectors)


def test_orders_are_done_between_blocks_and_also_when_nothing_comes(running: Running) -> None:
    threads = running.worker.ask(lambda _: threading.current_thread().name)
    assert threads.result(10) == "radar-smr-1"
    running.turns(0, 2)
    assert running.worker.ask(lambda chain: chain.counters["sweeps"]).result(10) == 2 * AZIMUTHS
    with pytest.raises(KeyError):
        running.worker.ask(lambda _: {}["nothing"]).result(10)
    assert running.worker.failures == 0
    assert running.worker.turn.scan == 0
    assert running.worker.turn.plots == 0
    running.worker.stop()
    assert running.worker.ask(lambda chain: chain.time).result(0) == pytest.approx(T0 + 1 + 95 / 96, abs=1e-3)


def test_the_same_detector_goes_on_at_once_with_another_extractor(running: Running) -> None:
    before = running.turns(0, 4)
    told: list[bool] = []
    running.worker.succeed(small_chain(extractor=Manhattan(min_cells=3)), told.append)
    after = running.turns(4, 6)
    assert told == [True]
    assert (before[0].closed_from, after[-1].closed_to) == (0, 6 * AZIMUTHS)
    assert plots(after[:BLOCKS]) >= 3, "it detects in its first turn"
    assert running.worker.counters()["sweeps"] == 6 * AZIMUTHS
    assert running.worker.counters()["parts_changed"] == 1
    assert running.worker.scans_left is None


def test_another_detector_learns_beside_the_running_one(running: Running) -> None:
    running.turns(0, 3)
    told: list[bool] = []
    successor = small_chain(Adaptive(learn_scans=4))
    running.worker.succeed(successor, told.append)
    per_turn = [plots(running.turns(scan, scan + 1)) for scan in range(3, 10)]
    assert min(per_turn) >= 3, "no turn without plots, before, at and after the change"
    assert told == [True]
    assert running.worker.chain is successor
    closed = [one.closed_to for one in running.sectors]
    assert closed == sorted(closed)
    for one, other in zip(running.sectors, running.sectors[1:], strict=False):
        assert other.closed_from == one.closed_to


def test_turns_to_go_are_counted_and_a_change_of_mind_is_heard(running: Running) -> None:
    running.turns(0, 2)
    told: list[bool] = []
    running.worker.succeed(small_chain(Adaptive(learn_scans=3)), told.append)
    left = []
    for scan in range(2, 5):
        running.turns(scan, scan + 1)
        left.append(running.worker.scans_left)
    assert left == [3, 3, 2]
    running.worker.succeed(None, told.append)
    running.turns(5, 12)
    assert told == []
    assert running.worker.scans_left is None
    assert isinstance(running.worker.chain.detector, Hybrid)


def test_turns_that_were_not_received_teach_nothing(running: Running) -> None:
    running.turns(0, 2)
    told: list[bool] = []
    successor = small_chain(Adaptive(learn_scans=3))
    running.worker.succeed(successor, told.append)
    running.turns(2, 4)
    per_turn = [plots(running.turns(scan, scan + 1)) for scan in range(50, 55)]
    assert min(per_turn[1:]) >= 3, "no turn without plots after the gap"
    assert told == [True]
    assert running.worker.chain is successor


def test_a_successor_that_fails_leaves_the_running_one(running: Running) -> None:
    running.turns(0, 2)
    told: list[bool] = []
    running.worker.succeed(small_chain(Adaptive(learn_scans=2), east=500.0), told.append)
    after = running.turns(2, 8)
    assert told == [False]
    assert running.worker.failures == 1
    assert plots(after) >= 3 * 5


def test_a_flood_degrades_the_radar_until_it_is_over() -> None:
    class Clock:
        now = 0.0

        def __call__(self) -> float:
            return self.now

    running, clock = Running(small_chain(Hybrid(max_runs=200))), Clock()
    running.worker.cuts._clock = clock
    running.worker.start()
    try:
        running.turns(0, 2)
        assert running.worker.status == "ok"
        sectors = running.turns(2, 3, storm=True)
        assert any(one.degraded for one in sectors)
        assert running.worker.status == "degraded"
        assert running.worker.cuts.words().startswith("detections cut, ")
        counted = running.worker.counters()
        assert 0 < counted["degraded_blocks"] <= BLOCKS
        assert 0 < counted["degraded_sweeps"] <= AZIMUTHS
        clock.now = 10.5
        running.turns(3, 5)
        assert running.worker.status == "ok"
        assert running.worker.cuts.words() == ""
    finally:
        running.worker.stop()


class Watched:
    """A worker of which every record is kept, with a chain that others may interrupt while it works."""

    def __init__(self) -> None:
        self.events: list[str] = []
        self.during: Any = lambda: None
        chain = small_chain(bearing=Moments())
        work = chain.process

        def process(block: Sweeps) -> SectorPlots:
            self.events.append(f"work {block.row[0]} {chain.expected.shape[1]}")
            self.during()
            made = work(block)
            self.events.append(f"done {block.row[0]} {chain.expected.shape[1]}")
            return made

        chain.process = process  # type: ignore[method-assign]
        self.worker = RadarWorker(chain.site, chain, 64, lambda sector: True, self.record)

    def record(self, chain: RadarChain, block: Sweeps) -> None:
        self.events.append(f"record {block.row[0]} {chain.expected.shape[1]}")


def test_a_block_is_recorded_before_the_chain_works_on_it_with_what_it_expects() -> None:
    watched = Watched()
    worker, blocks = watched.worker, list(turn(0))
    column = np.zeros(3)
    watched.during = lambda: worker.expect(column, column, column, column + 0.1)
    worker.start()
    worker.put(blocks[0])
    until(lambda: len(watched.events) == 3, "the first block is worked on")
    worker.put(blocks[1])
    until(lambda: len(watched.events) == 6, "the second block is worked on")
    worker.stop()
    first, second = blocks[0].row[0], blocks[1].row[0]
    assert watched.events == [
        f"record {first} 0", f"work {first} 0", f"done {first} 0",
        f"record {second} 3", f"work {second} 3", f"done {second} 3",
    ]  # fmt: skip


def test_a_chain_that_takes_over_is_told_what_to_expect() -> None:
    running = Running(small_chain(bearing=Moments()))
    running.worker.start()
    running.worker.expect([1.0], [2.0], [0.5], [0.1])
    running.turns(0, 1)
    other = small_chain(extractor=Manhattan(min_cells=3), bearing=Moments())
    running.worker.succeed(other, lambda _: None)
    running.turns(1, 2)
    assert running.worker.chain is other
    assert other.expected.shape == (4, 1)
    running.worker.stop()


def test_a_block_that_cannot_be_recorded_is_counted_and_the_next_is_worked_on() -> None:
    sectors: list[SectorPlots] = []
    chain = small_chain()
    recorded: list[int] = []

    def record(_chain: RadarChain, block: Sweeps) -> None:
        recorded.append(len(block))
        if len(recorded) == 1:
            raise RuntimeError("broken")

    worker = RadarWorker(chain.site, chain, 64, lambda sector: sectors.append(sector) or True, record)
    worker.start()
    for block in turn(0):
        worker.put(block)
    until(lambda: len(recorded) == BLOCKS and not len(worker.queue), "all are recorded")
    worker.ask(lambda _: None).result(10)
    worker.stop()
    assert worker.failures == 1
    assert len(sectors) == BLOCKS

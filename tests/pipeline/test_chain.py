"""The chain of one radar: order, gaps, late blocks, restart, the picture of the newest turn."""

from __future__ import annotations

import contextlib
import itertools
from dataclasses import replace

import numpy as np
import pytest

from pipeline import parts
from pipeline.chain import RadarChain
from pipeline.contracts.detect import Detector
from pipeline.contracts.extract import Extractor
from pipeline.detect.adaptive import Adaptive
from pipeline.detect.clutter_map import ClutterMap
from pipeline.detect.hybrid import Hybrid
from pipeline.extract.hysteresis import Hysteresis
from pipeline.extract.manhattan import Manhattan
from pipeline.state import StateError
from pipeline.tables import Plots, SectorPlots, Sweeps, TableError
from tests.pipeline.contracts.extract import assert_same_plots
from tests.support.video_scenes import SMALL, busy_video, cut, site, strip

EIGHTHS = range(0, 96, 12)


def chain(**setting: int) -> RadarChain:
    return RadarChain(site(), 3, Hybrid(**setting), Manhattan())


def blocks(scans: int = 4) -> list[Sweeps]:
    return [one for block in strip(busy_video(SMALL, scans), SMALL) for one in cut(block, EIGHTHS)]


def run(target: RadarChain, these: list[Sweeps]) -> list[SectorPlots]:
    return [target.process(one) for one in these]


def plots_of(sectors: list[SectorPlots]) -> Plots:
    return Plots.concatenate([one.plots for one in sectors])


def test_sectors_join_without_gap_and_plots_lie_in_what_was_open() -> None:
    sectors = run(chain(), blocks())
    assert sectors[0].closed_from == 0
    for before, after in itertools.pairwise(sectors):
        assert after.closed_from == before.closed_to
    for one in sectors:
        row = one.plots.scan * SMALL.azimuths + one.plots.azimuth / SMALL.azimuth_step_rad
        assert (row >= one.closed_from - 1e-6).all()
    plots = plots_of(sectors)
    assert (plots.radar == 3).all()
    assert set(plots.scan) == {1, 2, 3}
    # four targets a scan; the first of them lies across north and belongs to the scan of its centre
    assert (np.bincount(plots[plots.cells > 8].scan)[1:3] == 4).all()
    assert (np.diff(plots.time) > -0.2).all()


def test_block_size_does_not_matter() -> None:
    whole, small = chain(), chain()
    a = plots_of([*run(whole, strip(busy_video(SMALL, 4), SMALL)), whole.flush()])
    b = plots_of([*run(small, blocks()), small.flush()])
    assert_same_plots(a, b)


def test_late_sweeps_are_refused_and_counted() -> None:
    these = blocks()
    target = chain()
    run(target, these[:20])
    before = target.newest.copy()
    again = target.process(these[18])
    assert len(again.plots) == 0
    assert again.closed_from == again.closed_to
    np.testing.assert_array_equal(target.newest, before)
    assert target.counters["late_blocks"] == 1
    assert target.counters["late_sweeps"] == 12
    scan = strip(busy_video(SMALL, 4), SMALL)[2]
    target.process(scan)  # its first 48 rows were worked on
    assert target.counters["late_sweeps"] == 12 + 48
    assert target.counters["sweeps"] == 20 * 12 + 48


def test_gaps_are_counted_and_shown_as_nothing() -> None:
    these = blocks(6)
    target = chain()
    run(target, these[:12] + these[14:20])
    assert target.counters["missing_sweeps"] == 24
    assert not target.newest[48:72].any()
    assert target.newest[:48].any(axis=1).all()
    target.process(these[-8])  # two scans later
    assert target.newest[:12].any()
    assert not target.newest[12:].any()
    assert target.counters["missing_sweeps"] == 24 + 20 * 12
    assert target.process(these[-7]).degraded is False


def test_newest_is_the_newest_turn_in_place() -> None:
    target = chain()
    kept = target.newest
    frames = busy_video(SMALL, 3)
    run(target, strip(frames, SMALL))
    assert target.newest is kept
    np.testing.assert_array_equal(kept, frames[2])


def test_a_restart_goes_on_where_it_was() -> None:
    these = blocks()
    straight = chain()
    wanted = plots_of([*run(straight, these), straight.flush()])
    first = chain()
    begun = run(first, these[:15])
    second = chain()
    second.restore(first.save())
    assert_same_plots(wanted, plots_of([*begun, *run(second, these[15:]), second.flush()]))


def test_a_state_of_other_parts_or_formats_is_refused() -> None:
    saved = chain().save()
    with pytest.raises(StateError, match=r"no 'chain\.rows'"):
        chain().restore({k: v for k, v in saved.items() if k != "chain.rows"})
    with pytest.raises(StateError, match="belongs to"):
        chain().restore({**saved, "chain.detect": np.array("Other()")})
    with pytest.raises(StateError, match="no 'level'"):
        chain().restore({k: v for k, v in saved.items() if k != "detect.level"})


def numbered_from_0(these: list[Sweeps]) -> list[Sweeps]:
    first = these[0].scan
    return [replace(one, scan=one.scan - first) for one in these]


@pytest.fixture(params=sorted(parts.available("detect")))
def detector(request: pytest.FixtureRequest) -> Detector:
    made: Detector = parts.build("detect", request.param)
    return made


GROUND = np.where(np.arange(SMALL.ranges) < SMALL.ranges // 2, 2, 4).astype(np.uint8) * np.ones((96, 1), np.uint8)


def over_ground(detector: Detector, extractor: Extractor | None = None) -> RadarChain:
    return RadarChain(site(), 3, detector, extractor or Manhattan(), surface=GROUND)


def test_what_was_learned_is_resumed_with_rows_that_begin_anew(detector: Detector) -> None:
    these = blocks(17)
    at = 14 * len(EIGHTHS)
    straight = over_ground(detector)
    run(straight, these[:at])
    saved = straight.save()
    wanted = [one.plots for one in run(straight, these[at:])]
    again = over_ground(detector, Manhattan(min_cells=1, max_open_runs=999))
    again.resume(saved)
    assert set(again.counters.values()) == {0}
    got = [one.plots for one in run(again, numbered_from_0(these[at:]))]
    learns_away = type(detector) is ClutterMap  # what stands still; the others see it in the first turn
    assert learns_away or sum(len(one) for one in got[: len(EIGHTHS)]) > 0
    # the target across north was begun before the restart
    for a, b in list(zip(wanted, got, strict=True))[2:]:
        assert_same_plots(a, replace(b, scan=b.scan + 14))
    assert again.counters["late_sweeps"] == 0
    twice = over_ground(detector, Hysteresis())
    twice.resume(again.save())
    assert learns_away or len(plots_of(run(twice, numbered_from_0(these[at : at + len(EIGHTHS)])))) > 0


def test_no_saved_number_does_harm(detector: Detector) -> None:
    these = blocks(3)
    first = over_ground(detector)
    run(first, these)
    saved = first.save()
    rng = np.random.default_rng(3)
    for name in [name for name in saved if name.startswith("detect.")]:
        array = saved[name]
        for _ in range(6):
            wrong = np.frombuffer(rng.bytes(array.nbytes), array.dtype).reshape(array.shape)
            target = over_ground(detector, Hysteresis())
            with contextlib.suppress(StateError):
                target.resume({**saved, name: wrong})
            run(target, these)


def test_a_state_from_the_middle_of_a_turn_is_resumed_too() -> None:
    these = blocks(17)
    at = 13 * len(EIGHTHS) + 3
    first = RadarChain(site(), 3, Adaptive(), Manhattan())
    run(first, these[:at])
    again = RadarChain(site(), 3, Adaptive(), Manhattan())
    again.resume(first.save())
    assert len(plots_of(run(again, numbered_from_0(these[14 * len(EIGHTHS) :])))) > 0


def test_what_cannot_be_resumed_is_refused_and_changes_nothing() -> None:
    these = blocks()
    saved = chain()
    run(saved, these[:12])
    kept = saved.save()
    cold = chain().save()
    for wrong, words in (
        ({**kept, "chain.site": np.array("elsewhere")}, "another site"),
        ({**kept, "chain.map": np.array("12345678")}, "another map"),
        ({**kept, "chain.detect": np.array("Hybrid(pfa=0.1)")}, "another detect"),
        ({**kept, "chain.rows": np.array([1, 2])}, "chain.rows"),
        ({**kept, "chain.rows": np.array([2**60, 0, 0])}, "cannot be true"),
        ({**kept, "chain.rows": np.array(["a", "b", "c"])}, "chain.rows"),
        ({**kept, "detect.cursor": kept["detect.cursor"] + 10**6}, "macro-cell"),
        ({**kept, "detect.level": kept["detect.level"].astype(np.float32)}, "level"),
        ({}, "chain.rows"),
    ):
        target = chain()
        with pytest.raises(StateError, match=words):
            target.resume(wrong)
        for name, array in target.save().items():
            np.testing.assert_array_equal(array, cold[name])
    with pytest.raises(StateError, match="not begun"):
        saved.resume(kept)


def test_a_chain_takes_over_between_two_blocks() -> None:
    these = blocks(8)
    at = 4 * len(EIGHTHS)
    old = chain()
    before = run(old, these[:at])
    new = RadarChain(site(), 3, Adaptive(learn_scans=2), Manhattan())
    assert not new.detects_like(old)
    assert new.scans_to_learn == 2
    for one in these[2 * len(EIGHTHS) : at]:
        new.learn(one)
    last = old.flush()
    new.take_over(old)
    after = run(new, these[at:])
    for one, other in itertools.pairwise([*before, last, *after]):
        assert other.closed_from == one.closed_to
    assert len(plots_of(after[: len(EIGHTHS)])) > 0, "it has learned beside the other, and detects at once"
    assert new.newest is old.newest
    counted, stood = new.counters, old.counters
    assert counted["sweeps"] == 8 * SMALL.azimuths
    assert counted["plots"] == stood["plots"] + sum(len(one.plots) for one in after)
    assert stood["plots"] == sum(len(one.plots) for one in before) + len(last.plots)
    assert all(counted[name] >= count for name, count in stood.items())
    assert new.process(these[at - 1]).plots.time.size == 0
    assert new.counters["late_blocks"] == 1


def test_the_same_detector_goes_on_with_what_it_knows() -> None:
    these = blocks(8)
    at = 4 * len(EIGHTHS)
    straight, old = chain(), chain()
    run(old, these[:at])
    run(straight, these[:at])
    old.flush()
    new = RadarChain(site(), 3, Hybrid(), Manhattan(min_cells=2))
    assert new.detects_like(old)
    new.take_over(old)
    run(new, these[at:])
    run(straight, these[at:])
    for name, array in straight.save().items():
        if name.startswith("detect."):
            np.testing.assert_array_equal(array, new.save()[name])
    elsewhere = RadarChain(replace(site(), east=5.0), 3, Hybrid(), Manhattan())
    with pytest.raises(ValueError, match="take over"):
        elsewhere.take_over(new)


def test_a_flood_is_seen() -> None:
    rng = np.random.default_rng(1)
    frames = busy_video(SMALL, 4)
    frames[2] = rng.integers(0, 256, frames[2].shape, dtype=np.uint8)
    target = chain(max_runs=200)
    sectors = run(target, strip(frames, SMALL))
    assert [one.degraded for one in sectors] == [False, False, True, False]
    assert target.counters["degraded_blocks"] == 1
    assert target.counters["degraded_sweeps"] > 1
    assert len(sectors[3].plots) > 0


def test_what_does_not_fit_is_refused_and_changes_nothing() -> None:
    these = blocks()
    target = chain()
    run(target, these[:3])
    good = these[3]
    nan_time = good.time.copy()
    nan_time[2] = np.nan
    for bad in (
        Sweeps(0, 0, good.row, good.azimuth, good.time, good.amplitude[:, :100]),
        Sweeps(0, 0, good.row + 90, good.azimuth, good.time, good.amplitude),
        Sweeps(0, -1, good.row, good.azimuth, good.time, good.amplitude),
        Sweeps(0, 0, good.row, good.azimuth, nan_time, good.amplitude),
    ):
        with pytest.raises(TableError):
            target.process(bad)
    assert target.counters["sweeps"] == 36
    assert_same_plots(plots_of(run(target, these[3:])), plots_of(run(chain(), these)))


def test_an_empty_block_is_nothing() -> None:
    target = chain()
    empty = blocks()[0]
    nothing = Sweeps(0, 0, empty.row[:0], empty.azimuth[:0], empty.time[:0], empty.amplitude[:0], last=True)
    assert len(target.process(nothing).plots) == 0
    assert target.counters["blocks"] == 0


def test_stages_are_timed_with_the_clock_that_is_given() -> None:
    ticks = itertools.count()
    target = RadarChain(site(), 0, Hybrid(), Manhattan(), clock=lambda: float(next(ticks)))
    target.process(blocks()[0])
    assert target.timings == {"keep": 1.0, "detect": 1.0, "extract": 1.0}


def test_warming_compiles_everything_and_leaves_the_chain_alone() -> None:
    from pipeline.detect.hybrid import _detect
    from pipeline.kernels.components import _take_rows

    target = chain()
    before = target.save()
    target.warm()
    for name, array in target.save().items():
        np.testing.assert_array_equal(array, before[name])
    compiled = len(_detect.signatures), len(_take_rows.signatures)
    these = blocks()
    these[3].amplitude.flags.writeable = False
    run(target, these)
    assert (len(_detect.signatures), len(_take_rows.signatures)) == compiled

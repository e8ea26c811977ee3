"""What a turn of full size may cost: memory, and storms of false alarms."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest
from numpy.typing import NDArray

from pipeline.chain import RadarChain
from pipeline.detect.hybrid import Hybrid
from pipeline.extract.manhattan import Manhattan
from pipeline.parts import available, build
from pipeline.tables import Plots, VideoFormat
from tests.support.video_scenes import cut, packed, rayleigh, site, strip


def flood(runs: int) -> list[NDArray[np.uint8]]:
    """A calm turn of full size, and the same with strong single cells all over it."""
    rng = np.random.default_rng(2)
    calm = rayleigh(rng, (4096, 1024), 25.0)
    calm[1000:1040, 500:510] = 220
    return [calm, np.where(rng.random(calm.shape, np.float32) < runs / calm.size, np.uint8(200), calm)]


@pytest.mark.parametrize("pieces", [1, 32])
def test_a_storm_is_cut_counted_and_over_when_it_is_over(pieces: int) -> None:
    video = VideoFormat()
    calm, storm = flood(238_000)
    target = RadarChain(site(video), 0, Hybrid(), Manhattan())
    frames = np.stack([calm, calm, storm, calm])
    degraded, plots = [], []
    for block in strip(frames, video):
        sectors = [target.process(one) for one in cut(block, range(0, 4096, 4096 // pieces))]
        degraded.append(sum(one.degraded for one in sectors))
        plots.append(sum(len(one.plots) for one in sectors))
    assert degraded[:2] == [0, 0]
    assert degraded[2] > pieces // 2
    assert degraded[3] <= 1 + pieces // 8
    assert target.counters["degraded_sweeps"] > 2000
    assert target.counters["runs_dropped"] == 0
    assert plots[2] <= 50_000
    assert 1 <= plots[1] < 60


def test_more_open_runs_than_there_is_room_for_are_dropped_and_counted() -> None:
    video = VideoFormat()
    storm = flood(238_000)[1]
    part = Manhattan(max_open_runs=400)
    state = part.start(site(video))
    block = strip(storm[None], video)[0]
    found = packed(storm == 200)
    plots = Plots.concatenate([part(block, found, state), part.flush(state)])
    dropped = state.counters["runs_dropped"]
    assert 0 < dropped < 238_000
    cells = int((storm == 200).sum())
    assert cells - 2 * dropped < plots.cells.sum() <= cells - dropped


def test_a_turn_allocates_nothing_of_the_order_of_the_frame() -> None:
    video = VideoFormat()
    calm = flood(0)[0]
    for extractor in (build("extract", name, {}) for name in available("extract")):
        target = RadarChain(site(video), 0, Hybrid(), extractor)
        turns = strip(np.stack([calm] * 4), video)
        for turn in turns[:3]:
            target.process(turn)
        tracemalloc.start()
        before = tracemalloc.get_traced_memory()[0]
        sector = target.process(turns[3])
        peak = tracemalloc.get_traced_memory()[1] - before
        tracemalloc.stop()
        assert len(sector.plots) > 0
        # a bit mask is an eighth of a frame's bytes, and there may be a second one of growth
        masks = (1 + hasattr(extractor, "growth_db")) * calm.size // 8
        assert peak < masks + 512 * 1024 < calm.size / 2

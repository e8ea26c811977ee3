"""The CFAR experiments measure what they say: short seeded versions."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binom

from pipeline.lab.evaluate import Experiment, experiments
from pipeline.lab.evaluate.cfar_cases import (
    CASES,
    Watch,
    every_part,
    false_alarms,
    limits_of,
    margins,
    shift_for,
)
from pipeline.lab.evaluate.cfar_clutter import CfarClutter
from pipeline.lab.evaluate.cfar_law import Law, swerling3_draw
from pipeline.lab.evaluate.cfar_rain import CfarRain
from pipeline.lab.evaluate.cfar_scenes import CfarScenes, ground_of
from pipeline.lab.evaluate.cfar_table1 import TABLE, CfarTable1, predicted
from pipeline.lab.evaluate.cfar_targets import FAST, KINDS, POINT, SHIFTS, SLOW, detection, place
from pipeline.lab.evaluate.ground import ASPHALT, WEAK, Ground
from pipeline.parts import available

HYBRID = tuple(case for case in CASES if case.label == "hybrid")
SHORT = {
    "scenes": replace(
        CfarScenes(), trials=2, detectors=HYBRID, scenes=("heterogeneous",), learn_scans=4, ages=(1, 6), listed=(1, 6)
    ),
    "rain": replace(CfarRain(), trials=2, detectors=HYBRID, scenes=("held out",), rates=(16.0,), learn_scans=5, early=3,
                    every=20),
    "clutter": replace(CfarClutter(), trials=2, detectors=HYBRID, learn_scans=4, laws=(Law(), Law("weibull", 1.4))),
    "table": replace(CfarTable1(), trials=2, runs=2, draws=8),
}  # fmt: skip


def run(experiment: Experiment, seed: int = 1) -> list[dict[str, np.ndarray]]:
    return [
        dict(experiment.trial(np.random.default_rng([seed, k]), k, time.perf_counter)) for k in range(experiment.trials)
    ]


@pytest.mark.parametrize("name", SHORT)
def test_the_same_seed_gives_the_same_rows_and_figures(name: str) -> None:
    experiment = SHORT[name]
    first, second = run(experiment), run(experiment)
    for one, other in zip(first, second, strict=True):
        assert one.keys() == other.keys()
        for key in one:
            np.testing.assert_array_equal(one[key], other[key])
    rows = experiment.rows(first)
    assert rows == experiment.rows(second)
    assert len({row.name for row in rows}) == len(rows)
    for row in rows:
        assert row.low <= row.measured + 1e-12, row
        assert row.measured <= row.high + 1e-12, row
    assert all(one.lines or one.pictures for one in experiment.figures(first))


def test_closed_form_and_the_detector_itself_agree_and_are_the_paper_s() -> None:
    experiment = replace(CfarTable1(), trials=3, runs=12, draws=128)
    counted = 100 * np.mean([one["probability"] for one in run(experiment)], axis=0)
    for k, line in enumerate(TABLE):
        for at, scan in enumerate((1, 15)):
            closed = predicted(line, scan, 2.1, 1e-6, 64)
            assert closed == pytest.approx(line.paper[at], abs=1.5)
            # 36 runs of 128 draws, whose threshold they share: 5 standard deviations of the draws are 2.6 points
            assert counted[k, at] == pytest.approx(closed, abs=2.6)


@pytest.mark.parametrize("case", every_part(), ids=lambda case: case.label)
def test_probability_from_thresholds_agrees_with_counted_false_alarms(case) -> None:  # type: ignore[no-untyped-def]
    scene = Ground.homogeneous(3).build()
    chance = np.random.default_rng(11)
    watch = Watch((case,), scene, 1e-3)
    kind = np.zeros(scene.kind.shape, np.int64)
    for block in scene.clutter(chance, range(20)):
        watch.learn(block)
    counted, expected, tries = 0, 0.0, 0
    for scan in range(20, 28):
        mean = scene.mean_db(scan)
        limit, found = next(watch.measure(scene.sweeps(scan, scene.amplitude(chance, mean)), mean))
        expected += false_alarms(margins(limit, mean, kind, 1), scene.ground.law) * found.size
        counted += int(found.sum())
        tries += found.size
    chances = binom(tries, expected / tries)
    # neighbours share a limit, which makes counts vary more than a binomial: hence the half percent
    assert chances.cdf(counted + 0.005 * counted) > 1e-4
    assert chances.sf(counted - 0.005 * counted) > 1e-4


def test_a_shift_gives_the_probability_asked_for_and_is_monotone() -> None:
    chance = np.random.default_rng(2)
    limit = chance.normal(12.0, 1.0, (50, 60)).astype(np.float32)
    limit[0, :5] = np.inf
    counts = margins(limit, np.zeros_like(limit), np.zeros(limit.shape, np.int64), 1)
    law = Law()
    exact = np.where(np.isinf(limit), 0.0, law.survival(np.where(np.isinf(limit), 0.0, limit)))
    assert false_alarms(counts, law) == pytest.approx(exact.mean(), rel=5e-3)
    shifts = [shift_for(counts, law, pfa) for pfa in (1e-3, 1e-4, 1e-6, 1e-8)]
    assert np.all(np.diff(shifts) > 0)
    for pfa, shift in zip((1e-3, 1e-4, 1e-6, 1e-8), shifts, strict=True):
        assert false_alarms(counts, law, shift) == pytest.approx(pfa, rel=1e-3)
    alarms = [false_alarms(counts, law, shift) for shift in np.arange(-5.0, 8.0, 0.5)]
    assert np.all(np.diff(alarms) < 0)


def test_cells_left_out_do_not_count_and_255_detects_nothing() -> None:
    thresholds = np.array([[40, 255], [40, 40]], np.uint8)
    limit = limits_of(thresholds, 0.3125)
    assert np.isinf(limit[0, 1])
    assert limit[0, 0] == pytest.approx(40.5 * 0.3125)
    counts = margins(limit, np.zeros((2, 2), np.float32), np.array([[0, 0], [-1, 1]]), 2)
    assert counts.sum(axis=1).tolist() == [2, 1]
    assert false_alarms(counts[:1], Law()) == pytest.approx(Law().survival(np.array(12.65)) / 2, rel=0.02)


def test_detection_probability_is_what_is_drawn() -> None:
    scene = Ground.homogeneous().build()
    chance = np.random.default_rng(4)
    targets = place(scene, chance, 12.0)
    cells, kinds = targets.cells(0)
    mean = scene.mean_db(0)
    limit = np.full(mean.shape, scene.asphalt_db + 10.0, np.float32)
    pd = detection(limit, mean, targets, cells, kinds)
    assert np.all(np.diff(pd[POINT]) <= 0)
    n = 100_000
    drawn = swerling3_draw(chance, np.full(n, scene.asphalt_db), np.full(n, targets.power_db[POINT]))
    expected = np.interp(0.0, SHIFTS, pd[POINT])
    assert (drawn > scene.asphalt_db + 10.0).mean() == pytest.approx(expected, abs=4 * 0.5 / np.sqrt(n))


def test_targets_stand_on_their_ground_apart_from_each_other_and_movers_move() -> None:
    scene = ground_of("heterogeneous", 5).build()
    targets = place(scene, np.random.default_rng(6), 20.5)
    assert len(targets.cells(-1)[0]) == 0
    before = targets.cells(0)
    for age in range(0, 130, 7):
        cells, kinds = targets.cells(age)
        assert set(kinds) == set(range(len(KINDS)))
        assert len(np.unique(cells)) == len(cells)
        ground = scene.kind.ravel()[cells]
        assert ((ground == ASPHALT) | ((ground == WEAK) & (kinds == len(KINDS) - 1))).all()
        assert targets.near.ravel()[cells].all()
    later = targets.cells(9)
    for kind, moves in ((POINT, False), (SLOW, True), (FAST, True)):
        same = np.array_equal(before[0][before[1] == kind], later[0][later[1] == kind])
        assert same is not moves


def test_every_detector_of_the_registry_is_measured() -> None:
    assert {case.part for case in every_part()} == set(available("detect"))
    for case in every_part():
        case.detector(1e-6)


def test_the_experiments_are_found_and_short_versions_are_shorter() -> None:
    for name in ("cfar-table1", "cfar-scenes", "cfar-rain", "cfar-clutter"):
        made = experiments()[name]()
        assert made.quick().trials < made.trials
        assert made.title
        assert made.source
        assert made.reading

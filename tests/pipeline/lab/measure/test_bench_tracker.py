"""The bench of the tracker runs, and its rows say what was measured; how fast it was is nobody's business here."""

from __future__ import annotations

import itertools
import math
import re

import numpy as np
import pytest

from pipeline.lab.measure import bench_tracker as bench
from pipeline.lab.measure.stopwatch import BenchRow, Stopwatch, Work
from pipeline.lab.measure.tracker_parts import bench_tracker_parts
from pipeline.lab.measure.tracker_workload import Field, make_bench_tracker
from pipeline.sites import RadarSite
from pipeline.tables import MARKS_A_TURN
from pipeline.track.tracker import Tracker

FRAMES = np.zeros((3, 4, 4), np.uint8)


def watch(repeats: int = 3) -> Stopwatch:
    """Every reading of its clock is a second after the one before."""
    ticks = itertools.count()
    return Stopwatch(lambda: float(next(ticks)), repeats, FRAMES)


@pytest.fixture(scope="module")
def rows() -> list[BenchRow]:
    return bench.bench_tracker(watch(), targets=60, many=300, settle=6)


def test_the_rows_and_what_is_wanted_of_them(rows: list[BenchRow]) -> None:
    wanted = {"one_sector": 8.0, "sectors_32": 20.0, "report_table": 1.0, "scaling_5000": 5.5}
    assert {row.name: row.most_ratio for row in rows} == pytest.approx(wanted)
    assert list(wanted) == [row.name for row in rows]
    assert all(row.ratio == row.least == 1.0 for row in rows)  # every step of this clock is 1


def test_targets_are_tracked_while_it_measures(rows: list[BenchRow]) -> None:
    notes = {row.name: row.note for row in rows}
    held = int(re.findall(r"(\d+) tracks", notes["report_table"])[0])
    assert 50 < held <= 70
    for name in ("one_sector", "sectors_32"):
        plots = int(re.findall(r"(\d+) plots", notes[name])[0])
        assert plots == pytest.approx(60 * 1.15, rel=0.15)
    assert "300 targets over 60" in notes["scaling_5000"]
    assert "no room" not in notes["scaling_5000"]
    assert "refuses" not in notes["scaling_5000"]


def test_with_too_little_capacity_fewer_targets_stand_for_many(monkeypatch: pytest.MonkeyPatch) -> None:
    def small(site: RadarSite, capacity: int = 2048) -> Tracker:
        if capacity > 2048:
            raise ValueError("too many")
        return make_bench_tracker(site, capacity)

    monkeypatch.setattr(bench, "make_bench_tracker", small)
    monkeypatch.setattr(bench, "FEWER", 100)
    row = bench.bench_tracker(watch(), targets=50, many=5000, settle=4)[-1]
    assert (row.ratio, row.least) == (50.0, 50.0)  # as long as 50 targets, for 100 of the 5000
    assert row.most_ratio == pytest.approx(1.1 * 100)
    assert "100 targets over 50" in row.note
    assert "refuses the capacity" in row.note


def test_plots_without_room_are_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bench, "TRACKS_PER_TARGET", 1)
    assert "found no room" in bench.bench_tracker(watch(), targets=50, many=100, settle=4)[-1].note


def test_works_are_timed_turn_about_and_warming_up_does_not_count() -> None:
    now, done = [0.0], list[tuple[str, int]]()
    spent = {"a": [50.0, 3.0, 5.0, 4.0], "b": [50.0, 0.0, 0.0, 0.0]}

    def clock() -> float:
        now[0] += 1.0
        return now[0]

    def prepared(name: str) -> Work:
        def prepare(turn: int) -> int:
            now[0] += 1000.0  # is not timed
            return turn

        def work(turn: int) -> None:
            done.append((name, turn))
            now[0] += spent[name][turn]

        return Work(name, prepare, work)

    times, floor = Stopwatch(clock, 3, FRAMES).turn_about([prepared("a"), prepared("b")], settle=1)
    assert done == [(name, turn) for turn in range(4) for name in "ab"]
    assert times.T.tolist() == [[4.0, 6.0, 5.0], [1.0, 1.0, 1.0]]
    assert floor.tolist() == [[1.0, 1.0]] * 3
    made = BenchRow.of("a", times[:, 0], 2.0 * floor[:, 0])
    assert (made.median_s, made.least_s, made.ratio, made.least) == (5.0, 4.0, 2.5, 2.0)


def test_a_row_as_a_document_has_its_bound_in_the_unit_of_its_ratio() -> None:
    row = BenchRow("a", 0.5, 0.4, 5.0, least=4.5, note="n", most_ratio=8.0)
    assert row.document() == {"name": "a", "ratio": 5.0, "least": 4.5, "wanted": 8.0, "note": "n"}
    assert BenchRow("a", 0.5, 0.4, 5.0, most_s=1.0).document()["wanted"] == 10.0
    assert BenchRow("a", 0.5, 0.4, 5.0).document()["wanted"] is None


def test_filter_and_association_by_themselves() -> None:
    made = {row.name: row for row in bench_tracker_parts(watch(), targets=40)}
    assert list(made) == ["filter", "associate", "filterpy"]
    assert [row.peer for row in made.values()] == [False, False, True]
    assert [row.name for row in bench_tracker_parts(watch(), targets=40, peers=False)] == ["filter", "associate"]


@pytest.mark.parametrize("targets", [200, 1000, 5000])
def test_the_field_grows_at_the_same_density_and_the_radar_covers_it(targets: int) -> None:
    field = Field(targets, seed=3)
    plots = field.scan(0)
    area = (2 * field.half) ** 2
    assert targets / area == pytest.approx(1000 / 6000.0**2)
    assert len(plots) / area == pytest.approx(1150 / 6000.0**2, rel=0.1)
    video = field.site.video
    assert video.ranges * video.range_step_m > math.sqrt(2) * field.half
    assert plots.range.max() < video.ranges * video.range_step_m


def test_sectors_are_the_turn_cut_up_and_the_same_seed_gives_the_same() -> None:
    whole, again, cut = (Field(200, seed=3) for _ in range(3))
    for turn in range(2):
        plots, pieces = whole.sectors(turn, 1)[0].plots, cut.sectors(turn, 32)
        assert plots.east.tolist() == again.scan(turn).east.tolist()
        assert len(pieces) == 32
        assert np.concatenate([one.plots.east for one in pieces]).tolist() == plots.east.tolist()
        assert [one.closed_from for one in pieces[1:]] == [one.closed_to for one in pieces[:-1]]
        assert pieces[-1].closed_to == (turn + 1) * 4096
        assert [one.mark.tolist() for one in pieces[1::2]] == [[MARKS_A_TURN * turn + k] for k in range(16)]
        assert [one.mark_time[0] for one in pieces[1::2]] == [1.7e9 + turn + (16 * k + 15) / 256 for k in range(16)]
        assert [len(one.mark) for one in pieces[::2]] == [0] * 16


@pytest.mark.parametrize("count", [2, 7, 4096])
def test_the_marks_of_the_field_do_not_depend_on_the_cut(count: int) -> None:
    whole, cut = Field(5, seed=3).sectors(2, 1), Field(5, seed=3).sectors(2, count)
    for name in ("mark", "mark_time"):
        assert np.concatenate([getattr(one, name) for one in cut]).tobytes() == getattr(whole[0], name).tobytes()
    assert whole[0].mark.tolist() == list(range(2 * MARKS_A_TURN, 3 * MARKS_A_TURN))

"""The bench of the front end runs and says what it measured."""

from __future__ import annotations

import itertools

import pytest

from pipeline.lab.measure.bench_frontend import bench_frontend
from pipeline.lab.measure.stopwatch import BenchRow
from pipeline.parts import available


@pytest.fixture(scope="module")
def rows() -> list[BenchRow]:
    ticks = itertools.count()
    return list(bench_frontend(lambda: float(next(ticks)), repeats=3, peers=False, settle=2))


def named(rows: list[BenchRow], kind: str) -> list[BenchRow]:
    return [row for row in rows if row.name.startswith(kind)]


def test_every_line_is_measured_and_related_to_the_floor(rows: list[BenchRow]) -> None:
    assert rows[0].name == "read the frame once"
    assert all(row.median_s == row.least_s == 1.0 and row.ratio == 1.0 for row in rows)  # every step of this clock is 1
    assert {row.name[len("detect (") : -1] for row in named(rows, "detect (")} == set(available("detect"))
    assert len(named(rows, "extract")) == 4 * len(available("extract"))
    assert len(named(rows, "detect and extract")) == 2 * len(available("extract"))
    assert len(named(rows, "whole scan")) == len(named(rows, "storm")) == 4


def test_as_many_runs_as_were_wanted(rows: list[BenchRow]) -> None:
    def runs(row: BenchRow) -> int:
        return int(row.name.rsplit(", ", 1)[1].split(" ")[0].replace(",", ""))

    for kind, wanted in (("extract (manhattan)", (3_000, 40_000, 112_000, 238_000)), ("detect and", (3_000, 40_000))):
        for row, many in zip(named(rows, kind), wanted, strict=False):
            assert runs(row) == pytest.approx(many, rel=0.1)


def test_bounds_stand_beside_the_figures(rows: list[BenchRow]) -> None:
    wanted = {row.name: row.wanted for row in rows}
    assert wanted["detect (hybrid)"] == "<= 1.5x"
    assert wanted["detect (adaptive)"] == "<= 4x"
    assert [row.wanted for row in named(rows, "detect and extract")] == ["<= 3x", "<= 15x"] * len(available("extract"))
    assert {row.wanted for row in named(rows, "storm")} == {"<= 1000 ms"}
    assert wanted["read the frame once"] == ""
    assert BenchRow("", 1.0, 1.0, 2.0, most_ratio=1.5).met is False
    assert BenchRow("", 1.0, 1.0, 2.0, most_ratio=2.0, most_s=0.5).met is False
    assert BenchRow("", 1.0, 1.0, 2.0).met is True

"""The bench of the front end runs and says what it measured."""

from __future__ import annotations

import itertools

from pipeline.measure.bench_frontend import BenchRow, bench_frontend


def test_every_line_is_measured_and_related_to_the_floor() -> None:
    ticks = itertools.count()
    rows: list[BenchRow] = list(bench_frontend(lambda: float(next(ticks)), repeats=3, peers=False))
    assert [row.name.split(" (")[0].split(",")[0] for row in rows] == [
        "read the frame once",
        "detect",
        "detect",
        "extract",
        "extract",
        "whole scan",
        "whole scan",
        "whole scan",
        "whole scan",
    ]
    assert all(row.median_s == row.least_s == 1.0 and row.ratio == 1.0 for row in rows)  # every step of this clock is 1
    runs = [int(row.name.split(", ")[1].split(" ")[0].replace(",", "")) for row in rows[3:5]]
    assert 2000 < runs[0] < 4000
    assert 38_000 < runs[1] < 42_000

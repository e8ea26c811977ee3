"""Every bench writes its rows as JSON in one form, and says before it measures when it cannot."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner, Result

import app.bench.picture
import app.bench.report
import app.bench.soak
from app.bench.soak import Soak
from app.cli import app as command_line
from pipeline.lab.measure import bench_frontend, bench_tracker
from pipeline.lab.measure.picture_quality import QualityRow, Score
from pipeline.lab.measure.stopwatch import BenchRow, Stopwatch

TIMED = {"name", "ratio", "least", "wanted"}
FIGURE = {"name", "value", "bound", "met"}


@pytest.fixture(autouse=True)
def environment_as_it_was(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("OMP", "OPENBLAS", "MKL"):
        monkeypatch.setenv(f"{name}_NUM_THREADS", "1")  # the command sets them; this takes it back


@pytest.fixture
def small_tracker(monkeypatch: pytest.MonkeyPatch) -> None:
    whole = bench_tracker.bench_tracker

    def small(watch: Stopwatch, seed: int = 1) -> list[BenchRow]:
        return whole(Stopwatch(watch.clock, 3, watch.frames[:, :8]), targets=30, many=60, settle=4, seed=seed)

    monkeypatch.setattr(bench_tracker, "bench_tracker", small)


def run(*words: str) -> Result:
    return CliRunner().invoke(command_line, ["bench", *words], env={"COLUMNS": "160"})


def written(file: Path) -> list[dict[str, Any]]:
    document = json.loads(file.read_text())
    assert list(document) == ["rows"]
    rows: list[dict[str, Any]] = document["rows"]
    return rows


@pytest.mark.usefixtures("small_tracker")
def test_the_tracker(tmp_path: Path) -> None:
    result = run("tracker", "--json", str(tmp_path / "rows.json"))
    assert result.exit_code == 0, result.output
    rows = written(tmp_path / "rows.json")
    assert [row["name"] for row in rows] == ["one_sector", "sectors_32", "report_table", "scaling_5000"]
    assert [row["wanted"] for row in rows[:3]] == [8.0, 20.0, 1.0]
    for row in rows:
        assert set(row) >= TIMED
        assert row["ratio"] > 0
        assert row["least"] > 0
        assert row["name"] in result.output


def test_fewer_turns_than_thirty_are_refused() -> None:
    assert run("tracker", "--turns", "29").exit_code == 2


def test_the_picture(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    score = Score(asked={"manoeuvring": 10}, seen={"manoeuvring": 10}, speed=[7.0])
    monkeypatch.setattr(app.bench.picture, "demo_quality", lambda scans, progress, seed: score)
    result = run("picture", "--json", str(tmp_path / "rows.json"))
    assert result.exit_code == 0, result.output
    rows = {row["name"]: row for row in written(tmp_path / "rows.json")}
    assert len(rows) == len(score.rows())
    assert all(set(row) >= FIGURE for row in rows.values())
    told = {name: [rows[name][key] for key in ("value", "bound", "met")] for name in rows}
    assert told["target report, manoeuvring area"] == [1.0, 0.99, True]
    assert told["velocity, 90 %"] == [7.0, 5.0, False]
    assert told["target report, apron"] == [None, 0.9, None]  # nothing was there to measure


def test_the_soak(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(app.bench.soak, "soak", lambda *_: Soak(3, 12.0, (200.0, 210.0, 215.0)))
    result = run("soak", "--json", str(tmp_path / "rows.json"))
    assert result.exit_code == 0, result.output
    assert [row["value"] for row in written(tmp_path / "rows.json")] == [12.0, 215.0, 15.0]


@pytest.mark.usefixtures("small_tracker")
def test_everything_in_one_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def front_end(*_: Any) -> Iterator[BenchRow]:
        yield BenchRow("detect", 0.5, 0.4, 5.0, least=4.5, most_s=1.0)

    def service(*_: Any) -> Iterator[QualityRow]:
        yield QualityRow("delay", 120.0, "ms", 150.0)

    monkeypatch.setattr(bench_frontend, "bench_frontend", front_end)
    monkeypatch.setattr(app.bench.report, "service_rows", service)
    result = run("--no-peers", "--repeats", "3", "--json", str(tmp_path / "rows.json"))
    assert result.exit_code == 0, result.output
    rows = written(tmp_path / "rows.json")
    assert rows[0] | {"wanted": 10.0, "ratio": 5.0, "least": 4.5} == rows[0]
    assert [row["name"] for row in rows[1:-1]][:1] == ["one_sector"]
    assert {"filter", "associate"} <= {row["name"] for row in rows}
    assert rows[-1]["met"] is True
    assert all(set(row) >= TIMED or set(row) >= FIGURE for row in rows)


@pytest.mark.parametrize("command", [[], ["tracker"], ["picture"], ["soak"]])
def test_a_file_that_cannot_be_written_is_refused_before_measuring(command: list[str], tmp_path: Path) -> None:
    for path in (tmp_path, tmp_path / "none" / "rows.json"):
        result = run(*command, "--json", str(path))
        assert result.exit_code == 2
    assert list(tmp_path.iterdir()) == []


def test_json_before_the_name_of_a_bench_is_refused(tmp_path: Path) -> None:
    assert run("--json", str(tmp_path / "rows.json"), "soak").exit_code == 2


def test_figures_that_are_no_numbers_are_null() -> None:
    assert QualityRow("a", float(np.inf), bound=1.0).document()["value"] is None

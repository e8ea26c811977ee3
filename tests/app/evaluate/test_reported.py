"""Files of target reports for the experiments that work on some."""

from __future__ import annotations

import gzip
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from app.cli import app
from app.evaluate.reported import recorded_reports, shipped_reports
from app.ingest.recording import RecordingError
from tests.pipeline.lab.evaluate.checks import check, read_strictly

REPORTS: list[dict[str, Any]] = [
    {"time": 1.6e9 + t, "lat": 48.7 + 1e-4 * t, "lon": 2.4, "address": "39ABCD", "speed_mps": 11.1, "course_deg": 180.0}
    for t in range(30)
]


def written(path: Path, text: str) -> Path:
    data = text.encode()
    path.write_bytes(gzip.compress(data) if path.suffix == ".gz" else data)
    return path


@pytest.mark.parametrize("name", ["reports.json", "reports.json.gz"])
@pytest.mark.parametrize("lines", [True, False])
def test_an_array_or_one_report_a_line_plain_or_packed(tmp_path: Path, name: str, lines: bool) -> None:
    text = "\n".join(map(json.dumps, REPORTS)) + "\n" if lines else json.dumps(REPORTS)
    read = recorded_reports(written(tmp_path / name, text))
    assert len(read.reports) == 30
    assert (read.name, read.smoothed) == (name, False)
    assert set(read.reports.address.tolist()) == {"39abcd"}
    np.testing.assert_allclose(read.reports.east, 0.0, atol=0.1)
    assert np.median(read.reports.north) == pytest.approx(0.0, abs=0.1)
    np.testing.assert_allclose(np.diff(read.reports.north), 11.12, atol=0.1)


def test_local_metres_are_counted_from_what_is_on_the_ground(tmp_path: Path) -> None:
    flying = [{**one, "lat": 49.5, "on_ground": False} for one in REPORTS * 2]
    read = recorded_reports(written(tmp_path / "a.json", json.dumps([*REPORTS, *flying])))
    assert np.median(read.reports.north[:30]) == pytest.approx(0.0, abs=0.1)
    assert read.reports.north[-1] > 80_000


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("[]", "no target reports"),
        ("", "not JSON"),
        ('[{"time": 1}]', "lat"),
        ('{"time": 1600000000, "lat": 95.0, "lon": 2.0}', "lat"),
        ("{}\n{", "not JSON"),
    ],
)
def test_what_cannot_be_read_is_told_with_its_name(tmp_path: Path, text: str, reason: str) -> None:
    with pytest.raises(RecordingError, match=reason) as caught:
        recorded_reports(written(tmp_path / "bad.json", text))
    assert "bad.json" in str(caught.value)


def test_files_that_are_not_there_or_damaged(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"none\.json"):
        recorded_reports(tmp_path / "none.json")
    (tmp_path / "cut.gz").write_bytes(gzip.compress(json.dumps(REPORTS).encode())[:-20])
    with pytest.raises(RecordingError, match=r"cut\.gz"):
        recorded_reports(tmp_path / "cut.gz")


def test_the_shipped_record_is_an_hour_of_orly() -> None:
    shipped = shipped_reports()
    assert (shipped.name, shipped.smoothed) == ("LFPO", True)
    assert 3000 < np.ptp(shipped.reports.time) <= 3600
    assert len(set(shipped.reports.address.tolist())) > 20


def test_the_command_takes_a_file_of_reports_and_no_video(tmp_path: Path) -> None:
    path = written(tmp_path / "reports.json", json.dumps(REPORTS))
    words = ["evaluate", "reported-tracks", "--jobs", "1", "--trials", "2", "--file"]
    made = CliRunner().invoke(app, [*words, str(path), "--json", str(tmp_path / "found.json")], catch_exceptions=False)
    assert made.exit_code == 0, made.output
    document = read_strictly(tmp_path / "found.json")
    check(document)
    assert document["settings"]["reports"] == "reports.json"
    np.savez(tmp_path / "turns.npz", scans=np.zeros((2, 64, 40), np.uint8), t=np.arange(2.0))
    refused = CliRunner().invoke(app, [*words, str(tmp_path / "turns.npz")], catch_exceptions=False)
    assert refused.exit_code != 0
    assert "turns.npz" in refused.output

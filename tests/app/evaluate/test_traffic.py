"""Files of recorded rows for the experiments that work on traffic."""

from __future__ import annotations

import gzip
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.evaluate.traffic import recorded_traffic, shipped_airport, shipped_traffic
from pipeline.lab.simulate.recording import RecordingError

Rows = list[dict[str, Any]]


def taxi(
    icao: str, address: str = "4b18b8", begin: float = 1.6e9, seconds: int = 90, ground_ft: float = 1500.0
) -> Rows:
    """A taxi run at 8 m/s to the east, about the reference point of an airport."""
    frame = shipped_airport(icao).frame
    latitude, longitude = frame.to_geodetic(8.0 * np.arange(seconds), np.zeros(seconds))
    return [
        {
            "timestamp": int((begin + k) * 1000), "icao24": address, "callsign": "SWR1 ",
            "latitude": float(latitude[k]), "longitude": float(longitude[k]),
            "groundspeed": 15.55, "track": 90.0, "altitude": ground_ft,
            "onground": True,
        }
        for k in range(seconds)
    ]  # fmt: skip


def written(path: Path, rows: Any) -> Path:
    path.write_bytes(gzip.compress(json.dumps(rows).encode()))
    return path


@pytest.mark.parametrize("icao", ["LFPO", "LSZH"])
def test_rows_are_taken_at_the_airport_where_they_are(tmp_path: Path, icao: str) -> None:
    (made,) = recorded_traffic(written(tmp_path / "rows.json.gz", taxi(icao)))
    assert (made.airport.icao, made.recording.icao, made.name) == (icao, icao, "rows.json.gz")
    (one,) = made.recording.trajectories
    assert (one.address, one.callsign, made.recording.start, made.recording.length) == ("4b18b8", "SWR1", 1.6e9, 90.0)
    assert made.reports is not None
    assert len(made.reports) == 90
    np.testing.assert_allclose(made.reports.east, 8.0 * np.arange(90), atol=0.1)
    np.testing.assert_allclose(made.reports.speed, 8.0, atol=0.01)
    np.testing.assert_allclose(made.reports.course, np.pi / 2, rtol=1e-6)
    assert made.reports.on_ground.all()
    assert (made.reports.altitude == 0.0).all()
    assert made.radar.simulated


def test_columns_are_rows_the_other_way_round_and_what_is_not_known_is_left_unknown(tmp_path: Path) -> None:
    rows = taxi("LSZH")
    rows[3] |= {"groundspeed": None, "track": None, "altitude": None}
    columns = {name: {str(k): row[name] for k, row in enumerate(rows)} for name in rows[0]}
    (plain,), (turned,) = (
        recorded_traffic(written(tmp_path / name, given)) for name, given in (("a.json", rows), ("b.json", columns))
    )
    assert plain.reports is not None
    assert turned.reports is not None
    np.testing.assert_array_equal(turned.reports.east, plain.reports.east)
    assert np.isnan(turned.reports.speed[3])
    assert np.isnan(turned.reports.course[3])
    assert np.isnan(turned.reports.speed).sum() == 1


def test_what_flies_is_reported_at_its_height_above_the_ground_and_what_is_far_away_is_not(tmp_path: Path) -> None:
    rows = taxi("LFPO")
    rows += [{**row, "icao24": "aaaaaa", "onground": False, "altitude": 2500.0} for row in taxi("LFPO")]
    rows += [{**row, "icao24": "bbbbbb", "latitude": row["latitude"] + 1.0} for row in taxi("LFPO")]
    (made,) = recorded_traffic(written(tmp_path / "a.json", rows))
    assert made.reports is not None
    assert set(made.reports.address.tolist()) == {"4b18b8", "aaaaaa"}
    np.testing.assert_allclose(made.reports.altitude[made.reports.address == "aaaaaa"], 304.8, atol=0.1)


def test_runs_of_different_days_are_recordings_of_their_own(tmp_path: Path) -> None:
    rows = taxi("LSZH") + taxi("LSZH", "4b1614", 1.6e9 + 86400) + taxi("LSZH", "4b17e5", 1.6e9 + 86430)
    first, second = recorded_traffic(written(tmp_path / "a.json", rows))
    assert [len(one.recording.trajectories) for one in (first, second)] == [1, 2]
    assert second.recording.start == 1.6e9 + 86400
    assert [float(one.time[0]) for one in second.recording.trajectories] == [0.0, 30.0]
    assert second.reports is not None
    assert set(second.reports.address.tolist()) == {"4b1614", "4b17e5"}


def test_a_folder_is_all_its_files(tmp_path: Path) -> None:
    written(tmp_path / "b.json.gz", taxi("LFPO"))
    written(tmp_path / "a.json", taxi("LSZH"))
    (tmp_path / "README.md").touch()
    assert [one.airport.icao for one in recorded_traffic(tmp_path)] == ["LSZH", "LFPO"]


@pytest.mark.parametrize(
    ("rows", "reason"),
    [
        ([], "no row has a timestamp"),
        ("text", "a list of rows"),
        ({"timestamp": 3}, "a list of rows"),
        ([{"timestamp": 1e12, "icao24": "a", "latitude": 0.0, "longitude": 0.0, "onground": True}], "LFPO, LSZH"),
        (taxi("LFPO", seconds=3), "no aircraft moves near LFPO"),
    ],
)
def test_what_cannot_be_used_is_told_with_its_name(tmp_path: Path, rows: Any, reason: str) -> None:
    with pytest.raises(RecordingError, match=reason) as caught:
        recorded_traffic(written(tmp_path / "bad.json", rows))
    assert "bad.json" in str(caught.value)


def test_an_empty_folder_is_told(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"has no \.json"):
        recorded_traffic(tmp_path)


def test_the_shipped_record_is_an_hour_of_orly() -> None:
    (shipped,) = shipped_traffic()
    assert (shipped.name, shipped.airport.icao, shipped.recording.length) == ("LFPO", "LFPO", 3600.0)
    assert shipped.reports is None

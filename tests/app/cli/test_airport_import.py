"""`airside airport import`: every format, and all that it has to tell, as a user sees it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from app.airports import load_airport
from app.cli import app
from tests.pipeline.airport.extracts import extract, node, runway, taxiway, way
from tests.pipeline.airport.osm.other_formats import as_turbo, as_xml, with_nodes_beside

FIELD = extract(
    runway(),
    taxiway([(0, 0), (0, 300)], ref="A1"),
    way([(0, 300), (400, 300)], aeroway="runway", ref="H01/H19"),
    node((0, 500), aeroway="windsock"),
    way([(-1500, -600), (1500, -600), (1500, 600), (-1500, -600)], aeroway="aerodrome", icao="TEST", ele="291 ft"),
)


def imported(folder: Path, octets: bytes, *options: str, name: str = "given.osm") -> tuple[int, str, Path]:
    source, target = folder / name, folder / "made.geojson"
    source.write_bytes(octets)
    run = CliRunner().invoke(
        app, ["airport", "import", str(source), "--icao", "TEST", "--output", str(target), *options]
    )
    return run.exit_code, run.output, target


@pytest.mark.parametrize("form", [lambda one: one, with_nodes_beside, as_turbo, as_xml])
def test_every_format(tmp_path: Path, form: Any) -> None:
    document = form(FIELD)
    octets = document if isinstance(document, bytes) else json.dumps(document).encode()
    code, output, target = imported(tmp_path, octets)
    assert code == 0, output
    assert [one.id for one in load_airport(str(target))[0].runways] == ["09/27"]


def test_what_is_lost_not_used_or_doubtful_is_printed(tmp_path: Path) -> None:
    _, output, target = imported(tmp_path, json.dumps(FIELD).encode())
    assert "Runways: 09/27" in output
    assert "Elevation: 88.7 m" in output
    assert "1  TaxiwayHoldingPosition" in output[output.index("Derived") : output.index("Left out")]
    assert "1  runway for helicopters or models" in output[output.index("Left out") : output.index("Not used")]
    assert "1  aeroway=windsock" in output[output.index("Not used") : output.index("To check")]
    assert "H01/H19" in output[output.index("To check") :]
    shown = CliRunner().invoke(app, ["airport", "show", str(target)]).output
    assert "Elevation: 88.7 m" in shown
    assert "H01/H19" in shown


def test_a_given_elevation_stands(tmp_path: Path) -> None:
    _, output, target = imported(tmp_path, json.dumps(FIELD).encode(), "--elevation", "-3")
    assert "Elevation: -3 m" in output
    assert load_airport(str(target))[1]["elevation_m"] == -3.0
    code, output, _ = imported(tmp_path, json.dumps(FIELD).encode(), "--elevation", "99999")
    assert (code, "elevation" in output) == (1, True)


def test_an_unknown_elevation_is_told(tmp_path: Path) -> None:
    _, output, _ = imported(tmp_path, json.dumps(extract(runway())).encode())
    assert "Elevation: not known" in output
    assert "--elevation" in output


@pytest.mark.parametrize(
    ("octets", "message"),
    [
        (json.dumps({**FIELD, "remark": "runtime error: Query timed out"}).encode(), "timed out"),
        (as_xml({**FIELD, "remark": "runtime error: Query timed out"}), "timed out"),
        (json.dumps(extract(FIELD["elements"][2], FIELD["elements"][1])).encode(), "no runway in the result"),
        (b"<html><body>504 Gateway Timeout<br></body></html>", "504 Gateway"),
    ],
)
def test_a_refused_extract_ends_with_an_error_and_writes_nothing(tmp_path: Path, octets: bytes, message: str) -> None:
    code, output, target = imported(tmp_path, octets)
    assert code == 1
    assert message in output
    assert not target.exists()

"""What a newcomer meets at the first start: paths, folders, terminals; one line for what is wrong, no traceback."""

from __future__ import annotations

import io
import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from rich.console import Console
from typer.testing import CliRunner

from app.airports import SHIPPED, load_airport
from app.cli import app
from app.run import _begin_aloud
from app.settings import ROOT, load
from tests.support.fake_service import FakeService


@pytest.fixture(autouse=True)
def no_settings_from_outside(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in [one for one in os.environ if one.startswith("AIRSIDE_")]:
        monkeypatch.delenv(name)


def called(*words: str, **environment: str) -> subprocess.CompletedProcess[bytes]:
    return subprocess.run(
        [sys.executable, "-m", "app", *words], env={**os.environ, **environment}, cwd=ROOT, capture_output=True,
        check=False, timeout=120,
    )  # fmt: skip


@pytest.mark.parametrize("said", ["map.geojson", "maps/map.geojson", "./maps/../map.geojson", "bare"])
def test_an_airport_is_looked_for_from_its_settings_file_on(
    said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    place = tmp_path / "etc"
    (place / "maps").mkdir(parents=True)
    (place / said).write_bytes((SHIPPED / "LSZH.geojson").read_bytes())
    (place / "airside.toml").write_text(f'airport = "{said}"\n', encoding="utf-8")
    for folder, file in ((tmp_path, "etc/airside.toml"), (place / "maps", "../airside.toml")):
        monkeypatch.chdir(folder)
        assert load_airport(load(Path(file)).airport)[0].icao == "LSZH"


def test_a_shipped_airport_and_a_path_in_a_variable_stay_as_they_are(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "airside.toml"
    file.write_text('airport = "lszh"\n')
    assert load_airport(load(file).airport)[0].icao == "LSZH"
    monkeypatch.setenv("AIRSIDE_AIRPORT", "here/map.geojson")
    assert load(file).airport == "here/map.geojson"


def test_settings_are_utf8_whatever_the_locale(tmp_path: Path) -> None:
    file = tmp_path / "airside.toml"
    file.write_bytes('airport = "/maps/Zürich.geojson"\n'.encode())
    words = "import pathlib, sys, app.settings as s; print(ascii(s.load(pathlib.Path(sys.argv[1])).airport))"
    told = subprocess.run(
        [sys.executable, "-X", "utf8=0", "-c", words, str(file)], cwd=ROOT, capture_output=True, check=True,
        env={**os.environ, "LC_ALL": "C", "PYTHONCOERCECLOCALE": "0"},
    )  # fmt: skip
    assert b"Z\\xfcrich" in told.stdout


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        ({"AIRSIDE_DATA_DIR": "{file}"}, "data_dir: {file}: cannot be written"),
        ({"AIRSIDE_DATA_DIR": "{file}/data"}, "data_dir: {file}/data: cannot be written"),
        ({"AIRSIDE_DATA_DIR": "/proc/airside"}, "data_dir: /proc/airside: cannot be written"),
        ({"AIRSIDE_AIRPORT": "{file}"}, "{file}: cannot be read as GeoJSON"),
        ({"AIRSIDE_AIRPORT": "nowhere.geojson"}, "no airport 'nowhere.geojson'"),
        ({"AIRSIDE_DATABASE_URL": "nothing://db"}, "nothing is no known kind of database"),
    ],
)
def test_what_stops_a_start_is_said_in_one_line(
    wrong: dict[str, str], told: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "file"
    file.write_text("no folder")
    monkeypatch.chdir(tmp_path)
    for name, value in {"AIRSIDE_PORT": "0", **wrong}.items():
        monkeypatch.setenv(name, value.format(file=file))
    result = CliRunner().invoke(app, ["serve"])
    assert result.exit_code == 2
    assert isinstance(result.exception, SystemExit)
    (line,) = [one for one in result.output.splitlines() if one.startswith("airside: ")]
    assert told.format(file=file) in line
    assert "Traceback" not in result.output


def test_a_command_without_words_of_its_own_for_it_ends_in_one_line(tmp_path: Path) -> None:
    result = called("warmup", AIRSIDE_LOG_LEVEL="loud")
    assert result.returncode == 2
    assert result.stderr.decode().startswith("airside: environment: log_level")
    assert len(result.stderr.splitlines()) == 1


@pytest.mark.parametrize("encoding", ["latin-1", "ascii"])
def test_any_terminal_will_do(encoding: str) -> None:
    for words in (("airport", "list"), ("--help",), ("parts",)):
        result = called(*words, PYTHONIOENCODING=encoding)
        assert result.returncode == 0, result.stderr.decode(encoding)
    assert b"Z" in called("airport", "list", PYTHONIOENCODING=encoding).stdout


def test_the_start_is_told_in_ascii() -> None:
    told = io.StringIO()
    running: Any = SimpleNamespace(service=FakeService(), settings=FakeService().settings)
    running.begin = lambda step: (step("one"), step("two"))
    running.service.readiness = lambda: SimpleNamespace(ready=True)
    _begin_aloud(running, Console(file=told, force_terminal=True), SimpleNamespace(should_exit=False), 1)  # type: ignore[arg-type]
    assert "is ready" in told.getvalue()
    assert told.getvalue().isascii()

"""What a newcomer meets at the first start: paths, folders, terminals; one line for what is wrong, no traceback."""

from __future__ import annotations

import io
import json
import os
import re
import signal
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
from app.settings import ROOT, load
from app.startup import Starter
from tests.support.fake_service import FakeService

NO_DATABASE = "postgresql+psycopg://user:hunter2@127.0.0.1:1/airside"
"""Nothing listens at port 1."""

pytestmark = pytest.mark.usefixtures("logging_as_it_was")


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


def told_by_a_start(console: Console) -> None:
    running: Any = SimpleNamespace(service=FakeService(), settings=FakeService().settings)
    running.begin = lambda step: (step("one"), step("two"))
    running.service.readiness = lambda: SimpleNamespace(ready=True)
    starter = Starter(running, console, SimpleNamespace(should_exit=False), 8123)  # type: ignore[arg-type]
    starter.run()
    assert starter.ready
    assert not starter.failed


def test_the_start_is_told_in_ascii() -> None:
    told = io.StringIO()
    told_by_a_start(Console(file=told, force_terminal=True))
    assert "is ready" in told.getvalue()
    assert told.getvalue().isascii()


def test_outside_a_terminal_the_steps_of_a_start_and_its_end_are_lines_of_the_log(
    caplog: pytest.LogCaptureFixture,
) -> None:
    told = io.StringIO()
    with caplog.at_level("INFO"):
        told_by_a_start(Console(file=told))
    assert caplog.messages[:3] == ["one", "two", "first picture"]
    assert re.fullmatch(r"Airside LFPO is ready after \d+\.\d s: http://127\.0\.0\.1:8123", caplog.messages[3])
    assert told.getvalue() == ""


@pytest.mark.parametrize("format", ["text", "json"])
def test_everything_that_a_start_says_has_the_form_of_the_log(format: str, tmp_path: Path) -> None:
    data = {"AIRSIDE_DATA_DIR": str(tmp_path), "AIRSIDE_PROT": "8001", "AIRSIDE_PORT": "0"}
    result = called("serve", AIRSIDE_LOG_FORMAT=format, AIRSIDE_DATABASE_URL=NO_DATABASE, **data)
    lines = result.stdout.decode().splitlines()
    if format == "json":
        told = [json.loads(line)["message"] for line in lines]
    else:
        assert all(re.match(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d{3}Z [A-Z]+ [\w.]+: ", one) for one in lines)
        told = [line.split(": ", 1)[1] for line in lines]
    assert told[0].startswith("environment: AIRSIDE_PROT is not a setting")
    assert told[1] == "Airside starts: LFPO, mode live"
    assert told[2] == "database: bringing the schema up to date"
    assert told[3].startswith("start-up failed: ")
    assert result.returncode == 1
    assert b"hunter2" not in result.stdout + result.stderr


def test_a_command_that_is_told_to_end_says_so_without_a_traceback(tmp_path: Path) -> None:
    """The kernels are compiled into an empty cache, which takes many times longer than the test waits."""
    for how in (signal.SIGINT, signal.SIGTERM):
        with subprocess.Popen(
            [sys.executable, "-m", "app", "warmup"], cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
            env={**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "kernels"), "AIRSIDE_DATA_DIR": str(tmp_path)},
        ) as process:  # fmt: skip
            assert process.stdout is not None
            assert b"compiling the kernels of the chain" in process.stdout.readline()
            process.send_signal(how)
            rest, told = process.communicate(timeout=60)
        assert process.returncode == 130
        assert rest == b""
        assert told == b"airside: stopped\n"

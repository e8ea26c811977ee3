"""`airside init` and `airside parts`, and what the settings file promises."""

from __future__ import annotations

import os
import re
import tomllib
from pathlib import Path

import pytest
from typer.testing import CliRunner

from app.cli import app
from app.settings import Settings, load
from app.settings_file import is_toml, settings_file, toml_value
from pipeline import parts

run = CliRunner()


@pytest.fixture(autouse=True)
def no_settings_from_outside(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in [one for one in os.environ if one.startswith("AIRSIDE_")]:
        monkeypatch.delenv(name)


def test_the_written_file_loads_and_changes_nothing(tmp_path: Path) -> None:
    file = tmp_path / "new" / "airside.toml"
    result = run.invoke(app, ["init", "--output", str(file)])
    assert result.exit_code == 0, result.output
    assert load(file) == Settings()


def test_every_line_of_the_file_may_be_made_active(tmp_path: Path) -> None:
    file = tmp_path / "airside.toml"
    file.write_text(re.sub(r"(?m)^#(?=[a-z\[])", "", settings_file()))
    made = load(file)
    assert [one.id for one in made.radars] == ["smr1"]
    assert made.radars[0].udp is not None
    assert [one.name for one in made.parts.alert] == [one.name for one in Settings().parts.alert]
    for verb in ("detect", "extract", "associate", "filter", "lifecycle", "classify"):
        chosen = getattr(made.parts, verb)
        if chosen.name in parts.available(verb):
            parts.build(verb, chosen.name, chosen.settings())
    for one in made.parts.alert:
        assert parts.build("alert", one.name, one.settings()) == parts.build("alert", one.name)


def test_every_setting_stands_in_the_file() -> None:
    active = re.sub(r"(?m)^#(?=[a-z\[])", "", settings_file())
    document = tomllib.loads(active)
    assert set(document) == set(Settings.model_fields)
    for name in ("feed", "limits", "storage", "demo", "mqtt", "clocks"):
        assert set(document[name]) == set(type(getattr(Settings(), name)).model_fields)


def test_a_file_that_is_there_is_kept_unless_forced(tmp_path: Path) -> None:
    file = tmp_path / "airside.toml"
    file.write_text("mine = 1\n")
    refused = run.invoke(app, ["init", "-o", str(file)])
    assert refused.exit_code != 0
    assert file.read_text() == "mine = 1\n"
    assert run.invoke(app, ["init", "-o", str(file), "--force"]).exit_code == 0
    assert "port" in file.read_text()


@pytest.mark.parametrize(
    "value", [True, 3, -2.5, 1e-12, 'a "quoted" \\ é', ["a", 1.0], (1, 2), {"06/24": {"alarm_s": 20.0}}]
)
def test_values_come_back_from_toml(value: object) -> None:
    back = tomllib.loads(f"x = {toml_value(value)}")["x"]
    assert back == (list(value) if isinstance(value, tuple) else value)


def test_what_toml_cannot_hold() -> None:
    assert not is_toml(None)
    with pytest.raises(TypeError):
        toml_value(object())


def test_parts_are_listed_with_their_settings() -> None:
    result = run.invoke(app, ["parts", "alert"], env={"COLUMNS": "200"})
    assert result.exit_code == 0, result.output
    for word in ("runway_occupied", "hold_entry", "opposite_direction", "closed_runway", "alarm_s = 15.0"):
        assert word in result.output


def test_an_unknown_stage_is_named_with_the_nearest_right_word() -> None:
    result = run.invoke(app, ["parts", "alrt"])
    assert result.exit_code != 0
    assert "alert" in result.output

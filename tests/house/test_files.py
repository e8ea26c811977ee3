"""What is shipped around the program agrees with the program."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from pathlib import Path

import pytest
import yaml

from app.settings import Settings

ROOT = Path(__file__).resolve().parent.parent.parent


def a_setting(variable: str) -> bool:
    model: object = Settings
    for step in variable.removeprefix("AIRSIDE_").lower().split("__"):
        fields = getattr(model, "model_fields", {})
        if step not in fields:
            return False
        model = type(fields[step].default)
    return True


def test_compose_sets_only_settings_that_exist() -> None:
    services = yaml.safe_load((ROOT / "compose.yaml").read_text())["services"]
    fleet = services["airside-fleet"]
    given = [name for name in fleet["environment"] if name.startswith("AIRSIDE_")]
    assert len(given) == 3
    assert [name for name in given if not a_setting(name)] == []
    assert set(fleet["depends_on"]) <= set(services)
    assert "profiles" not in services["airside"]
    assert all(services[name]["profiles"] == ["fleet"] for name in services if name != "airside")


def test_the_image_sets_only_settings_that_exist_and_copies_what_is_there() -> None:
    text = (ROOT / "Dockerfile").read_text()
    given = set(re.findall(r"(AIRSIDE_[A-Z0-9_]+)=", text))
    assert given
    assert all(a_setting(name) for name in given)
    taken = (ROOT / ".dockerignore").read_text().split("\n")
    for line in re.findall(r"^COPY (?!--from)(.+)$", text, re.M):
        for name in line.split()[:-1]:
            assert (ROOT / name).exists(), name
            assert f"!{name}" in taken, name
    assert re.search(r"^USER airside$", text, re.M)


def test_the_lock_of_the_display_tools_names_no_host() -> None:
    packages = json.loads((ROOT / "package-lock.json").read_text())["packages"]
    assert [name for name, one in packages.items() if "resolved" in one] == []


def test_the_check_script_is_sound_bash() -> None:
    assert subprocess.run(["bash", "-n", str(ROOT / ".ci" / "run")], check=False).returncode == 0


def test_what_the_readme_points_to_is_there() -> None:
    text = (ROOT / "README.md").read_text()
    pictures = re.findall(r"!\[[^]]+\]\(([^)]+)\)", text)
    assert len(pictures) == 3
    links = [one for one in re.findall(r"\]\(([^)#]+)\)", text) if "://" not in one]
    assert set(pictures) | {"docs/journal.md", "docs/tracker.md"} <= set(links)
    assert [one for one in links if not (ROOT / one).is_file()] == []
    given = set(re.findall(r"\b(AIRSIDE_[A-Z0-9_]+)=", text)) - {"AIRSIDE_SETTINGS"}
    assert [one for one in given if not a_setting(one)] == []


def test_the_files_that_the_documents_name_are_there() -> None:
    for document in sorted((ROOT / "docs").glob("*.md")):
        named = re.findall(r"`((?:pipeline|app|tests)/[a-z0-9_./]*)`", document.read_text())
        assert named, document.name
        assert [one for one in named if not (ROOT / one).exists()] == []


@pytest.mark.skipif(shutil.which("make") is None, reason="make is not installed")
def test_make_alone_tells_what_there_is() -> None:
    told = subprocess.run(["make", "-C", str(ROOT)], capture_output=True, text=True, check=True).stdout
    for goal in ("run", "test", "install", "lint", "bench", "lock", "clean", "help"):
        assert f"make {goal}" in told

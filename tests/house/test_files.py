"""What is shipped around the program agrees with the program."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from app.settings import Settings
from app.settings_environment import strays

ROOT = Path(__file__).resolve().parent.parent.parent


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
    assert strays(dict.fromkeys(given, "1"), Settings) == {}


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

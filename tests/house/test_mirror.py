"""The folders of the tests mirror those of the sources."""

from __future__ import annotations

from pathlib import Path

from tests.house.rules import ROOT, folders_of_tests_without_sources


def test_every_folder_of_tests_has_its_folder_of_sources() -> None:
    assert folders_of_tests_without_sources(ROOT) == []


def test_a_folder_without_sources_is_seen(tmp_path: Path) -> None:
    for name in ("pipeline/detect", "app", "tests/pipeline/detect", "tests/pipeline/detect/data", "tests/whole"):
        (tmp_path / name).mkdir(parents=True)
    (tmp_path / "tests/pipeline/detect/test_one.py").touch()
    (tmp_path / "tests/pipeline/detect/data/one.json").touch()
    (tmp_path / "tests/whole/test_all.py").touch()
    assert folders_of_tests_without_sources(tmp_path) == []
    for name in ("tests/pipeline/old", "tests/app/gone/deep"):
        (tmp_path / name).mkdir(parents=True)
        (tmp_path / name / "test_one.py").touch()
    assert folders_of_tests_without_sources(tmp_path) == ["app/gone/deep", "pipeline/old"]

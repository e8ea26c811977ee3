"""Compiled kernels are kept under the name of all sources that hold kernels."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

from app import kernel_cache

ASK = "import app, os; print(os.environ['NUMBA_CACHE_DIR'])"


def folder(**environment: str) -> Path:
    clean = {key: value for key, value in os.environ.items() if key != "NUMBA_CACHE_DIR"}
    answer = subprocess.run(
        [sys.executable, "-c", ASK],
        cwd=kernel_cache.ROOT,
        env={**clean, **environment},
        capture_output=True,
        check=True,
    )
    return Path(answer.stdout.decode().strip())


def test_the_folder_belongs_to_the_sources_and_a_child_finds_the_same(tmp_path: Path) -> None:
    given = folder(NUMBA_CACHE_DIR=str(tmp_path))
    assert given.parent == tmp_path
    assert given.is_dir()
    assert folder(NUMBA_CACHE_DIR=str(given)) == given
    assert folder().parent == kernel_cache.ROOT / ".airside" / "kernels"


def test_old_folders_go_and_the_newest_stay(tmp_path: Path) -> None:
    for number in range(6):
        (tmp_path / f"old{number}").mkdir()
        os.utime(tmp_path / f"old{number}", (number, number))
    folder(NUMBA_CACHE_DIR=str(tmp_path))
    assert {one.name for one in tmp_path.iterdir() if one.name.startswith("old")} == {"old3", "old4", "old5"}


def test_a_folder_dated_in_the_future_does_not_outlive_the_others(tmp_path: Path) -> None:
    for name, at in (("old1", 1.0), ("old2", 2.0), ("old3", 3.0), ("wrong", 4_080_000_000.0)):
        (tmp_path / name).mkdir()
        os.utime(tmp_path / name, (at, at))
    folder(NUMBA_CACHE_DIR=str(tmp_path))
    assert not (tmp_path / "wrong").exists()
    assert (tmp_path / "old1").exists()

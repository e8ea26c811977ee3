"""Compiled kernels are kept under the name of all sources that hold kernels."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

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


def test_kernels_that_came_with_the_program_are_copied_once_over_those_of_an_older_one(tmp_path: Path) -> None:
    digest = folder(NUMBA_CACHE_DIR=str(tmp_path / "volume")).name
    kept, shipped = tmp_path / "volume" / digest / "kernels", tmp_path / "image" / digest / "kernels"
    kept.mkdir()
    shipped.mkdir(parents=True)
    both = {"NUMBA_CACHE_DIR": str(tmp_path / "volume"), "AIRSIDE_SHIPPED_KERNELS": str(tmp_path / "image")}
    folder(**both)
    assert list(kept.iterdir()) == []
    (kept / "a.nbi").write_text("of an older image")
    for release in ("first", "second"):
        (shipped / "a.nbi").write_text(f"of the {release} image")
        folder(**both)
        assert (kept / "a.nbi").read_text() == f"of the {release} image"
        (kept / "a.nbi").write_text("compiled here since")
        folder(**both)
        assert (kept / "a.nbi").read_text() == "compiled here since"


def test_every_file_that_names_numba_or_a_decorator_of_kernels_counts() -> None:
    counted = {path.relative_to(kernel_cache.ROOT).as_posix() for path in kernel_cache.kernel_sources()}
    for known in ("compiled", "bits", "tiles", "adaptive", "growth", "correlate", "recent_rows", "component_state"):
        assert f"pipeline/kernels/{known}.py" in counted
    assert {"pipeline/detect/ca.py", "pipeline/track/schedule.py", "app/ingest/socket_kernel.py"} <= counted
    assert "pipeline/detect/macro_cells.py" in counted  # its constants are compiled into the kernels of `hybrid`
    assert "pipeline/detect/calibration.py" not in counted


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("pipeline/kernels/compiled.py", "from numba import njit\n"),
        ("pipeline/track/schedule.py", "from pipeline.kernels.compiled import allocating\n"),
        ("pipeline/kernels/bits.py", "from numba import extending\n"),
        ("app/ingest/socket_kernel.py", "import numba\n"),
    ],
)
def test_a_changed_kernel_gets_a_new_folder(name: str, text: str, tmp_path: Path) -> None:
    for one in ("pipeline/kernels/compiled.py", "app/ingest/socket_kernel.py", "pipeline/sites.py", name):
        (tmp_path / one).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / one).write_text("")
    (tmp_path / name).write_text(text)
    before = kernel_cache._digest(tmp_path)
    (tmp_path / "pipeline/sites.py").write_text("MOST = 3\n")
    assert kernel_cache._digest(tmp_path) == before
    (tmp_path / name).write_text(text + "LEAST = 2\n")
    assert kernel_cache._digest(tmp_path) != before


def test_a_changed_constant_of_another_file_gets_a_new_folder(tmp_path: Path) -> None:
    files = {
        "app/ingest/socket_kernel.py": "",
        "pipeline/kernels/one.py": "import numpy\n\nfrom pipeline.kernels.compiled import kernel\n"
        "from pipeline.limits import MOST\nfrom pipeline.many import (\n    least,\n    LEAST,\n)\n"
        "from pipeline.names import Name, name\n",
        "pipeline/limits.py": "MOST = 1\n",
        "pipeline/many/__init__.py": "LEAST = 1\n",
        "pipeline/names.py": "class Name: ...\n",
    }
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
    counted = [path.relative_to(tmp_path).as_posix() for path in kernel_cache.kernel_sources(tmp_path)]
    assert counted == ["pipeline/kernels/one.py", "pipeline/limits.py", "pipeline/many/__init__.py"]
    before = kernel_cache._digest(tmp_path)
    (tmp_path / "pipeline/limits.py").write_text("MOST = 2\n")
    assert kernel_cache._digest(tmp_path) != before


def test_a_folder_dated_in_the_future_does_not_outlive_the_others(tmp_path: Path) -> None:
    for name, at in (("old1", 1.0), ("old2", 2.0), ("old3", 3.0), ("wrong", 4_080_000_000.0)):
        (tmp_path / name).mkdir()
        os.utime(tmp_path / name, (at, at))
    folder(NUMBA_CACHE_DIR=str(tmp_path))
    assert not (tmp_path / "wrong").exists()
    assert (tmp_path / "old1").exists()

"""The cache of compiled kernels on disk, where several processes compile at once."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numba.core import caching

from pipeline.kernels.compiled import allocating

STAMP = "of the source"
IndexDataCacheFile: Any = caching.IndexDataCacheFile


class AtOnce(IndexDataCacheFile):  # type: ignore[misc]
    """A process that read the index before the others wrote theirs, and writes its kernel as late as it is told."""

    def __init__(self, folder: Path) -> None:
        super().__init__(str(folder), "kernel", STAMP)
        self.late: list[tuple[str, Any]] = []

    def _load_index(self) -> dict[Any, str]:
        return {}

    def _save_data(self, name: str, data: Any) -> None:
        self.late.append((name, data))

    def finish(self) -> None:
        for one in self.late:
            super()._save_data(*one)


@pytest.mark.parametrize("first", [0, 1])
def test_processes_that_compile_at_once_never_get_the_kernel_of_another_for_theirs(tmp_path: Path, first: int) -> None:
    processes = [AtOnce(tmp_path), AtOnce(tmp_path)]
    for number, one in enumerate(processes):
        one.save(number, f"kernel {number}")
    processes[first].finish()
    processes[1 - first].finish()
    later = IndexDataCacheFile(str(tmp_path), "kernel", STAMP)
    found = [later.load(number) for number in range(2)]
    assert found == [None, "kernel 1"], "the one whose index was overwritten is compiled again"


@allocating
def _total(values: np.ndarray[Any, Any]) -> float:
    return values.sum()  # type: ignore[no-any-return]


def test_a_kernel_for_other_arguments_has_a_file_of_its_own() -> None:
    dispatcher: Any = _total
    values = np.arange(8.0)
    assert (_total(values), _total(values[::2])) == (28.0, 12.0)
    folder = Path(dispatcher.stats.cache_path)
    later = dispatcher._cache._cache_file
    names = set(later._load_index().values())
    assert len(names) == 2
    assert all((folder / one).is_file() and len(one.split(".")[-2]) == 32 for one in names)

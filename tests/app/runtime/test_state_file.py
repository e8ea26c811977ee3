"""Files of learned states: whole or refused, never half, and never able to do harm."""

from __future__ import annotations

import io
import struct
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from app.runtime.state_file import SAVED_AT, SCENE, read_state, write_state
from pipeline.state import StateError
from tests.app.runtime.small_radar import small_chain, turn

ARRAYS = {"level": np.arange(40.0), "scan": np.array([3, -1], np.int64), "words": np.array("of Orly")}


def read(path: Path, now: float = 1000.0, most_bytes: int = 10_000, scene: str = "live") -> dict[str, Any]:
    return read_state(path, now, 60.0, scene, most_bytes)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    made = tmp_path / "state" / "smr-1.npz"
    write_state(made, ARRAYS, 990.0, "live")
    return made


def test_what_is_written_is_read(path: Path) -> None:
    got = read(path)
    assert set(got) == set(ARRAYS)
    for name, array in ARRAYS.items():
        np.testing.assert_array_equal(got[name], array)
    assert [one.name for one in path.parent.iterdir()] == [path.name], "nothing is left beside it"


def test_what_could_not_be_written_leaves_nothing(path: Path) -> None:
    class Full:
        def __array__(self, *_: Any, **__: Any) -> Any:
            raise OSError(28, "no room")

    with pytest.raises(OSError, match="no room"):
        write_state(path, {**ARRAYS, "full": Full()}, 995.0, "live")  # type: ignore[dict-item]
    assert [one.name for one in path.parent.iterdir()] == [path.name]
    assert set(read(path)) == set(ARRAYS)


def test_too_old_another_scene_too_large_or_absent(path: Path) -> None:
    for how, words in (
        ({"now": 1051.0}, "61 s old"),
        ({"now": 900.0}, "-90 s old"),
        ({"scene": "demo"}, "another scene"),
        ({"most_bytes": 300}, "too many"),
    ):
        with pytest.raises(StateError, match=words):
            read(path, **how)  # type: ignore[arg-type]
    with pytest.raises(FileNotFoundError):
        read(path.with_name("other.npz"))
    path.unlink()
    path.mkdir()
    with pytest.raises(StateError, match="cannot be read"):
        read(path)


def member(array: np.ndarray[Any, Any], **how: Any) -> bytes:
    made = io.BytesIO()
    np.lib.format.write_array(made, array, **how)
    return made.getvalue()


def archive(path: Path, members: dict[str, bytes], method: int = zipfile.ZIP_STORED) -> None:
    whole = {f"{SAVED_AT}.npy": member(np.array(990.0)), f"{SCENE}.npy": member(np.array("live")), **members}
    with zipfile.ZipFile(path, "w", method) as made:
        for name, data in whole.items():
            made.writestr(name, data)


class Harm:
    def __reduce__(self) -> Any:
        return (print, ("this must not be printed",))


def test_hostile_files_are_refused(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    vast = bytearray(member(np.zeros(4)))
    at = vast.index(b"(4,)")
    vast[at : at + 4] = b"(9, "
    head = b"{'descr': '<f8', 'fortran_order': False, 'shape': (1000000000000,), }"
    huge = b"\x93NUMPY\x01\x00" + struct.pack("<H", len(head) + 1) + head + b"\n" + b"\0" * 64
    for members in (
        {"a.npy": member(np.array([Harm()], dtype=object), allow_pickle=True)},
        {"a.npy": bytes(vast)},
        {"a.npy": huge},
        {"a.npy": huge.replace(b"1000000000000", b"-100000000000")},
        {"a.npy": b"\x93NUMPY\x03\x00"},
        {"a.npy": b"no array at all"},
        {"a.npy": b""},
        {f"a{i}.npy": member(np.zeros(1)) for i in range(300)},
        {f"{SAVED_AT}.npy": member(np.array([1.0, 2.0]))},
        {f"{SAVED_AT}.npy": member(np.array(np.nan))},
        {f"{SAVED_AT}.npy": member(np.array("soon"))},
    ):
        archive(path, members)
        with pytest.raises(StateError):
            read(path, most_bytes=100_000)
    archive(path, {"a.npy": member(np.zeros(1000))}, zipfile.ZIP_DEFLATED)
    with pytest.raises(StateError, match="compressed"):
        read(path)
    assert capsys.readouterr().out == ""


def test_every_truncation_is_refused(path: Path) -> None:
    whole = path.read_bytes()
    for length in range(0, len(whole), 7):
        path.write_bytes(whole[:length])
        with pytest.raises(StateError):
            read(path)


@settings(max_examples=200, deadline=None, suppress_health_check=list(HealthCheck), derandomize=True)
@given(st.data())
def test_a_flipped_octet_is_refused_or_harmless(tmp_path: Path, data: st.DataObject) -> None:
    path = tmp_path / "smr-1.npz"
    write_state(path, ARRAYS, 990.0, "live")
    whole = bytearray(path.read_bytes())
    whole[data.draw(st.integers(0, len(whole) - 1))] ^= data.draw(st.integers(1, 255))
    path.write_bytes(whole)
    try:
        got = read(path)
    except StateError:
        return
    for name in set(got) & set(ARRAYS):
        np.testing.assert_array_equal(got[name], ARRAYS[name])


def test_a_chain_goes_through_a_file(tmp_path: Path) -> None:
    first = small_chain()
    for scan in range(3):
        for block in turn(scan):
            first.process(block)
    path = tmp_path / "smr-1.npz"
    write_state(path, first.save(), 990.0, "live")
    again = small_chain()
    again.resume(read(path, most_bytes=10**7))
    assert sum(len(again.process(block).plots) for block in turn(0)) >= 2

"""What the service writes is for its own user alone; radars are heard where the settings say, and nowhere else."""

from __future__ import annotations

import os
import stat
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from app.assembly import radar_heard_at
from app.ingest.udp import open_socket
from app.journal.output import _Stream
from app.private_files import make_private_file, make_private_folder
from app.runtime.state_file import write_state
from app.settings import RadarSettings, SettingsError
from app.settings_sources import UdpSettings
from app.store.store import Store
from tests.support.running import settings_for_tests
from tests.support.small_airport import small_airport


@pytest.fixture(autouse=True)
def open_handed_user() -> Iterator[None]:
    """A user whose files everyone may read and write."""
    before = os.umask(0)
    yield
    os.umask(before)


def mode(path: Path) -> int:
    return stat.S_IMODE(path.stat().st_mode)


def test_the_database_with_its_log_is_private(tmp_path: Path) -> None:
    folder = tmp_path / "data"
    make_private_folder(folder, "data_dir")
    store = Store(f"sqlite:///{folder / 'airside.sqlite3'}", settings_for_tests(), small_airport())
    store.start()
    store.close_open_alerts("restart", 0.0)
    files = {one.name: mode(one) for one in folder.iterdir()}
    store.stop()
    assert mode(folder) == 0o700
    assert {"airside.sqlite3", "airside.sqlite3-wal", "airside.sqlite3-shm"} <= files.keys()
    assert set(files.values()) == {0o600}


@pytest.mark.parametrize("there", [False, True])
def test_a_private_folder_is_not_warned_of(there: bool, tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    folder = tmp_path / "data"
    if there:
        folder.mkdir(mode=0o700)
    make_private_folder(folder, "data_dir")
    assert not caplog.records


def test_files_in_a_folder_open_to_others_are_private(tmp_path: Path) -> None:
    tmp_path.chmod(0o755)
    store = Store(f"sqlite:///{tmp_path / 'airside.sqlite3'}", settings_for_tests(), small_airport())
    store.start()
    store.close_open_alerts("restart", 0.0)
    files = {one.name: mode(one) for one in tmp_path.iterdir()}
    store.stop()
    write_state(tmp_path / "state" / "one.npz", {"a": np.zeros(3)}, 0.0, "live")
    assert set(files.values()) == {0o600}
    assert mode(tmp_path / "state") == 0o700


def test_states_and_journals_are_private(tmp_path: Path) -> None:
    write_state(tmp_path / "state" / "one.npz", {"a": np.zeros(3)}, 0.0, "live")
    assert mode(tmp_path / "state") == 0o700
    assert mode(tmp_path / "state" / "one.npz") == 0o600
    _Stream(tmp_path / "one.mcap").close()
    assert mode(tmp_path / "one.mcap") == 0o600


def test_a_file_of_an_earlier_version_becomes_private_and_keeps_what_is_in_it(tmp_path: Path) -> None:
    file = tmp_path / "airside.sqlite3"
    file.write_bytes(b"kept")
    file.chmod(0o644)
    make_private_file(file)
    assert (mode(file), file.read_bytes()) == (0o600, b"kept")


@pytest.mark.parametrize("open_to", [0o755, 0o750, 0o701])
def test_a_folder_that_is_there_keeps_its_mode_and_is_warned_of(
    open_to: int, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    tmp_path.chmod(open_to)
    make_private_folder(tmp_path, "data_dir")
    assert mode(tmp_path) == open_to
    [warning] = [one.getMessage() for one in caplog.records]
    assert f"data_dir: other users of this machine may enter {tmp_path} (mode {open_to:04o})" in warning
    assert f"chmod 700 {tmp_path}" in warning
    assert list(tmp_path.iterdir()) == []
    with pytest.raises(SettingsError, match="data_dir"):
        make_private_folder(Path("/proc/airside"), "data_dir")


@pytest.mark.parametrize(
    ("udp", "where"),
    [
        ({}, "127.0.0.1"),
        ({"address": "0.0.0.0"}, "0.0.0.0"),
        ({"address": "127.0.0.2"}, "127.0.0.2"),
        ({"group": "239.255.82.43", "interface": "127.0.0.1"}, "0.0.0.0"),
    ],
)
def test_a_radar_is_heard_on_loopback_unless_the_settings_say_so(udp: dict[str, str], where: str) -> None:
    with open_socket(UdpSettings(port=0, **udp)) as opened:  # type: ignore[arg-type]
        assert opened.getsockname()[0] == where


def test_the_address_for_all_holds_for_radars_without_their_own() -> None:
    def heard(udp: UdpSettings | None) -> UdpSettings | None:
        return radar_heard_at(RadarSettings(id="a", latitude=0.0, longitude=0.0, udp=udp), "10.0.0.1").udp

    assert heard(UdpSettings()) == UdpSettings(address="10.0.0.1")
    assert heard(UdpSettings(address="10.0.0.2")) == UdpSettings(address="10.0.0.2")
    assert heard(UdpSettings(group="239.1.2.3")) == UdpSettings(group="239.1.2.3")
    assert heard(None) is None

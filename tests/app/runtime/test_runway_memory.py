"""How operators set the runways outlives the service, or it is said loudly that it was lost."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from app.contract import Refused
from app.runtime.runway_memory import DamagedFile, Kept, RunwayMemory, RunwayUse, decode, encode
from app.service import SurfaceService
from app.settings import RunwaySettings
from pipeline.picture import RunwayState
from tests.support.running import until
from tests.support.service_rigs import settings_here
from tests.support.small_airport import as_geojson, small_airport

IDS = ("06/24", "07/25")


class Runways:
    """Takes settings of runways as the alert monitor does."""

    def __init__(self) -> None:
        self.states = {id: RunwayState(id) for id in IDS}

    def set(self, id: str, open: bool, in_use: str, visibility: Any) -> RunwayState:
        if in_use and in_use not in id.split("/"):
            raise ValueError(f"runway {id} has no direction {in_use}")
        self.states[id] = RunwayState(id, open, in_use or None, visibility)
        return self.states[id]


def taken_up(folder: Path, mode: str = "live") -> tuple[RunwayMemory, dict[str, RunwayState]]:
    memory, runways = RunwayMemory(folder, "LFPO", mode, clock=lambda: 1000.0), Runways()
    memory.take_up(IDS, runways.set)
    return memory, runways.states


def test_at_the_first_start_nothing_is_known_and_nothing_is_said(tmp_path: Path) -> None:
    memory, states = taken_up(tmp_path)
    assert (memory.state(), states["06/24"].open, list(tmp_path.iterdir())) == (None, True, [])


def test_what_was_set_is_so_again(tmp_path: Path) -> None:
    memory, _ = taken_up(tmp_path / "state")
    closed, low = RunwayState("06/24", open=False), RunwayState("07/25", True, "25", "low", occupants=(4,))
    memory.note([low])
    memory.note([closed])
    again, states = taken_up(tmp_path / "state")
    assert states == {"06/24": RunwayState("06/24", False), "07/25": RunwayState("07/25", True, "25", "low")}
    assert again.state() is None
    assert [one.stat().st_mode & 0o777 for one in (tmp_path / "state").iterdir()] == [0o600]
    assert taken_up(tmp_path / "state", "demo")[1]["06/24"].open, "a demonstration has runways of its own"


@pytest.mark.parametrize("damage", ["cut", "empty", "bit", "folder", "other"])
def test_a_damaged_file_is_told_until_every_runway_is_set_again(damage: str, tmp_path: Path) -> None:
    memory, _ = taken_up(tmp_path)
    memory.note([RunwayState("06/24", open=False)])
    octets = memory.path.read_bytes()
    if damage == "folder":
        memory.path.unlink()
        memory.path.mkdir()
    elif damage == "other":
        memory.path.write_bytes(b"[]\n")
    else:
        memory.path.write_bytes({"cut": octets[:-20], "empty": b"", "bit": octets.replace(b"false", b"true")}[damage])
    for _ in range(2):
        again, _ = taken_up(tmp_path)
        told = again.state()
        assert told is not None
        assert (told.status, told.last) == ("degraded", 1000.0)
        assert "how 06/24, 07/25 was set before the restart is not known" in told.detail
    if damage == "folder":
        again.note([RunwayState("06/24", open=False)])
        told = again.state()
        assert told is not None
        assert "cannot be saved and would be lost at a restart" in told.detail
        return
    again.note([RunwayState("06/24", open=False)])
    third, states = taken_up(tmp_path)
    told = third.state()
    assert told is not None
    assert "how 07/25 was set before the restart is not known" in told.detail
    assert not states["06/24"].open
    third.note([RunwayState("07/25")])
    assert third.state() is None
    assert taken_up(tmp_path)[0].state() is None


def test_a_direction_that_the_map_has_no_more_is_told_and_the_rest_is_kept(tmp_path: Path) -> None:
    memory, _ = taken_up(tmp_path)
    memory.note([RunwayState("06/24", True, "05", "low"), RunwayState("01/19", open=False)])
    again, states = taken_up(tmp_path)
    told = again.state()
    assert told is not None
    assert "how 06/24 was set" in told.detail
    assert states["06/24"] == RunwayState("06/24", True, None, "low")


def test_what_cannot_be_saved_is_told(tmp_path: Path) -> None:
    (tmp_path / "state").write_text("a file where the folder should be")
    memory = RunwayMemory(tmp_path / "state", "LFPO", "live")
    memory.note([RunwayState("06/24", open=False)])
    told = memory.state()
    assert told is not None
    assert "cannot be saved" in told.detail
    (tmp_path / "state").unlink()
    memory.note([RunwayState("06/24", open=False)])
    assert memory.state() is None


def test_an_order_that_was_done_after_all_is_noted_with_the_next_picture(tmp_path: Path) -> None:
    memory, _ = taken_up(tmp_path)
    before, after = [RunwayState(id) for id in IDS], [RunwayState("06/24", open=False), RunwayState("07/25")]
    memory.note_changed(before)
    memory.in_doubt = True
    memory.note_changed(before)
    assert not memory.path.exists()
    memory.note_changed(after)
    assert decode(memory.path.read_bytes()).runways == [RunwayUse("06/24", False, None, "normal")]


def test_only_what_was_written_is_read() -> None:
    kept = Kept([RunwayUse("06/24", False, None, "normal")], ["07/25"])
    assert decode(encode(kept)) == kept
    for octets in (encode(kept)[1:], encode(kept) + b"x", b"", b"\n", b"\xff\n"):
        with pytest.raises(DamagedFile):
            decode(octets)


CHILD = """
import os, sys, time
from pathlib import Path
from app.runtime.runway_memory import RunwayMemory
from pipeline.picture import RunwayState
RunwayMemory(Path(sys.argv[1]), "LFPO", "live").note([RunwayState("06/24", open=False)])
print("set", flush=True)
time.sleep(600)
"""


def test_what_was_set_outlives_kill_9(tmp_path: Path) -> None:
    child = subprocess.Popen([sys.executable, "-c", CHILD, str(tmp_path)], stdout=subprocess.PIPE, text=True)
    assert child.stdout is not None
    assert child.stdout.readline() == "set\n"
    os.kill(child.pid, signal.SIGKILL)
    child.wait()
    child.stdout.close()
    assert not taken_up(tmp_path)[1]["06/24"].open


def test_a_service_that_is_started_again_has_the_runways_as_they_were_set(tmp_path: Path) -> None:
    settings = settings_here(tmp_path).model_copy(
        update={"radars": (), "nodes": (), "runways": (RunwaySettings(id="06/24", in_use="06"),)}
    )

    def started() -> SurfaceService:
        service = SurfaceService(settings, small_airport(), as_geojson(small_airport()))
        service.prepare()
        service.start()
        until(lambda: service.picture() is not None, "a picture is made", 60.0)
        return service

    first = started()
    first.set_runway("06/24", open=False, in_use=None, visibility="low")
    with pytest.raises(Refused):
        first.set_runway("06/24", open=None, in_use="06", visibility=None)
    first.stop()
    again = started()
    picture = again.picture()
    assert picture is not None
    [state] = [one for one in picture.runways if one.id == "06/24"]
    assert (state.open, state.in_use, state.visibility) == (False, None, "low")
    assert "runways" not in {one.id for one in again.sensors()}
    again.stop()
    next((tmp_path / "state").glob("runways-*")).write_bytes(b"damaged")
    third = started()
    [told] = [one for one in third.sensors() if one.id == "runways"]
    assert told.status == "degraded"
    third.stop()

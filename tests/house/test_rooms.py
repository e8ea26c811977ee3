"""Which room of the core may import which: the inner layers."""

from __future__ import annotations

import pytest

from tests.house.rules import room_faults, room_of, rooms_imported, sources

FLOOR = frozenset({"tables", "sites", "state", "picture"})
"""Plain values."""

PLUG_IN = FLOOR | {"contracts", "kernels", "airport", "reference"}
"""What a method may know: what it keeps to, never the tracker, never a method of another verb."""

ROOMS: dict[str, frozenset[str]] = {
    "__init__": frozenset(),
    "tables": frozenset(),
    "sites": frozenset({"tables"}),
    "state": frozenset({"tables"}),
    "picture": frozenset({"tables"}),
    "inputs": frozenset({"tables", "picture"}),
    "values": frozenset({"tables"}),
    "timing": frozenset(),
    "reference": frozenset({"tables"}),
    "kernels": frozenset({"tables", "sites", "state"}),
    "airport": frozenset({"tables", "sites", "picture"}),
    "contracts": FLOOR | {"airport"},
    "asterix": frozenset({"kernels", "tables"}),
    "assemble": frozenset({"asterix", "kernels", "sites", "tables"}),
    **dict.fromkeys(("detect", "extract", "bearing", "associate", "filter", "lifecycle", "classify"), PLUG_IN),
    "alert": PLUG_IN | {"situation"},
    "situation": frozenset({"contracts", "airport", "picture", "tables"}),
    "group": frozenset({"contracts", "kernels", "tables"}),
    "track": frozenset({"contracts", "kernels", "airport", "sites", "tables", "group"}),
}
"""Each room and the rooms that it may import beside itself."""

TOP = ("parts", "catalogue", "chain", "engine", "engine_records")
"""What puts the rooms together may import all of them, but not the laboratory."""

ROOMS |= dict.fromkeys(TOP, frozenset(ROOMS) | set(TOP))
ROOMS["lab"] = frozenset(ROOMS)

LABORATORY_IN_THE_SHELL = ("app/bench/", "app/cli/", "app/demo/", "app/evaluate/", "app/replay/compare.py")
"""Commands and the demonstration; what serves a real airport runs without the laboratory."""

CORE, SHELL = sources("pipeline"), sources("app")


@pytest.mark.parametrize("path", CORE)
def test_a_room_imports_only_what_it_may(path: str) -> None:
    assert room_faults(path, CORE[path], ROOMS) == []


@pytest.mark.parametrize("path", SHELL)
def test_the_laboratory_is_for_commands_and_the_demonstration(path: str) -> None:
    assert path.startswith(LABORATORY_IN_THE_SHELL) or "lab" not in rooms_imported(SHELL[path])


def test_the_rule_sees_the_imports_there_are() -> None:
    seen = {(room_of(path), room) for path, text in CORE.items() for room in rooms_imported(text)}
    assert {("detect", "kernels"), ("alert", "situation"), ("track", "contracts"), ("lab", "engine")} <= seen
    assert any("lab" in rooms_imported(text) for text in SHELL.values())


def test_no_room_is_above_one_that_imports_it() -> None:
    """The table has no circle, so there is an order in which each room stands on those before it."""
    left = {room: set(below) - {room} for room, below in ROOMS.items() if room not in TOP}
    while left:
        ready = {room for room, below in left.items() if not below & left.keys()}
        assert ready, f"these rooms import one another: {sorted(left)}"
        left = {room: below for room, below in left.items() if room not in ready}


@pytest.mark.parametrize(
    ("path", "source", "word"),
    [
        ("pipeline/filter/new.py", "from pipeline.track.store import TrackStore\n", "filter may not import track"),
        ("pipeline/filter/new.py", "from pipeline.associate.gnn import PART\n", "associate"),
        ("pipeline/filter/new.py", "import pipeline.track.store as t\n", "track"),
        ("pipeline/filter/new.py", "from pipeline import engine, sites\n", "engine"),
        ("pipeline/filter/new.py", "def late():\n    from pipeline.track import core\n", "track"),
        ("pipeline/filter/new.py", "from ..track import core\n", "may not import ."),
        ("pipeline/filter/new.py", "import importlib\nimportlib.import_module('pipeline.track.core')\n", "track"),
        ("pipeline/tables/new.py", "from pipeline.state import ArrayState\n", "state"),
        ("pipeline/track/new.py", "from pipeline.filter.kalman import PART\n", "filter"),
        ("pipeline/engine.py", "from pipeline.lab.simulate import video\n", "lab"),
        ("pipeline/annex/new.py", "", "annex is not in the table"),
        ("pipeline/annex.py", "", "annex is not in the table"),
    ],
)
def test_what_is_refused(path: str, source: str, word: str) -> None:
    faults = room_faults(path, source, ROOMS)
    assert len(faults) == 1
    assert word in faults[0]


@pytest.mark.parametrize(
    ("path", "source"),
    [
        ("pipeline/filter/new.py", "import numpy\nfrom pipeline.filter.kalman import PART\n"),
        ("pipeline/filter/new.py", "from pipeline.contracts.filter import Filter\nfrom pipeline import sites\n"),
        ("pipeline/filter/new.py", "from pipelines.track import core\n"),
        ("pipeline/alert/new.py", "from pipeline.situation.observe import observe\n"),
        ("pipeline/lab/new.py", "from pipeline.track import core\nfrom pipeline.engine import Engine\n"),
    ],
)
def test_what_is_allowed(path: str, source: str) -> None:
    assert room_faults(path, source, ROOMS) == []

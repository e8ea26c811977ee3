"""What operators are told of the alerts that a restart has reset."""

from __future__ import annotations

from app.runtime.restart import TOLD_S, RestartNote


def test_nothing_is_told_when_nothing_was_open() -> None:
    note = RestartNote([])
    assert (note.words, note.state()) == ("", None)


def test_alerts_that_were_open_and_who_had_acknowledged_them_are_told_for_a_while() -> None:
    now = [3600.0]
    alerts = [
        {"runway": "06/24", "acknowledged_by": "TWR-1"},
        {"runway": None, "acknowledged_by": "TWR-2"},
        {"runway": "06/24", "acknowledged_by": None},
    ]
    note = RestartNote(alerts, lambda: now[0])
    told = note.state()
    assert told is not None
    assert (told.id, told.status, told.last) == ("restart", "degraded", 3600.0)
    assert told.detail == (
        "the service was restarted at 01:00:00 UTC: 3 alerts that were open begin anew, with another number and not "
        "acknowledged; acknowledged before: 06/24 by TWR-1, no runway by TWR-2"
    )
    now[0] += TOLD_S + 1
    assert note.state() is None


def test_of_many_acknowledged_ones_some_are_named() -> None:
    words = RestartNote([{"runway": "06/24", "acknowledged_by": f"TWR-{i}"} for i in range(8)]).words
    assert words.endswith("06/24 by TWR-4 and 3 more")

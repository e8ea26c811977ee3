"""Those who hear of every picture: all of them, until they end it, and though one of them fails."""

from __future__ import annotations

from typing import Any

from app.runtime.listeners import Listeners
from pipeline.picture import Picture
from pipeline.tables import Tracks


def test_all_hear_until_they_end_it() -> None:
    listeners, heard = Listeners(), list[str]()
    end_first = listeners.add(lambda _picture, _changes: heard.append("first"))
    listeners.add(lambda _picture, _changes: heard.append("second"))
    picture = Picture(1.0, Tracks.empty(), (), ())
    assert listeners.tell(picture, ()) == 0
    end_first()
    end_first()  # a second time does nothing
    assert listeners.tell(picture, ()) == 0
    assert heard == ["first", "second", "second"]


def test_one_that_fails_is_counted_and_keeps_no_other_from_hearing() -> None:
    listeners, heard = Listeners(), list[Any]()

    def fails(_picture: Picture, _changes: Any) -> None:
        raise RuntimeError("on purpose")

    listeners.add(fails)
    listeners.add(lambda picture, _changes: heard.append(picture.time))
    assert listeners.tell(Picture(2.0, Tracks.empty(), (), ()), ()) == 1
    assert heard == [2.0]

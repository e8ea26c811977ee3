"""A state of another form is told from one that only holds other values."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest

from pipeline.values.forms import other_form


@dataclass
class Clock:
    period: float = 1.0
    marks: Any = field(default_factory=lambda: np.zeros(0))


@dataclass
class Watch:
    period: float = 1.0


def own() -> dict[str, Any]:
    """A state without any track."""
    return {
        "tracker": {"store": {"state": np.zeros((0, 4)), "name": np.zeros(0, "U6")}, "clocks": [Clock()]},
        "counters": {}, "heard": None, "time": -math.inf, "text": "",
    }  # fmt: skip


def grown() -> dict[str, Any]:
    """The same after hours."""
    marks = np.ones(3)
    return {
        "tracker": {"store": {"state": np.ones((7, 4)), "name": np.full(7, "a", "U6")}, "clocks": [Clock(2, marks)]},
        "counters": {"late": 4}, "heard": (1.0, 2.0), "time": 5, "text": "x",
    }  # fmt: skip


def test_other_values_are_the_same_form() -> None:
    assert other_form(grown(), own()) is None
    assert other_form(own(), grown()) == "counters.late is missing", "own is to be an empty state"
    assert other_form({**grown(), "heard": None}, own()) is None


def test_shorter_texts_fit_but_longer_ones_do_not() -> None:
    saved = grown()
    saved["tracker"]["store"]["name"] = np.full(7, "a", "U5")
    assert other_form(saved, own()) is None
    saved["tracker"]["store"]["name"] = np.full(7, "a", "U7")
    assert other_form(saved, own()) == "tracker.store.name has rows of <U7 [], here <U6 []"


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda s: s.pop("text"), "text is missing"),
        (lambda s: s["tracker"]["store"].pop("name"), "tracker.store.name is missing"),
        (lambda s: s["tracker"]["store"].update(table=1), "tracker.store.table is not known here"),
        (lambda s: s["tracker"]["store"].update(state=np.ones((7, 6))), "tracker.store.state has rows of float64 [6]"),
        (
            lambda s: s["tracker"]["store"].update(state=np.ones((7, 4), "f4")),
            "tracker.store.state has rows of float3",
        ),
        (lambda s: s["tracker"]["store"].update(name=np.ones(7)), "tracker.store.name has rows of float64"),
        (lambda s: s["tracker"].update(clocks=[Watch()]), "tracker.clocks[0] is of the class Watch, here Clock"),
        (lambda s: s["tracker"].update(clocks=[Clock(1.0, 4)]), "tracker.clocks[0].marks is of the class int, here nd"),
        (lambda s: s["tracker"].update(clocks=(Clock(),)), "tracker.clocks is of the class tuple, here list"),
        (lambda s: s.update(tracker=[1]), "tracker is of the class list, here dict"),
        (lambda s: s.update(time="late"), "time is of the class str, here float"),
    ],
)
def test_another_form_is_told_with_its_place(change: Any, told: str) -> None:
    saved = grown()
    change(saved)
    found = other_form(saved, own())
    assert found is not None
    assert found.startswith(told)


def test_a_state_that_is_none_at_all_is_another_form() -> None:
    assert other_form(3, own()) == "the state is of the class int, here dict"

"""What every JSON document of `airside evaluate` keeps to."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

VERDICTS = {"reproduced", "beaten", "not reproduced", "no figure in the paper"}


def _strange(word: str) -> None:
    raise AssertionError(f"{word} is not JSON")


def read_strictly(path: Path) -> Any:
    """The document; NaN and Infinity are refused."""
    return json.loads(path.read_text(encoding="utf-8"), parse_constant=_strange)


def check(document: dict[str, Any]) -> None:
    """The schema."""
    assert set(document) == {"experiment", "seed", "trials", "settings", "rows"}
    assert isinstance(document["experiment"], str)
    assert isinstance(document["seed"], int)
    assert document["trials"] >= 1
    assert isinstance(document["settings"], dict)
    assert document["rows"], "an experiment without a row measures nothing"
    for row in document["rows"]:
        assert set(row) == {"name", "paper", "measured", "ci95", "unit", "verdict", "wanted", "met"}
        assert row["name"]
        assert isinstance(row["unit"], str)
        assert row["verdict"] in VERDICTS
        assert (row["paper"] is None) == (row["verdict"] == "no figure in the paper")
        assert len(row["ci95"]) == 2
        assert row["met"] in (True, False, None)
        for figure in (row["paper"], row["measured"], row["wanted"], *row["ci95"]):
            assert figure is None or isinstance(figure, int | float)
        low, high = row["ci95"]
        if None not in (low, high, row["measured"]):
            assert low <= row["measured"] <= high, row["name"]
    names = [row["name"] for row in document["rows"]]
    assert len(names) == len(set(names)), "two rows of one name"

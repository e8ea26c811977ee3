"""What is measured of the journal's cost is the cost of a whole journal."""

from __future__ import annotations

from pathlib import Path

import pytest

from app.bench.journal import MOST_MB_S, SETTLE_S, measure_journal
from app.journal.info import journal_info
from app.journal.reader import open_journal
from app.replay.verify import verify


@pytest.mark.slow
def test_the_journal_that_is_measured_is_whole(tmp_path: Path) -> None:
    cost = measure_journal(seconds=5, targets=100, folder=tmp_path)
    journal = open_journal(tmp_path)
    found = verify(journal)
    assert found.difference is None
    assert found.pictures == cost.pictures > 5 * 25
    assert cost.tracks > 80
    info = journal_info(journal)
    assert info.octets == pytest.approx(cost.mb_s * 5e6, rel=0.01)
    assert cost.mb_s < MOST_MB_S
    assert cost.dropped == 0
    assert 0.0 < cost.writer < 0.5
    assert cost.with_us > 0.5 * cost.without_us > 0.0
    assert cost.share == cost.surface + cost.writer
    assert found.first is not None
    assert found.first > 1_700_000_000.0 + SETTLE_S

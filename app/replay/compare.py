"""The same day with other settings: what would have been different in tracks and alerts."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from app.journal.names import JournalError
from app.journal.reader import Journal, Record
from app.replay.recorded import changing, own_verbs
from app.replay.verify import ReplayEngine
from pipeline.engine_records import SNAPSHOT
from pipeline.lab.measure.compare_pictures import PictureComparison


def compare(
    journal: Journal,
    orders: Sequence[str],
    since: float | None = None,
    until: float | None = None,
    progress: Callable[[float], None] = lambda _: None,
) -> PictureComparison:
    """Run a journal with other settings (each "key=value") beside what was recorded.

    Begins from the first snapshot of each run, so that both sides start alike; later snapshots are passed over.
    Raises JournalError when the journal cannot be used, SettingsError for an order that cannot change anything.
    """
    replay, made = ReplayEngine(journal, changing(journal, orders), own_verbs(orders)), PictureComparison()
    for one in replay.replayed(since, until):
        if isinstance(one, Record):
            if one.topic == SNAPSHOT and replay.lost:
                replay.restore(one)
            continue
        progress(one.record.time)
        recorded, again = one.recorded, one.made
        if recorded is not None and again is not None and recorded.time == recorded.time:
            made.add(recorded.tracks, again.tracks)
            made.changes(recorded.changes, again.changes)
    if not made.pictures:
        raise JournalError(f"{journal.name}: no pictures to compare in this time")
    return made

"""The same day with other settings: what would have been different in tracks and alerts."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from app.journal.names import JournalError
from app.journal.reader import Journal, Record
from app.replay.recorded import changing, own_verbs
from app.replay.verify import ReplayEngine
from pipeline.engine_records import SNAPSHOT
from pipeline.lab.measure.compare_pictures import PictureComparison


@dataclass(frozen=True)
class Compared:
    """What came of a comparison. begun_empty: see `Verification`."""

    pictures: PictureComparison
    begun_empty: tuple[str, ...] = ()

    def document(self) -> dict[str, Any]:
        """As JSON values."""
        recorded, replayed = ([asdict(one) for one in side] for side in self.pictures.alerts())
        return {
            "pictures": self.pictures.pictures,
            "begun_empty": len(self.begun_empty),
            "notes": list(self.begun_empty),
            "rows": [asdict(one) for one in self.pictures.figures()],
            "only_recorded": recorded,
            "only_replayed": replayed,
        }


def compare(
    journal: Journal,
    orders: Sequence[str],
    since: float | None = None,
    until: float | None = None,
    progress: Callable[[float], None] = lambda _: None,
) -> Compared:
    """Run a journal with other settings (each "key=value") beside what was recorded.

    Begins from the first snapshot of each run, so that both sides start alike; later snapshots are passed over. Where
    that snapshot has another form than the engine's, its run begins with an empty engine (see `ReplayEngine`).
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
        if recorded is not None and again is not None:
            if recorded.time == recorded.time and again.time == again.time:  # neither refused a command
                made.add(recorded.tracks, again.tracks)
            made.changes(recorded.changes, again.changes)
    if not made.pictures:
        raise JournalError(f"{journal.name}: no pictures to compare in this time")
    return Compared(made, tuple(replay.counts.begun_empty))

"""Runs the engine on a journal's inputs again and compares every bit of what came out with what was recorded."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from typing import TypeVar

from app.journal.names import GAP, SNAPSHOT, JournalError
from app.journal.output import SEQUENCES
from app.journal.reader import Journal, Record
from app.journal.times import utc_text
from app.replay.recorded import RecordedRun, recorded_run
from app.replay.video import VideoReplay
from pipeline.alert.monitor import MonitorState
from pipeline.engine import SurfaceEngine
from pipeline.engine_records import CODEC, INPUT, OUTPUT, Shown, shown
from pipeline.inputs import Envelope
from pipeline.tables import SectorPlots, Tracks
from pipeline.tables.codec import OtherFormError
from pipeline.values import first_difference, other_form

log = logging.getLogger(__name__)

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Replayed:
    """One input run again. recorded: what the live engine made of it, made: what this one does; None for nothing.

    complete: the record of what the live engine made is there to be compared. The last input of a file that was cut
    off has none, and those from which the state is only rebuilt (see `ReplayEngine`) are not compared.
    """

    record: Record
    envelope: Envelope
    recorded: Shown | None
    made: Shown | None
    recorded_octets: bytes | None
    complete: bool = True


@dataclass
class Verification:
    """What was compared. difference: the first place where bits differ, in words; None: identical.

    begun_empty: where the replay began with an empty engine because of the form of a recorded state, a sentence each.
    """

    inputs: int = 0
    pictures: int = 0
    changes: int = 0
    snapshots: int = 0
    sectors: int = 0
    runs: int = 0
    gaps: int = 0
    failures: int = 0
    difference: str | None = None
    first: float | None = None
    last: float | None = None
    versions: dict[str, str] = field(default_factory=dict)
    begun_empty: list[str] = field(default_factory=list)

    @property
    def columns(self) -> int:
        """Columns of tracks compared."""
        return self.pictures * len(Tracks.columns())


class ReplayEngine:
    """The engine of a journal, fed record by record, and the chains of its radars where raw sweeps were recorded.

    change: gives the run that is to be replayed for a recorded one. own: verbs of the radars' chains that take their
    parts from the settings; the engine is then given the plots of these chains in place of the recorded ones.

    From a snapshot that an earlier version wrote in another form one cannot go on. The replay then begins with an empty
    engine at the first snapshot of the run; what comes before the place asked for only rebuilds the state and is not
    compared.
    """

    def __init__(
        self,
        journal: Journal,
        change: Callable[[RecordedRun], RecordedRun] = lambda run: run,
        own: frozenset[str] = frozenset(),
    ) -> None:
        self.journal = journal
        self.video: VideoReplay | None = None
        self._own = own
        self.engine: SurfaceEngine | None = None
        self.counts = Verification()
        self._change = change
        self._run: RecordedRun | None = None
        self._id = ""
        self._sequence: int | None = None
        self.detection_difference: str | None = None
        """Where the plots of a chain were not those recorded."""
        self._lost = True
        """No state to go on from: at the begin, and after a gap, up to the next snapshot."""
        self.begun_empty = False
        """This run was begun with an empty engine: its later snapshots are not the states that are reached here."""

    def replayed(self, since: float | None = None, until: float | None = None) -> Iterator[Replayed | Record]:
        """Every input with both outcomes, and every other record as it stands, in order.

        Raises JournalError."""
        self.journal.first_snapshot()
        begin, compared_from = self._begin(since)
        waiting: tuple[Record, Envelope, Shown | None] | None = None
        for record in self.journal.records(begin):
            if until is not None and record.time > until:
                break
            self._follow(record)
            if record.topic == OUTPUT and waiting is not None and not self._lost:
                if record.order < compared_from:
                    yield Replayed(*waiting[:2], None, waiting[2], None, complete=False)
                else:
                    yield Replayed(*waiting[:2], self._decoded(record, Shown), waiting[2], record.data)
                waiting = None
                continue
            if waiting is not None and (self._lost or record.topic in (INPUT, SNAPSHOT)):
                # records are missing: what the live engine made of the last input is not known
                there = not self._lost and record.order >= compared_from
                yield Replayed(*waiting[:2], None, waiting[2], None, complete=there)
                waiting = None
            if record.topic == INPUT and not self._lost:
                waiting = self._step(record)
            elif record.topic not in (INPUT, OUTPUT):
                if self.video is not None:
                    self.video.take(record)
                yield record
        if waiting is not None:
            yield Replayed(*waiting[:2], None, waiting[2], None, complete=False)

    def restore(self, snapshot: Record) -> None:
        """Go on from a snapshot, or with an empty engine where its form is another one than this version's.

        An empty engine has no tracks; the use of the runways and the numbers of alerts it takes where they can be read.

        Raises JournalError when it cannot be read, or does not fit the engine.
        """
        other = self._restored(snapshot)
        if other is not None:
            self.begun_empty = True
            self.counts.begun_empty.append(
                f"The state recorded at {utc_text(snapshot.time)} does not have the form of the engine that replays it"
                f" ({other}), so that the replay begins there with an empty engine."
            )
        self._lost = False

    def _begin(self, since: float | None) -> tuple[float | None, float]:
        """From where to read (None: the begin), and the place in the journal's time from which to compare."""
        if since is None:
            return None, -math.inf
        snapshot = next(self.journal.records(since))
        self._begin_run(snapshot.run)
        if self._restored(snapshot) is None:
            return since, -math.inf
        return self.journal.first_snapshot(snapshot.run), snapshot.order

    def _restored(self, snapshot: Record) -> str | None:
        """Restore the engine; what in the snapshot is of another form, and the engine then is empty. See `restore`."""
        assert self.engine is not None
        assert self._run is not None
        saved = None
        try:
            saved = CODEC.decode(snapshot.data)
            self.engine.restore(saved)
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            self.engine = self._run.engine()  # the state may have been taken by half
            other = str(error) if isinstance(error, OtherFormError) else None
            if saved is not None:
                other = other_form(saved, self.engine.save())
            if other is None:
                place = f"{self.journal.name}: the snapshot at {utc_text(snapshot.time)}"
                raise JournalError(f"{place}: {error}") from error
            if isinstance(saved, dict) and isinstance(monitor := saved.get("monitor"), MonitorState):
                self.engine.monitor.restore(monitor.before_traffic())
            return other
        return None

    @property
    def lost(self) -> bool:
        """There is no state to go on from before the next snapshot."""
        return self._lost

    def _follow(self, record: Record) -> None:
        if record.run != self._id:
            self._begin_run(record.run)
        elif self._sequence is not None and record.sequence != (self._sequence + 1) % SEQUENCES:
            self._lose()
        self._sequence = record.sequence
        if record.topic == GAP:
            self._lose()

    def _detected_again(self, record: Record, envelope: Envelope, recorded: SectorPlots) -> Envelope:
        """The sector as the chain makes it of the recorded sweeps, where these are there."""
        made = self.video.sector(recorded) if self.video is not None else None
        if made is None:
            return envelope
        self.counts.sectors += 1
        if self._own:
            return replace(envelope, body=made)
        present = recorded.with_present_marks()
        if not len(present.mark) and CODEC.encode(envelope) != record.data:
            # written before sectors had azimuth marks: the chain makes them, the record cannot have them
            made = replace(made, mark=present.mark, mark_time=present.mark_time)
        if CODEC.encode(made) != CODEC.encode(present):
            self.detection_difference = f"plots at {utc_text(record.time)}: {first_difference(present, made)}"
        return envelope

    def _lose(self) -> None:
        if not self._lost:
            self.counts.gaps += 1
        self._lost = True
        if self.video is not None:
            self.video.forget()

    def _decoded(self, record: Record, kind: type[T]) -> T:
        try:
            made = CODEC.decode(record.data)
            if not isinstance(made, kind):
                raise ValueError(f"it is a {type(made).__name__}, where a {kind.__name__} is wanted")
        except ValueError as error:
            at = utc_text(record.time)
            raise JournalError(f"{self.journal.name}: the {record.topic} at {at}: {error}") from error
        return made

    def _begin_run(self, id: str) -> None:
        self._id, self._lost, self._sequence, self.begun_empty = id, True, None, False
        attached = next((got for one in self.journal.files if (got := one.attachments(id))), {})
        run = self._change(recorded_run(attached, self.journal.name))
        self._run, self.engine = run, run.engine()
        self.video = VideoReplay(run, self._own)
        self.counts.runs += 1
        self.counts.versions = run.versions

    def _step(self, record: Record) -> tuple[Record, Envelope, Shown | None]:
        assert self.engine is not None
        envelope = self._decoded(record, Envelope)
        self.counts.inputs += 1
        if isinstance(envelope.body, SectorPlots):
            envelope = self._detected_again(record, envelope, envelope.body)
        try:
            made = shown(self.engine.step(envelope))
        except Exception:
            # the live engine failed at the same place, and went on
            self.counts.failures += 1
            log.debug("the engine could not take the input at %s", utc_text(record.time), exc_info=True)
            made = None
        return record, envelope, made


def verify(
    journal: Journal,
    since: float | None = None,
    until: float | None = None,
    progress: Callable[[float], None] = lambda _: None,
) -> Verification:
    """Run a journal again and stop at the first difference. progress: hears the time reached, UTC s.

    Raises JournalError when the journal cannot be read.
    """
    replay = ReplayEngine(journal)
    counts = replay.counts
    for one in replay.replayed(since, until):
        if isinstance(one, Record):
            if one.topic == SNAPSHOT:
                counts.difference = _at_snapshot(replay, one)
        else:
            counts.difference = replay.detection_difference or _compared(one, counts)
            counts.first = one.record.time if counts.first is None and one.complete else counts.first
            counts.last = one.record.time
            progress(one.record.time)
        if counts.difference is not None:
            break
    return counts


def _compared(one: Replayed, counts: Verification) -> str | None:
    if not one.complete:
        return None
    made = None if one.made is None else CODEC.encode(one.made)
    # what was recorded before tables and classes had all that they have now is the same as far as it goes
    if made == one.recorded_octets or (one.recorded is not None and CODEC.encode(one.recorded) == made):
        if one.made is not None:
            counts.pictures += one.made.time == one.made.time
            counts.changes += len(one.made.changes)
        return None
    place = f"input {one.record.sequence} ({type(one.envelope.body).__name__}) at {utc_text(one.record.time)}"
    if one.recorded is None or one.made is None:
        which = "recorded" if one.made is None else "replayed"
        return f"{place}: only the {which} engine made a picture of it"
    return f"{place}: {first_difference(one.recorded, one.made) or 'the octets differ, the values do not'}"


def _at_snapshot(replay: ReplayEngine, snapshot: Record) -> str | None:
    """Restore from the snapshot where there is nothing to go on from; elsewhere it must be the state reached."""
    if replay.begun_empty and not replay.lost:
        return None
    replay.counts.snapshots += 1
    if replay.lost:
        replay.restore(snapshot)
        return None
    assert replay.engine is not None
    reached = replay.engine.save()
    if CODEC.encode(reached) == snapshot.data:
        return None
    found = first_difference(CODEC.decode(snapshot.data), reached) or "the octets differ, the values do not"
    return f"snapshot {snapshot.sequence} at {utc_text(snapshot.time)}: {found}"

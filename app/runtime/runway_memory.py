"""How operators have set the runways, in a file that outlives the service: written at each order, in one step.

A file that cannot be read is told until every runway has been set again: a closed runway must not come back open
without anybody knowing.
"""

from __future__ import annotations

import hashlib
import logging
import re
import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import BinaryIO, Literal

import msgspec

from app.private_files import write_private_file
from pipeline.picture import RunwayState, SensorState

log = logging.getLogger(__name__)

MOST_OCTETS = 1_000_000
"""A larger file is none of these: a runway takes a hundred octets."""


class RunwayUse(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """How an operator has set a runway."""

    id: str
    open: bool
    in_use: str | None
    visibility: Literal["normal", "low"]


class Kept(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What the file holds. unknown: runways whose state was lost and that nobody has set since."""

    runways: list[RunwayUse]
    unknown: list[str]


class DamagedFile(ValueError):
    """The file is not what was written; the message says in which way."""


def encode(kept: Kept) -> bytes:
    """A line of JSON, and its SHA-256 in a second one."""
    line = msgspec.json.encode(kept)
    return line + b"\n" + hashlib.sha256(line).hexdigest().encode() + b"\n"


def decode(octets: bytes) -> Kept:
    """Raises DamagedFile."""
    line, _, rest = octets.partition(b"\n")
    if rest != hashlib.sha256(line).hexdigest().encode() + b"\n":
        raise DamagedFile("its check sum is wrong")
    try:
        return msgspec.json.decode(line, type=Kept)
    except (msgspec.DecodeError, RecursionError) as error:
        raise DamagedFile(str(error)) from error


class RunwayMemory:
    """folder: where the file lies. airport, mode: whose runways; those of a demonstration are not those of the field.

    Any thread may call.
    """

    def __init__(self, folder: Path, airport: str, mode: str, clock: Callable[[], float] = time.time) -> None:
        self.path = folder / f"runways-{re.sub(r'[^A-Za-z0-9]', '_', airport)[:16]}-{mode}.json"
        self.in_doubt = False
        self._clock = clock
        self._kept: dict[str, RunwayUse] = {}
        self._seen: dict[str, RunwayUse] = {}
        self._unknown: list[str] = []
        self._why = ""
        self._failing = ""
        self._told_at = 0.0
        self._lock = threading.Lock()

    def take_up(self, runways: Sequence[str], set_runway: Callable[..., RunwayState]) -> None:
        """Set the runways of this airport as the file says; what it does not tell is told by `state`."""
        try:
            with self.path.open("rb") as file:
                kept = decode(file.read(MOST_OCTETS))
        except FileNotFoundError:
            return
        except (OSError, DamagedFile) as error:
            kept = Kept([], list(runways))
            self._why = f"{self.path} cannot be read: {error}"
        unknown = [one for one in kept.unknown if one in runways]
        for use in kept.runways:
            if not self._set(use, runways, set_runway):
                unknown.append(use.id)
        self._unknown, self._told_at = sorted(set(unknown) & set(runways)), self._clock()
        if self._unknown:
            log.error("runways: %s", self._words())

    def _set(self, use: RunwayUse, runways: Sequence[str], set_runway: Callable[..., RunwayState]) -> bool:
        if use.id not in runways:
            log.warning("runways: %s, which was set before the restart, is not on the map any more", use.id)
            return True
        try:
            set_runway(use.id, open=use.open, in_use=use.in_use or "", visibility=use.visibility)
        except ValueError as error:
            set_runway(use.id, open=use.open, in_use="", visibility=use.visibility)
            self._why = f"{use.id} cannot be set as it was: {error}"
            return False
        self._kept[use.id] = use
        log.info("runways: %s is %s, as it was set before the restart", use.id, _in_words(use))
        return True

    def note(self, states: Sequence[RunwayState]) -> None:
        """Operators have set these; they are in the file when this returns, or `state` tells that they are not."""
        with self._lock:
            for one in states:
                self._kept[one.id] = _use(one)
                self._unknown = [other for other in self._unknown if other != one.id]
            octets = encode(Kept(list(self._kept.values()), self._unknown))

            def write(file: BinaryIO) -> None:
                file.write(octets)

            try:
                write_private_file(self.path, write)
            except OSError as error:
                if not self._failing:
                    log.error("runways: how they are set cannot be saved: %s", error)
                self._failing, self._told_at = error.strerror or str(error), self._clock()
            else:
                self._failing = ""

    def note_changed(self, states: Sequence[RunwayState]) -> None:
        """How the runways are in a new picture; noted when an order that was given up was done after all."""
        seen = {one.id: _use(one) for one in states}
        changed = [one for one in states if self._seen.get(one.id, seen[one.id]) != seen[one.id]]
        self._seen = seen
        if changed and self.in_doubt:
            self.in_doubt = False
            self.note(changed)

    def state(self) -> SensorState | None:
        """What operators must know of it; None when nothing is lost and all is saved."""
        words = self._words()
        if not words:
            return None
        return SensorState("runways", "store", "degraded", self._told_at, detail=words)

    def _words(self) -> str:
        told = []
        if self._unknown:
            why = f" ({self._why})" if self._why else ""
            told.append(
                f"how {', '.join(self._unknown)} was set before the restart is not known{why}: it is now as the "
                "settings say; check it and set it again"
            )
        if self._failing:
            told.append(f"how the runways are set cannot be saved and would be lost at a restart: {self._failing}")
        return "; ".join(told)


def _use(state: RunwayState) -> RunwayUse:
    return RunwayUse(state.id, state.open, state.in_use, state.visibility)


def _in_words(use: RunwayUse) -> str:
    words = ["open" if use.open else "closed"]
    words += [f"in use as {use.in_use}"] if use.in_use else []
    words += ["low visibility"] if use.visibility == "low" else []
    return ", ".join(words)

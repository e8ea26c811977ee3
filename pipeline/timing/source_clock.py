"""The clock of a source of reports or events: which stated times are taken, which corrected, and which refused."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from pipeline.timing.offset import OffsetEstimate
from pipeline.timing.words import describe, sentence

Floats = NDArray[np.float64]
ClockMode = Literal["auto", "taken", "corrected", "arrival"]

AHEAD_S = 0.1
"""Nothing arrives before it was measured, but two clocks that are both kept by NTP may differ by this much."""

END_FRACTION = 0.5
"""A correction ends when the offset is back within this fraction of the limit that began it, so that it does not come
and go."""


@dataclass(frozen=True, slots=True)
class ClockRules:
    """How the times of a source are taken.

    mode: "taken", as stated; "corrected", the estimated offset is removed; "arrival", stamped with the time of arrival;
    "auto", corrected only when latency cannot explain the offset: ahead by more than AHEAD_S or behind by more than
    max_latency_s. max_offset_s: what is further from the time of arrival is refused (a radar: re-based).
    """

    mode: ClockMode = "auto"
    max_offset_s: float = 5.0
    max_latency_s: float = 2.0

    def corrects(self, offset: float, corrected: bool) -> bool:
        """Whether an estimated offset (s) is to be removed. corrected: whether it is removed already."""
        if self.mode != "auto":
            return self.mode == "corrected"
        part = END_FRACTION if corrected else 1.0
        return offset > part * AHEAD_S or offset < -part * self.max_latency_s


class Verdict(NamedTuple):
    """time: (n,) UTC s, to be used where ok. ok: (n,) bool. words: why the first refused row was, for a status line;
    empty when none was. refused: of each refused row its place and reason ("ahead", "behind", "invalid"), and the
    sentence for its sender.
    """

    time: Floats
    ok: NDArray[np.bool_]
    words: str = ""
    refused: tuple[tuple[int, str, str], ...] = ()


class SourceClock:
    """Judges the times of one source. What is refused moves nothing."""

    def __init__(self, rules: ClockRules) -> None:
        self.rules = rules
        self._estimate = OffsetEstimate()
        self._correcting = False
        self._refused_offset: float | None = None

    @property
    def offset(self) -> float | None:
        """Stated less arrival, s: the estimate, or that of the newest rows when all of them were refused."""
        if self._refused_offset is not None:
            return self._refused_offset
        return None if math.isnan(self._estimate.value) else self._estimate.value

    @property
    def spread(self) -> float:
        """How far the offsets of single seconds lie apart, s: the jitter of the way here."""
        return self._estimate.spread

    @property
    def steps(self) -> int:
        """How often the offset has changed for good by more than half a second."""
        return self._estimate.steps

    def take(self, stated: Floats, arrival: float) -> Verdict:
        """Judge rows that arrived together. stated: (n,) s as the source says. arrival: UTC s."""
        stated = np.asarray(stated, np.float64)
        offset = stated - arrival
        finite = np.isfinite(offset)
        within = finite & (np.abs(offset) <= self.rules.max_offset_s)
        if self.rules.mode == "arrival":
            if finite.any():
                self._estimate.push(float(offset[finite].max()), arrival)
            return Verdict(np.full(len(stated), arrival), np.ones(len(stated), np.bool_))
        if within.any():
            self._estimate.push(float(offset[within].max()), arrival)
            self._refused_offset = None
        time = np.where(within, self._corrected(stated, arrival), stated)
        if within.all():
            return Verdict(time, within)
        if not within.any() and finite.any():
            self._refused_offset = float(np.median(offset[finite]))
        off = [(int(k), float(offset[k]), float(stated[k])) for k in np.flatnonzero(~within)]
        refused = tuple((k, _reason(one), sentence(one, at)) for k, one, at in off)
        return Verdict(time, within, describe(*off[0][1:]), refused)

    def _corrected(self, stated: Floats, arrival: float) -> Floats:
        if self.rules.mode == "taken":
            return stated
        self._correcting = self.rules.corrects(self._estimate.value, self._correcting)
        time = stated - self._estimate.value if self._correcting else stated
        limit = arrival if self._correcting else arrival + AHEAD_S
        return np.where(time > limit, arrival, time)


def _reason(offset: float) -> str:
    if not math.isfinite(offset):
        return "invalid"
    return "ahead" if offset > 0 else "behind"

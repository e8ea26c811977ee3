"""The clock of a radar. Video is never refused for its time: a clock that is wrong or steps is re-based at once."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from pipeline.timing.offset import STEP_S, OffsetEstimate
from pipeline.timing.source_clock import AHEAD_S, ClockRules, Floats
from pipeline.timing.words import amount, clock_time, guess, side

SLEW = 0.01
"""Small corrections come in at this rate (s/s): what it adds to the speed of a target is below what is measured."""

AHEAD_LIMIT_S = 0.5
"""A corrected time is never further ahead of its arrival than this: what is more is taken off at once, not slewed."""

HOST_BACK_S = 1.0
"""When arrival itself runs back by more than this, the host's clock was set, and the radar's times follow it."""

TOLD_S = 30.0
"""The status names a step of the clock for this long after it."""


class RadarClock:
    """Corrects the times of one radar's sweeps. They never run back, and steps of its clock are not seen in them.

    rules: `mode` as for other sources; an offset beyond `max_offset_s` is removed in every mode. period: nominal turn,
    s. azimuths: sweeps a turn.
    """

    def __init__(self, rules: ClockRules, period: float, azimuths: int) -> None:
        self.rules = rules
        self.correction = 0.0
        self.rebased = 0
        self._row_s = period / azimuths
        self._estimate = OffsetEstimate()
        self._correcting = False
        self._floor = -math.inf
        self._late = 0.0
        self._before: tuple[float, int, float] | None = None
        self._step: tuple[float, float] | None = None

    @property
    def offset(self) -> float | None:
        """Stated less arrival, s, with the least latency; None before the first sweep."""
        return None if math.isnan(self._estimate.value) else self._estimate.value

    @property
    def spread(self) -> float:
        """How far the offsets of single seconds lie apart, s."""
        return self._estimate.spread

    @property
    def late(self) -> bool:
        """The newest sweeps came too late to be of use: the corrected times are behind by more than max_latency_s."""
        return self._late > self.rules.max_latency_s

    def words(self, now: float) -> str:
        """What is wrong with the clock, for a person; empty when nothing is. now: time of arrival, UTC s."""
        if self.rules.mode == "arrival":
            return ""
        said = [f"video is over {math.floor(self._late)} s late"] if self.late else []
        offset = self.offset
        if offset is not None and abs(offset) > self.rules.max_offset_s:
            cause = guess(offset)
            said.append(f"clock {amount(offset)} {side(offset)}{f' ({cause})' if cause else ''}: corrected")
        if self._step is not None and 0 <= now - self._step[1] < TOLD_S:
            step, at = self._step
            said.append(f"clock stepped {'+' if step > 0 else '-'}{amount(step)} at {clock_time(at)}: corrected")
        return "; ".join(said)

    def take(self, stated: Floats, rows: NDArray[np.int64], arrival: float) -> Floats:
        """The corrected times of a block of sweeps, UTC s.

        stated: (n,) s. rows: (n,) ascending, turn * azimuths + row. arrival: UTC s of the newest of them.
        """
        if not len(stated):
            return stated
        if self._before is not None and arrival < self._before[2] - HOST_BACK_S:
            self._floor, self._before = -math.inf, None
            self._estimate.clear()
        begins = self._before is None
        jumps = self._jumps(stated, rows, arrival)
        turned = 0.0 if self._before is None else max(int(rows[-1]) - self._before[1], 0) * self._row_s
        self._before = (float(stated[-1]), int(rows[-1]), arrival)
        stepped = float(jumps.sum())
        if abs(stepped) > STEP_S:
            self.rebased += 1
            self._step = (stepped, arrival)
            self._estimate.shift(stepped)
        self._estimate.push(float(stated[-1]) - arrival, arrival)
        if self.rules.mode == "arrival":
            time = arrival - (rows[-1] - rows) * self._row_s
        else:
            before = self.correction - np.cumsum(jumps)
            self.correction -= stepped
            moved = self._lead(turned, begins)
            time = stated + before + moved
            time = time - self._pull_back(float(time[-1]) - arrival)
        time = np.maximum.accumulate(np.maximum(time, self._floor))
        self._floor = float(time[-1])
        self._late = arrival - self._floor
        return time

    def _jumps(self, stated: Floats, rows: NDArray[np.int64], arrival: float) -> Floats:
        """(n,) s by which the clock stepped before each sweep; nearly always 0.

        A step shows against both the rotation and the arrival: after an outage only the rotation is off, and after a
        delay on the way only the arrival.
        """
        jumps = np.zeros(len(stated))
        jumps[1:] = np.diff(stated) - np.diff(rows) * self._row_s
        if self._before is not None:
            last_stated, last_row, last_arrival = self._before
            turned = (int(rows[-1]) - last_row) * self._row_s
            passed = arrival - last_arrival
            by_turn = float(stated[0]) - last_stated - (int(rows[0]) - last_row) * self._row_s
            within = float(jumps[1:][np.abs(jumps[1:]) > STEP_S].sum())
            by_arrival = float(stated[-1]) - last_stated - within - passed
            if by_turn * by_arrival > 0 and min(abs(by_turn), abs(by_arrival)) > STEP_S:
                jumps[0] = by_turn if abs(passed - turned) < STEP_S else by_arrival
        jumps[np.abs(jumps) <= STEP_S] = 0.0
        return jumps

    def _lead(self, turned: float, begins: bool) -> float:
        """Move the correction towards where it shall be; by how much it moved, s. turned: s of rotation."""
        offset = self._estimate.value
        self._correcting = self.rules.corrects(offset, self._correcting) or abs(offset) > self.rules.max_offset_s
        missing = (-offset if self._correcting else 0.0) - self.correction
        at_once = abs(missing) > self.rules.max_offset_s or (self.late and missing > self.rules.max_latency_s)
        if begins or at_once:
            self.rebased += at_once
            moved = missing
        else:
            moved = min(max(missing, -SLEW * turned), SLEW * turned)
        self.correction += moved
        return moved

    def _pull_back(self, ahead: float) -> float:
        """Seconds to take off because times ran ahead of their arrival."""
        if self.rules.mode == "taken" and ahead <= self.rules.max_offset_s:
            return 0.0
        if ahead <= AHEAD_LIMIT_S:  # but what is corrected too far need not stay ahead
            too_far = self.correction + (self._estimate.value if self._correcting else 0.0)
            ahead = min(ahead, too_far) if too_far > 0 and ahead > AHEAD_S else 0.0
        self.correction -= ahead
        return ahead

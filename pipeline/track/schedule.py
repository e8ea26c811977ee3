"""When the beam of a radar passes each track, and at which of the radar's azimuth marks that look is decided."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from pipeline.kernels.compiled import allocating
from pipeline.sites import RadarSite
from pipeline.tables.arrays import Array, Floats
from pipeline.tables.marks import MARKS_A_TURN, PLACE, PLACES, mark_row
from pipeline.track.latency import CORROBORATED_S
from pipeline.track.radar_clock import NO_MARK, RadarClock
from pipeline.track.store import ENDED

TWO_PI = 2 * math.pi

ACCELERATION_SPREAD = 4.0
"""m^2/s^3, times the cube of the time ahead: variance of the position of a target that accelerates at random, 2 m in
the first second. Only tells when all that a gate can hold has been delivered."""

EXTENT_VARIANCE = 0.1
"""Variance of a centroid, as a fraction of the squared length of its target: a standard deviation of a third of it."""

RANGE_MARGIN_CELLS = 2.0
"""Range cells by which the gate reaches further: an echo is wider than its target by about one at either end."""

MOST_GUARD = 0.25
"""rad to both sides that a look waits for at most: a loose track near the radar is not worth a long delay."""

LEAST_DISTANCE = 1.0
"""m; a target nearer to the radar is taken to be this far when its gate is turned into an angle."""

MARGIN_ROWS = 1.0
"""Rows by which the gate is wider, for azimuths are rounded down to rows."""

WAKE_TURNS = 0.625
"""Turns after a look, from which on the next is planned: more than the half turn of marks that are decided together and
the guard by which a look may lie before them, lest the plan depend on which marks those are."""


HALF_TURN = MARKS_A_TURN // 2
"""Marks within which a radar looks at a track once at most."""


def starts_half(mark: int) -> bool:
    """Whether a half turn of its radar starts at a mark."""
    return mark % HALF_TURN == 0


class Marks(NamedTuple):
    """Marks of one radar that are decided together, k of them: number int64, absolute row, UTC s, s a turn.

    inferred: their times follow from sectors that brought no marks, and are learnt slowly.
    """

    radar: int
    number: Array
    row: Array
    time: Floats
    period: Floats
    inferred: bool = False


def next_marks(
    clocks: list[RadarClock], azimuths: Sequence[int], newest: float, began: float, until: float
) -> Marks | None:
    """The earliest marks of all radars that can be decided, of one radar; None when there are none yet.

    Marks are decided in the order of their times over all radars, so that it does not matter in what blocks the radars
    deliver: a mark waits for the other radars, but not for one that has fallen silent. newest: UTC s of the newest
    sweep of all. began: of the first. until: UTC s; a mark after it at which a half turn starts is not decided together
    with those before it. Nor are marks of two turns, or of more than half a turn, within which a radar looks at a track
    once at most; and the first after a gap, at which all looks of the gap are decided, stands alone.
    """
    ready = [clock.ready(one) for clock, one in zip(clocks, azimuths, strict=True)]
    firsts = [(float(clocks[r].mark_time[0]), r) for r, many in enumerate(ready) if many]
    if not firsts:
        return None
    _, radar = min(firsts)
    clock, last = clocks[radar], (math.inf, radar)
    for other, one in enumerate(clocks):
        if other == radar:
            continue
        if ready[other]:
            last = min(last, (float(one.mark_time[0]), other))
        elif one.awaited(newest, began):
            last = min(last, (one.decided_time, radar))
    times, numbers = clock.mark_time[: ready[radar]].tolist(), clock.mark[: ready[radar]].tolist()
    many, gap = 0, numbers[0] - clock.decided > HALF_TURN
    for number, time in zip(numbers, times, strict=True):
        apart = number - numbers[0] >= HALF_TURN or number % MARKS_A_TURN == 0 or (starts_half(number) and time > until)
        if (time, radar) > last or (many and (apart or gap)):
            break
        many += 1
    if not many:
        return None
    number = clock.mark[:many]
    made = Marks(
        radar, number, mark_row(number, azimuths[radar]), clock.mark_time[:many], clock.mark_period[:many],
        clock.last_mark == NO_MARK,
    )  # fmt: skip
    clock.spend(many)
    return made


class Looks(NamedTuple):
    """Looks that may be decided at some marks, k of them: row int64 of the store, time UTC s, guard rows on both sides
    that its gate covers, at: absolute row, near, due: numbers of the marks from which plots may lie in the gate, and at
    which the whole gate is closed.
    """

    row: Array
    time: Floats
    guard: Floats
    at: Array
    near: Array
    due: Array


def plan_looks(
    site: RadarSite, marks: Marks, tracks: Array, time: Floats, look: Array, gate: float, max_gate_m: float
) -> Looks:
    """The looks of one radar that may be decided at the marks; plans, in `look` (n,), those that are not yet.

    tracks: (n,) the tracker's records of the rows in use. time: (n,) UTC s of their states. Rows that the radar does
    not cover count as looked at.
    """
    video, n = site.video, len(look)
    radar = (
        site.east, site.north, float(max(video.first_range_m - video.range_step_m, 0.0)),
        float(video.first_range_m + (video.ranges - 0.5) * video.range_step_m), float(video.beamwidth_rad),
        float(video.range_step_m),
    )  # fmt: skip
    made = Looks(*(np.empty(n, kind) for kind in ("i8", "f8", "f8", "i8", "i8", "i8")))
    k = _plan(
        radar, video.azimuths, marks.number, marks.row, marks.time, marks.period, tracks, time, look, gate, max_gate_m,
        marks.inferred, *made,
    )  # fmt: skip
    return Looks(*(column[:k] for column in made))


@allocating
def _plan(
    radar: tuple[float, float, float, float, float, float], azimuths: int, number: Array, mark_rows: Array,
    mark_time: Floats, period: Floats, tracks: Array, time: Floats, look: Array, gate: float, max_gate: float,
    anew: bool, out_row: Array, out_time: Floats, out_guard: Floats, out_at: Array, out_near: Array, out_due: Array,
) -> int:  # fmt: skip
    last, k = len(number) - 1, 0
    for i in range(len(look)):
        one = look[i]
        if one["wake"] > number[last] or tracks[i]["phase"] == ENDED:
            continue
        b = 0
        while number[b] < one["wake"]:
            b += 1
        while True:
            behind = mark_rows[b] - one["row"] - one["guard"]
            if anew or not one["planned"] or behind >= azimuths:
                _plan_one(
                    radar, azimuths, mark_rows[b], mark_time[b], period[b], tracks[i], time[i], gate, max_gate, one
                )
            if one["covered"] or one["due"] > number[last]:
                break
            while number[b] < one["due"]:
                b += 1
            one["last"], one["planned"] = one["row"], False
            one["wake"] = _mark_after(one["last"] + WAKE_TURNS * azimuths, azimuths)
            if one["wake"] > number[last]:
                break
            while number[b] < one["wake"]:
                b += 1
        if not one["planned"]:
            continue
        one["wake"] = one["near"] if one["covered"] else one["due"]
        if one["covered"] and one["near"] <= number[last]:
            out_row[k], out_at[k], out_near[k], out_due[k] = i, one["row"], one["near"], one["due"]
            out_time[k], out_guard[k] = one["time"], one["guard"]
            k += 1
    return k


@allocating
def _mark_after(row: float, azimuths: int) -> int:
    """Number of the first mark that stands after an absolute row."""
    return math.floor((row * (PLACES * MARKS_A_TURN) / azimuths - PLACE) / PLACES) + 1


@allocating
def _plan_one(
    radar: tuple[float, float, float, float, float, float], azimuths: int, closed_to: int, now: float, period: float,
    track: Array, time: float, gate: float, max_gate: float, look: Array,
) -> None:  # fmt: skip
    east, north, nearest, farthest, beamwidth, step = radar
    x, p = track["state"], track["covariance"]
    length = max(track["length"] if math.isfinite(track["length"]) else 0.0, 2.0 * track["least_half_extent"])
    dt = now - time
    e = n = 0.0
    r = np.int64(0)
    for turn in range(2):
        e, n = x[0] + dt * x[2] - east, x[1] + dt * x[3] - north
        azimuth = math.atan2(e, n) % TWO_PI
        modulo = min(int(azimuth / TWO_PI * azimuths), azimuths - 1)
        if turn == 0:
            after = look["last"] + azimuths // 2
            r = after + 1 + (modulo - after - 1) % azimuths
            if r < closed_to - 2 * azimuths:
                r += (closed_to - r) // azimuths * azimuths
        else:
            r += (modulo - r + azimuths // 2) % azimuths - azimuths // 2
        dt = now - (closed_to - r) * period / azimuths - time
    distance = math.sqrt(e * e + n * n)
    spread = p[0, 0] + p[1, 1] + 2 * dt * (p[0, 2] + p[1, 3]) + dt * dt * (p[2, 2] + p[3, 3])
    manoeuvre, centroid = ACCELERATION_SPREAD * abs(dt) ** 3, EXTENT_VARIANCE * length**2
    if track["radar_time"] < now - CORROBORATED_S * max(period, 1.0):
        spread += track["latency_sd"] ** 2 * (x[2] * x[2] + x[3] * x[3])
    spread += manoeuvre + (distance * beamwidth) ** 2 + step * step + centroid
    reach = min(math.sqrt(gate * max(spread, 0.0)), max_gate) + 0.5 * length + RANGE_MARGIN_CELLS * step
    guard = min(reach / max(distance, LEAST_DISTANCE), MOST_GUARD) / TWO_PI * azimuths + MARGIN_ROWS
    # a scan left out is one look, not as many as turns went by
    late = int((closed_to - guard - r) // azimuths)
    if late > 0:
        r += late * azimuths
        dt += late * period
    look["planned"], look["covered"] = True, nearest <= distance <= farthest
    look["row"], look["time"], look["guard"] = r, time + dt, guard
    look["near"] = _mark_after(float(r - guard), azimuths)
    look["due"] = _mark_after(float(r + guard), azimuths)


def forget_plans(look: Array, rows: Array) -> None:
    """The looks of all radars at these rows are planned anew, for what is known of them has changed."""
    look["planned"][rows], look["wake"][rows] = False, 0


def close_looks(look: Array, rows: Array, at: Array, azimuths: int) -> None:
    """These looks (k,) of one radar, `look` (n,), at absolute rows `at` are over."""
    _close(look, rows, at, azimuths)


@allocating
def _close(look: Array, rows: Array, at: Array, azimuths: int) -> None:
    for k in range(len(rows)):
        one = look[rows[k]]
        one["last"], one["planned"] = at[k], False
        one["wake"] = _mark_after(at[k] + WAKE_TURNS * azimuths, azimuths)

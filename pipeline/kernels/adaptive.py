"""The sweep of the adaptive detector: compare, learn, and bring the patches up to date between scans."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from pipeline.kernels.bits import borrowed, count_runs
from pipeline.kernels.compiled import allocating, unchecked_division
from pipeline.kernels.rainfall import ALARM, DRY, fall_of_rain, find_sources, rise_together
from pipeline.kernels.run_cap import fit_row
from pipeline.kernels.tiles import (
    BASE,
    CENTRE,
    CLASS,
    FLOOR,
    FREE,
    KEEP,
    LEAST,
    MEAN,
    STILL,
    WET,
    learn_tiles,
    tile_bits,
    tile_bits_lowered,
    tile_limits,
)  # fmt: skip

TILE_ROWS = 16
"""Rows of a tile."""

LEARN_EVERY = 8
"""Once the start is over, a row learns in every eighth scan: its offsets then remember for minutes."""

HURRY = 4.0
"""At first a spread follows so many times faster than a mean would, which would not forget the first scans: with
a wrong spread, other cells are kept."""

SMALL = 500
"""A pavement patch of fewer cells may be filled by an aircraft: it is never far above its like."""

FEW = 0.45
"""Where less than this part of a patch is ordinary, it is the patch that has changed, not what stands on it."""

SPREADS = (0.93, 1.8)
"""Least and greatest spread to follow, relative to Rayleigh clutter."""

ENOUGH = 250
"""Cells that tell a level well."""

RAISED = 80
"""Steps by which the level of tiles with buildings is raised, as far as there is room: their other cells are below."""

TOGETHER = 5.0
"""Scans of nothing that eight cells of pavement together begin with."""

AGAIN = 6
"""Pavement begins by its like in the first scan, and in this one, when bright things tell less."""


class Rule(NamedTuple):
    """Settings in steps and scans, float32 where no other type is told.

    threshold, growth: above the level, at the spread of Rayleigh clutter; so are keep (what counts for the means) and
    least (what residuals are raised to). missing, magnitude: mean and mean magnitude of the residuals that are left of
    Rayleigh clutter; deviation: their standard deviation. calm, quick: gain of a level that does as expected, and of
    one that does not. spread, dry: gains of the spreads and of the dry levels. learn: scans before anything is shown.
    soft: scans in which all but pavement learns from everything. dead: what rain must raise a level by to count as
    rain. wet: how far above the rain alone the least level is, and pavement above its like at first.
    below: how far below the level the least is at least. long: times a row learns before its gain stays. first: scans
    of nothing that the offsets of each class begin with. most: greatest offset of each class, a byte each (uint64).
    """

    threshold: Any
    growth: Any
    keep: Any
    least: Any
    missing: Any
    magnitude: Any
    deviation: Any
    calm: Any
    quick: Any
    spread: Any
    dry: Any
    learn: Any
    soft: Any
    dead: Any
    wet: Any
    below: Any
    step_db: Any
    long: Any
    first: Any
    most: Any
    azimuths: Any


@allocating
def detect(
    amplitude: Any, rows: Any, scan: int, made: Any, rule: Any, layout: Any, cells: Any, patches: Any, swept: Any,
    cap: Any, tail: Any,
) -> None:  # fmt: skip
    """One block through the detector.

    made: mask, growth mask, and limits before the cap; (n) rows each, or none. rule: see `pipeline.detect.adaptive`.
    layout: what does not change; cells: offsets and their fractions, and how often each row has learned; patches:
    what is known of each; swept: the stripe being swept; all changed in place. tail: 64 bytes.
    """
    amplitude, rows, tail = borrowed(amplitude), borrowed(rows), borrowed(tail)
    mask, growth, used = borrowed(made[0]), borrowed(made[1]), borrowed(made[2])
    offset, fine, times, never_free = borrowed(cells[0]), borrowed(cells[1]), borrowed(cells[2]), borrowed(cells[3])
    rules, drops, pending, cursor = borrowed(swept[0]), borrowed(swept[1]), borrowed(swept[2]), borrowed(swept[3])
    refill, depth, budget, degraded, limits = cap
    n, ranges = amplitude.shape
    words = mask.shape[1]
    whole = ranges // 64
    rules_at, drops_at, tail_at = rules.ctypes.data, drops.ctypes.data, tail.ctypes.data
    if cursor[1] >= 0:
        _take_drops(layout[0][cursor[1]], patches[6], drops)  # they are not saved
    for i in range(n):
        row: Any = np.uintp(rows[i])
        if scan != cursor[0] or row // np.uintp(TILE_ROWS) != np.uintp(cursor[1]):
            _next_stripe(scan, row // np.uintp(TILE_ROWS), rule, layout, cells, patches, swept)
        cursor[2] += 1
        bits, own = mask[i], offset[row]
        row_at, own_at = amplitude.ctypes.data + np.uintp(i) * np.uintp(ranges), own.ctypes.data
        anything = np.uint64(0)
        for w in range(whole):
            at = np.uintp(64 * w)
            word = tile_bits(row_at + at, own_at + at, rules_at + at)
            bits[w] = word
            anything |= word
        if words > whole:
            at = np.uintp(64 * whole)
            _fill(tail, amplitude[i], whole, 0)
            bits[whole] = tile_bits(tail_at, own_at + at, rules_at + at)
            anything |= bits[whole]
        if used.size:
            _limits(own_at, rules_at, limits)
            used[i] = limits[:ranges]
        budget[0] = min(budget[0] + refill, depth)
        fits = True
        if anything:
            runs = count_runs(bits)
            fits = runs <= budget[0]
            if fits:
                budget[0] -= runs
            else:
                degraded[0] += 1
                _limits(own_at, rules_at, limits)
                fit_row(amplitude[i], limits.ctypes.data, bits, budget, tail)
        if growth.size:
            more = growth[i]
            for w in range(words):
                at = np.uintp(64 * w)
                from_at = row_at + at if w < whole else tail_at
                found = tile_bits_lowered(from_at, own_at + at, rules_at + at, drops_at + at)
                more[w] = found if fits else bits[w]
        if times[row] < rule.long or (scan + np.int64(row)) % LEARN_EVERY == 0:
            gains, most, strict = _gains(times[row], rule), rule.most, never_free[row]
            fine_at, sums_at = fine[row].ctypes.data, pending.ctypes.data
            times[row] += 1
            cursor[4] += 1
            for w in range(words):
                at = np.uintp(64 * w)
                if w == whole:
                    _fill(tail, amplitude[i], whole, 255)
                from_at = row_at + at if w < whole else tail_at
                learn_tiles(from_at, own_at + at, fine_at + at, rules_at + at, sums_at + at, strict[w], gains, most)


@allocating
def _fill(tail: Any, cells: Any, whole: int, rest: int) -> None:
    tail[:] = rest
    for j in range(cells.size - 64 * whole):
        tail[j] = cells[64 * whole + j]


@allocating
def _limits(own_at: int, rules_at: int, limits: Any) -> None:
    """Write the limits of one row."""
    for w in range(limits.size // 64):
        at = np.uintp(64 * w)
        tile_limits(own_at + at, rules_at + at, limits.ctypes.data + at)


@allocating
def _gains(times: int, rule: Any) -> Any:
    """The gain of each of the four classes, in 1/256, one a byte: of a mean that begins with some scans of nothing; and
    in the fifth how much sooner pavement follows eight cells together, as where a shadow ends."""
    four = np.uint64(0)
    for number in range(4):
        scans = min(times + rule.first[number], rule.long + rule.first[0])
        four |= np.uint64(min(256.0 / scans + 0.5, 255.0)) << np.uint64(8 * number)
    sooner = max(256.0 / (times + TOGETHER) - 256.0 / (times + rule.first[0]), 0.0)
    return four | (np.uint64(sooner + 0.5) << np.uint64(32))


@allocating
def _next_stripe(scan: int, stripe: int, rule: Any, layout: Any, cells: Any, patches: Any, swept: Any) -> None:
    """Hand over what the last stripe taught, and take the rules of the next."""
    tile = borrowed(layout[0])
    sums, rule_of, drop_of = borrowed(patches[4]), borrowed(patches[5]), borrowed(patches[6])
    rules, drops, pending, cursor = borrowed(swept[0]), borrowed(swept[1]), borrowed(swept[2]), borrowed(swept[3])
    if cursor[1] >= 0:
        of = tile[np.uintp(cursor[1])]
        for t in range(pending.size):
            sums[np.uintp(of[t])] += pending[t]
            pending[t] = 0
    if scan != cursor[0]:
        if cursor[0] >= 0:
            update_patches(rule, layout, cells, patches, cursor)
        cursor[0] = scan
        cursor[2] = 0
        cursor[4] = 0
    cursor[1] = stripe
    of = tile[np.uintp(stripe)]
    for t in range(rules.size):
        rules[t] = rule_of[np.uintp(of[t])]
    _take_drops(of, drop_of, drops)


@allocating
def _take_drops(of: Any, drop_of: Any, drops: Any) -> None:
    for k in range(drops.size):
        drops[k] = drop_of[of[k // 8]]


@unchecked_division
def update_patches(rule: Any, layout: Any, cells: Any, patches: Any, cursor: Any) -> None:
    """Bring the patches up to date with the scan that is over, and make their rules for the next."""
    macro, kind_class, expected = borrowed(layout[1]), borrowed(layout[2]), borrowed(layout[3])
    level, dry, spread, heard = borrowed(patches[0]), borrowed(patches[1]), borrowed(patches[2]), borrowed(patches[3])
    sums, rule_of, drop_of = borrowed(patches[4]), borrowed(patches[5]), borrowed(patches[6])
    rain, mean_at, least_at, gain_of = borrowed(patches[8]), borrowed(patches[9]), borrowed(patches[10]), patches[11]
    ahead, like = patches[14], layout[7]
    one = np.float32(1.0)
    fresh: Any = False
    full = cursor[2] == rule.azimuths
    share = np.float32(FEW * cursor[4] / rule.azimuths)
    cursor[3] += 1
    rise_together(rule, layout, patches)
    for p in range(level.size):
        packed = sums[p]
        sums[p] = 0
        count = np.float32(np.int64(packed & np.uint64(0xFFFF)))
        first = np.float32(np.int64((packed >> np.uint64(16)) & np.uint64(0xFFFFFF)))
        second = np.float32(np.int64(packed >> np.uint64(40)))
        n = max(count, one)
        young = heard[p] == 0
        told = count > 0
        scans = np.float32(heard[p])
        s = spread[p]
        moved = first / n + least_at[p] - (level[p] - mean_at[p])
        moved = moved if young else moved - rule.missing * s
        calm = min(rule.calm, n / np.float32(ENOUGH))
        surprise = moved * abs(moved) * n / (rule.deviation * rule.deviation * s * s) - one
        gain = calm + (rule.quick - calm) * min(max(surprise / np.float32(ALARM), np.float32(0.0)), one)
        gain = max(gain, one / (scans + one))
        few = full and not young and count < share * expected[p]
        move = rule.keep * s if few else gain * moved
        level[p] += move if told or few else np.float32(0.0)
        wider = second / (n * rule.magnitude) - s
        hurry = max(rule.spread, np.float32(HURRY) / (scans + np.float32(HURRY + 3.0)))
        faster = max(hurry * n / (n + np.float32(100.0)), one / (scans + np.float32(3.0)))
        drowned = kind_class[p] == 3 and rain[macro[p]] > np.float32(DRY)
        s = s if young or few or drowned or not told else s + faster * wider
        spread[p] = min(max(s, np.float32(SPREADS[0])), np.float32(SPREADS[1]))
        risen = level[p] - dry[p]
        slower = rule.dry if risen < rule.dead else rule.dry * np.float32(0.125)
        slower = max(np.float32(0.25) if risen < 0 else slower, one / (scans + one))
        dry[p] = level[p] if young else dry[p] + slower * risen
        gain_of[p] = gain
        ahead[p] = 0
        fresh |= told and (young or heard[p] == AGAIN - 1)
        heard[p] += np.int32(told or few)
    if fresh or cursor[3] % 16 == 0:
        find_sources(layout, heard, dry, patches[7], patches[13], rain)
    fall_of_rain(rule, layout, patches)
    if fresh:
        _begin(rule, layout, cells, patches)
    turn = np.float32(cursor[3] * 0.6180339887)
    dither = turn - np.floor(turn)
    for p in range(level.size):
        young = heard[p] == 0
        s = spread[p]
        if kind_class[p] == 0 and expected[p] < SMALL and like[p, 0] >= 0:
            level[p] = min(level[p], _greatest(like[p], heard, level, level[p]) + rule.wet)
        above = rule.threshold * s + ahead[p]
        base = np.floor(level[p] + above + np.float32(0.5))
        wet = min(rain[macro[p]] + rule.wet, level[p] - rule.below)
        mean = np.float32(0.0) if young else np.floor(level[p] + np.float32(0.5))
        least = np.float32(-128.0) if young else -np.floor(rule.least * s + np.float32(0.5))
        deaf = np.float32(heard[p]) < rule.learn or base > np.float32(127.0)
        free = kind_class[p] > 0 and np.float32(heard[p]) < rule.soft
        flags = np.uint64(STILL) if young else np.uint64(FREE) if free else np.uint64(0)
        mean_at[p] = mean
        least_at[p] = least
        rule_of[p] = (
            (_byte(base) << np.uint64(8 * BASE))
            | (_byte(np.float32(127.0) if deaf else np.floor(wet + above + np.float32(0.5))) << np.uint64(8 * FLOOR))
            | (_byte(mean) << np.uint64(8 * MEAN))
            | (_byte(np.floor(wet + np.float32(0.5))) << np.uint64(8 * WET))
            | (_byte(np.float32(126.0) if young else np.floor(rule.keep * s)) << np.uint64(8 * KEEP))
            | (_byte(np.floor(rule.missing * s + level[p] - mean + dither)) << np.uint64(8 * CENTRE))
            | (_byte(least) << np.uint64(8 * LEAST))
            | ((np.uint64(kind_class[p]) | flags) << np.uint64(8 * CLASS))
        )
        lower = base - np.floor(level[p] + rule.growth * s + np.float32(0.5))
        drop_of[p] = np.uint8(0 if deaf else min(max(lower, np.float32(0.0)), np.float32(127.0)))


@allocating
def _begin(rule: Any, layout: Any, cells: Any, patches: Any) -> None:
    """What patches that were just swept for the first time (and again some scans later) begin with.

    A patch of pavement begins not far above its like, because a parked aircraft may fill it. Pavement in a tile of
    several kinds begins at the level of its like, so that what stands on it from the first scan on stands out. A tile
    with buildings has its level raised, because its offsets must reach from pavement to walls.
    """
    tile, kind_class, like = layout[0], layout[2], layout[7]
    offset, strict = cells[0], cells[3]
    level, heard = patches[0], patches[3]
    raised = np.zeros(level.size, np.int64)
    for p in range(level.size):
        if heard[p] == 1 and kind_class[p] == 3:
            room = np.float32(119.0) - level[p] - rule.threshold * np.float32(1.5)
            raised[p] = np.int64(min(max(room, np.float32(0.0)), np.float32(RAISED)))
            level[p] += np.float32(raised[p])
        elif (heard[p] == 1 or heard[p] == AGAIN) and kind_class[p] == 0 and like[p, 0] >= 0:
            level[p] = min(level[p], _greatest(like[p], heard, level, level[p]) + rule.wet)
    for row in range(offset.shape[0]):
        of = tile[row // TILE_ROWS]
        for t in range(of.size):
            p = of[t]
            if raised[p] > 0:
                offset[row, 8 * t : 8 * t + 8] = np.int8(-raised[p])
            if (heard[p] != 1 and heard[p] != AGAIN) or like[p, 0] < 0 or kind_class[p] == 0:
                continue
            own = level[p] - np.float32(raised[p])
            begins = _greatest(like[p], heard, level, own) - level[p]
            for j in range(8):
                if (strict[row, t // 8] >> np.uint64(8 * (t % 8) + j)) & np.uint64(1):
                    offset[row, 8 * t + j] = np.int8(min(max(begins, np.float32(-127.0)), np.float32(127.0)))


@allocating
def _greatest(like: Any, heard: Any, level: Any, otherwise: Any) -> Any:
    """The greatest level of those patches that were swept."""
    greatest = np.float32(-1000.0)
    for q in like:
        if heard[q] > 0:
            greatest = max(greatest, level[q])
    return greatest if greatest > np.float32(-1000.0) else otherwise


@allocating
def _byte(value: Any) -> Any:
    """A signed number within a byte, in the low bits."""
    return np.uint64(np.int64(min(max(value, np.float32(-128.0)), np.float32(127.0)))) & np.uint64(255)

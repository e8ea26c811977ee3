"""The sweep of the adaptive detector: compare, learn, and bring patches up to date between scans."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from pipeline.kernels.bits import bits_above, bits_above_lowered, count_runs
from pipeline.kernels.run_cap import fit_row

ONE = 128
"""Units of an offset in one step of the log amplitude."""

LEARN_EVERY = 6
"""Once the start is over, a row learns in every sixth scan: its offsets then remember for minutes."""

STILL = 1.2
"""Steps that a patch's threshold must be off before it is moved: most rows then need no new limits."""

FEW = 0.45
"""Where less than this part of a patch is ordinary, it is the patch that has changed, not what stands on it."""

START_SCANS = 30
"""For so long grass, borders and buildings learn from everything, also from what stands out."""


@njit(nogil=True, cache=True)
def detect(
    amplitude: Any,
    rows: Any,
    scan: int,
    made: Any,
    rule: Any,
    layout: Any,
    memory: Any,
    cap: Any,
    limits: Any,
    tail: Any,
    growing: Any,
) -> None:
    """One block through the detector. made: mask, growth mask and limits used (n rows each, or none), written."""
    current = memory[7]
    refill, depth, budget, degraded = cap
    mask, growth, used = made
    growth_steps, lower = growing
    n, ranges = amplitude.shape
    words = mask.shape[1]
    whole = ranges // 64
    tail_at, lower_at = tail.ctypes.data, lower.ctypes.data
    for i in range(n):
        if scan != current[0]:
            if current[0] >= 0:
                _finish_scan(rule, layout, memory)
            current[0] = scan
        row = rows[i]
        cells, limit, bits = amplitude[i], limits[row], mask[i]
        _refresh(row, limit, rule, layout, memory)
        if used.size:
            used[i] = limit[:ranges]
        row_at, limits_at = cells.ctypes.data, limit.ctypes.data
        anything = np.uint64(0)
        for w in range(whole):
            at = np.uintp(64 * w)
            word = bits_above(row_at + at, limits_at + at)
            bits[w] = word
            anything |= word
        if words > whole:
            for j in range(ranges - 64 * whole):
                tail[j] = cells[64 * whole + j]
            bits[whole] = bits_above(tail_at, limits_at + np.uintp(64 * whole))
            anything |= bits[whole]
        if lower.size:
            _lower(row, lower, growth_steps, rule, layout, memory)
            more = growth[i]
            for w in range(whole):
                at = np.uintp(64 * w)
                more[w] = bits_above_lowered(row_at + at, limits_at + at, lower_at + at)
            if words > whole:
                at = np.uintp(64 * whole)
                more[whole] = bits_above_lowered(tail_at, limits_at + at, lower_at + at)
        budget[0] = min(budget[0] + refill, depth)
        if anything:
            runs = count_runs(bits)
            if runs <= budget[0]:
                budget[0] -= runs
            else:
                degraded[0] += 1
                fit_row(cells, limits_at, bits, budget, tail)
        due = (scan + row) % LEARN_EVERY == 0
        if due or current[2] < rule[5]:
            _learn(cells, limit, row, due, rule, layout, memory)


@njit(nogil=True, cache=True)
def _lower(row: int, lower: Any, growth_steps: float, rule: Any, layout: Any, memory: Any) -> None:
    """How far the growth threshold of each cell of the row lies below its threshold; 0 where nothing is shown yet."""
    run_at, runs = layout[0], layout[1]
    spread, heard = memory[2], memory[6]
    for k in range(run_at[row], run_at[row + 1]):
        p = runs[k, 2]
        steps = np.rint(growth_steps * _scale(spread[p], rule[1])) if heard[p] >= rule[8] else 0.0
        lower[runs[k, 0] : runs[k, 1]] = np.uint8(min(steps, 255.0))


@njit(nogil=True, cache=True)
def _refresh(row: int, limit: Any, rule: Any, layout: Any, memory: Any) -> None:
    """Bring the row's limits up to date where its patches or its offsets have moved since it was last swept."""
    run_at, runs = layout[0], layout[1]
    base, heard, moved, stale = memory[4], memory[6], memory[8], memory[9]
    own = memory[0][row]
    everything = stale[row] < 0
    for k in range(np.uintp(run_at[row]), np.uintp(run_at[row + 1])):
        p = np.uintp(runs[k, 2])
        if not everything and moved[p] <= stale[row]:
            continue
        level = np.int32(base[p]) if heard[p] >= rule[8] else np.int32(10_000)
        for j in range(np.uintp(runs[k, 0]), np.uintp(runs[k, 1])):
            value = level + ((np.int32(own[j]) + np.int32(ONE // 2)) >> np.int32(7))
            limit[j] = np.uint8(min(max(value, np.int32(0)), np.int32(255)))
    stale[row] = memory[7][1]


@njit(nogil=True, cache=True)
def _learn(cells: Any, limit: Any, row: int, due: bool, rule: Any, layout: Any, memory: Any) -> None:
    """Take one row into the sums of its patches, and let its offsets and limits follow. due: also the old patches."""
    _, rayleigh, margin, _, _, long, below, above, _ = rule
    run_at, runs, _, bounds, _, soft = layout
    offset, level, spread, bias, base, sums, heard, _, _, _ = memory
    own = offset[row]
    least_error, most_error = np.int32(-below * ONE), np.int32(above * ONE)
    for k in range(np.uintp(run_at[row]), np.uintp(run_at[row + 1])):
        p = np.uintp(runs[k, 2])
        age = np.float64(heard[p])
        if not due and age >= long:
            continue
        step = max(1.0 / long, 1.0 / (age + (2.0 if soft[p] else 12.0))) if age > 0 else 0.0
        gain = np.int32(8192 * step)
        middle, centre = np.int32(level[p] * ONE), np.int32(bias[p] * ONE)
        ordinary = np.int32((base[p] - margin * _scale(spread[p], rayleigh)) * ONE)
        learnable = np.int32(2**30) if soft[p] and age < START_SCANS else ordinary
        least, most = bounds[p, 0], bounds[p, 1]
        shown = np.int32(base[p]) if age >= rule[8] else np.int32(10_000)
        count, first, second, errors = np.int32(0), np.int32(0), np.int32(0), np.int32(0)
        # without a branch and in 32 bits, so that the compiler makes it one loop of vectors
        for j in range(np.uintp(runs[k, 0]), np.uintp(runs[k, 1])):
            rest = (np.int32(cells[j]) << np.int32(7)) - np.int32(own[j])
            apart = rest - middle
            kept = np.int32(rest <= ordinary)
            error = min(max(apart, least_error), most_error)
            coarse = (apart >> np.int32(5)) * kept
            count += kept
            first += (apart >> np.int32(2)) * kept
            second += coarse * coarse
            errors += (error >> np.int32(2)) * kept
            change = (((error - centre) * gain) >> np.int32(13)) * np.int32(rest <= learnable)
            new = min(max(np.int32(own[j]) + change, least), most)
            own[j] = np.int16(new)
            value = shown + ((new + np.int32(ONE // 2)) >> np.int32(7))
            limit[j] = np.uint8(min(max(value, np.int32(0)), np.int32(255)))
        sums[p, 0] += count
        sums[p, 1] += 4.0 * first
        sums[p, 2] += 1024.0 * second
        sums[p, 3] += 4.0 * errors
        sums[p, 4] += runs[k, 1] - runs[k, 0]


@njit(nogil=True, cache=True)
def _finish_scan(rule: Any, layout: Any, memory: Any) -> None:
    """Bring the patches that were swept up to date with the scan that is over."""
    mu, rayleigh, margin, level_gain, spread_gain = rule[0], rule[1], rule[2], rule[3], rule[4]
    macro, wide, soft = layout[2], layout[4], layout[5]
    _, level, spread, bias, base, sums, heard, current, moved_at, _ = memory
    current[1] += 1
    changes = np.zeros((macro.max() + 1, 2))
    fresh = np.zeros(level.size, np.bool_)
    for p in range(level.size):
        count, swept = sums[p, 0], sums[p, 4]
        if swept > 0 and count < FEW * swept:
            level[p] += margin  # most of it stands out: the ground itself has risen
            heard[p] += 1
        elif count > 0:
            moved = sums[p, 1] / count / ONE
            variance = max(sums[p, 2] / count / ONE**2 - moved**2, 0.0)
            faster = max(spread_gain, 1.0 / (heard[p] + 1.0))
            if heard[p] == 0:
                level[p] += moved
                fresh[p] = wide[p]
                if soft[p]:
                    spread[p] = np.sqrt(variance)
            else:
                spread[p] += faster * (np.sqrt(variance) - spread[p])
                bias[p] += faster * (sums[p, 3] / count / ONE - moved - bias[p])
                if not wide[p]:
                    level[p] += level_gain * moved
                    changes[macro[p], 0] += level_gain * moved * count
                    changes[macro[p], 1] += count
            heard[p] += 1
        sums[p] = 0.0
    for p in range(level.size):
        if wide[p] and not fresh[p] and changes[macro[p], 1] > 0:
            level[p] += changes[macro[p], 0] / changes[macro[p], 1]
        if heard[p] == 0:
            continue
        wanted = level[p] + mu * _scale(spread[p], rayleigh)
        if abs(wanted - base[p]) > STILL or heard[p] == np.int64(rule[8]):
            base[p] = np.int32(np.floor(wanted + 0.5))
            moved_at[p] = current[1]
    current[2] = current[1]
    for p in range(level.size):
        if heard[p] > 0:
            current[2] = min(current[2], heard[p])
    if fresh.any():
        _start_wide(layout, memory, fresh)


@njit(nogil=True, cache=True)
def _scale(spread: float, rayleigh: float) -> float:
    """How much wider than Rayleigh; the bounds are those of Weibull clutter worth following."""
    return min(max(spread / rayleigh, 0.93), 1.75)


@njit(nogil=True, cache=True)
def _start_wide(layout: Any, memory: Any, fresh: Any) -> None:
    """Cells beside a border begin at the greatest level of their macro-cell, and come down to their own."""
    run_at, runs, macro, bounds, _, _ = layout
    offset, level, heard, stale = memory[0], memory[1], memory[6], memory[9]
    stale[:] = -1
    highest = np.zeros(macro.max() + 1)
    for p in range(level.size):
        if heard[p] > 0:
            highest[macro[p]] = max(highest[macro[p]], level[p])
    for row in range(offset.shape[0]):
        own = offset[row]
        for k in range(run_at[row], run_at[row + 1]):
            p = runs[k, 2]
            if not fresh[p]:
                continue
            up = min(np.int64((highest[macro[p]] - level[p]) * ONE), np.int64(bounds[p, 1]))
            for j in range(runs[k, 0], runs[k, 1]):
                own[j] = up

"""Rain over the patches of the adaptive detector: told by the darkest ground, and added as power to all."""

from __future__ import annotations

from typing import Any

import numpy as np

from pipeline.kernels.bits import borrowed
from pipeline.kernels.compiled import allocating, unchecked_division

DRY = -1000.0
"""Rain of no power, in steps."""

UNSEEN = -170.0
"""Rain of less power is no rain: it is below any amplitude."""

ALARM = 8.0
"""A level that rises by a standard deviation more than its sample would is followed faster, and by three as fast as
allowed."""


@unchecked_division
def rise_together(rule: Any, layout: Any, patches: Any) -> None:
    """Raise the darkest patches by what they rose together with those near by, which is told sooner than by one."""
    near, lowest, boost = layout[5], patches[7], patches[12]
    level, spread, sums = borrowed(patches[0]), borrowed(patches[2]), borrowed(patches[4])
    heard, mean_at, least_at = borrowed(patches[3]), borrowed(patches[9]), borrowed(patches[10])
    for m in range(lowest.size):
        boost[m] = 0
        total, risen, width = np.float32(0.0), np.float32(0.0), np.float32(0.0)
        for k in range(near.shape[1] if lowest[m] >= 0 else 0):
            p = lowest[near[m, k]]
            count = np.float32(np.int64(sums[max(p, 0)] & np.uint64(0xFFFF)))
            if p >= 0 and heard[p] > 0 and count > 0:
                first = np.float32(np.int64((sums[p] >> np.uint64(16)) & np.uint64(0xFFFFFF)))
                risen += first + count * (least_at[p] - level[p] + mean_at[p] - rule.missing * spread[p])
                total += count
                width += count * spread[p] * spread[p]
        surprise = risen * risen / (rule.deviation * rule.deviation * max(width, np.float32(1.0))) - np.float32(1.0)
        if risen > 0:
            boost[m] = min(max(surprise / np.float32(ALARM), np.float32(0.0)), np.float32(1.0)) * risen / total
    for m in range(lowest.size):
        if lowest[m] >= 0:
            level[lowest[m]] += boost[m]


@unchecked_division
def fall_of_rain(rule: Any, layout: Any, patches: Any) -> None:
    """How hard it rains on each macro-cell, by the rise of its darkest patch, and the other patches raised by that: the
    power of rain adds to that of the ground. All limits are raised by what it will be if it grows on as it did."""
    macro, source = layout[1], patches[13]
    level, dry, heard = borrowed(patches[0]), borrowed(patches[1]), borrowed(patches[3])
    lowest, rain, gain_of, own, ahead = patches[7], patches[8], patches[11], patches[12], patches[14]
    to_power = np.float32(np.log(10.0) / 10.0) * rule.step_db
    nothing = np.float32(DRY)
    for m in range(own.size):
        dark = np.uintp(max(lowest[m], 0))
        rise = level[dark] - dry[dark]
        own[m] = nothing
        if lowest[m] >= 0 and rise > rule.dead:
            own[m] = dry[dark] + np.log(np.exp(rise * to_power) - np.exp(rule.dead * to_power)) / to_power
    changed = False
    for m in range(own.size):
        changed |= own[source[m]] != rain[m]
    if not changed:
        return
    for p in range(level.size):
        here = macro[p]
        before, after = rain[here], _fading(rain[here], own[source[here]], to_power)
        if before == after or heard[p] == 0:
            continue
        over = max(before, after) - dry[p]
        if over > np.float32(-20.0) / rule.step_db:
            was, now = np.exp((before - dry[p]) * to_power), np.exp((after - dry[p]) * to_power)
            ahead[p] = np.log(1 + max(now - was, np.float32(0.0)) / (1 + now)) / to_power
        if over > np.float32(-20.0) / rule.step_db and lowest[here] != p:
            level[p] += (np.float32(1.0) - gain_of[p]) * np.log((1 + now) / (1 + was)) / to_power
    for m in range(own.size):
        rain[m] = _fading(rain[m], own[source[m]], to_power)


@allocating
def _fading(before: Any, told: Any, to_power: Any) -> Any:
    """Rain is believed to grow as told, and to fade by a quarter of what is told: faint rain is told by fits."""
    if told >= before:
        return told
    kept = before + np.log(np.float32(0.75) + np.float32(0.25) * np.exp((told - before) * to_power)) / to_power
    return kept if kept > np.float32(UNSEEN) else np.float32(DRY)


@allocating
def find_sources(layout: Any, heard: Any, dry: Any, lowest: Any, source: Any, rain: Any) -> None:
    """The darkest telling patch of each macro-cell, and the macro-cell near it whose darkest patch tells most of its
    rain: dark and near. Where it rains they stay: another would tell of other rain, and the levels would jump."""
    macro, telling, near, apart = layout[1], layout[4], layout[5], layout[6]
    wet = np.zeros(lowest.size, np.bool_)
    for m in range(lowest.size):
        wet[source[m]] |= rain[m] > np.float32(DRY)
    for m in range(lowest.size):
        lowest[m] = lowest[m] if wet[m] else -1
    for p in range(heard.size):
        if heard[p] > 0 and telling[p] and not wet[macro[p]]:
            known = lowest[macro[p]]
            if known < 0 or dry[p] < dry[known]:
                lowest[macro[p]] = p
    for m in range(lowest.size):
        if rain[m] > np.float32(DRY):
            continue
        best = np.float32(1e9)
        for k in range(near.shape[1]):
            p = lowest[near[m, k]]
            if p >= 0 and dry[p] + apart[m, k] < best:
                best = dry[p] + apart[m, k]
                source[m] = near[m, k]

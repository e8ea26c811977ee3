"""What one radar closed comes in: it is checked, its plots wait in the radar's pool, its marks in the radar's clock."""

from __future__ import annotations

import math

from pipeline.tables import SectorPlots
from pipeline.track.core import Core
from pipeline.track.plot_pool import FUTURE, INVALID, LATE, STALE
from pipeline.track.radar_clock import RadarClock
from pipeline.track.step import advance_radars
from pipeline.track.store import NEVER

STALE_TURNS = 2
"""Turns that a plot may lie behind the antenna; the looks at which a track could have taken it are over by then."""

EARLY_TURNS = 0.5
"""Turns by which a plot may be newer than its sector: a large echo that is still open holds the sector's end back."""


def take_sector(core: Core, sector: SectorPlots) -> bool:
    """Take the plots of one sector and decide what can be decided. False, counted, when it cannot be taken."""
    if not _acceptable(core, sector):
        return False
    sector = sector.with_present_marks()
    site, clock = core.radars[sector.radar], core.clocks[sector.radar]
    azimuths = site.video.azimuths
    if core.began == NEVER:
        core.began = sector.time
    clock.heard(sector, azimuths, site.video.period_s)
    core.time = max(core.time, sector.time)
    core.count("sector_degraded", int(sector.degraded))
    if len(sector.plots):
        _pool(core, sector)
    clock.infer_marks(sector, azimuths)
    advance_radars(core, max(one.newest for one in core.clocks))
    return True


def _pool(core: Core, sector: SectorPlots) -> None:
    """Pool the plots of a sector that can be true; the others are counted."""
    site, clock, pool = core.radars[sector.radar], core.clocks[sector.radar], core.pools[sector.radar]
    azimuths, settings = site.video.azimuths, core.settings
    bounds = (
        sector.time - settings.timing.max_lag - clock.period,
        sector.time + EARLY_TURNS * clock.period,
        float(sector.closed_to - STALE_TURNS * azimuths),
    )
    fresh, found = pool.take_in(
        sector.plots, bounds, clock.antenna(azimuths), azimuths, sector.radar, settings.extent.aircraft_length
    )
    if len(fresh) < found.sum():
        for what, reason in ((INVALID, "invalid"), (LATE, "late"), (FUTURE, "future"), (STALE, "stale")):
            core.count(f"plot_{reason}", int(found[what]))
    position = fresh["position"]
    fresh["surface"] = core.zones.kind(position[:, 0], position[:, 1])
    clock.set_by(fresh["row"], fresh["time"], azimuths)
    pool.sort()


def _acceptable(core: Core, sector: SectorPlots) -> bool:
    if not 0 <= sector.radar < len(core.radars):
        core.count("sector_unknown_radar")
        return False
    clock = core.clocks[sector.radar]
    if not math.isfinite(sector.time):
        core.count("sector_invalid")
        return False
    empty = core.store.n == 0
    if not empty and sector.time < core.time - core.settings.timing.max_lag:
        core.count("sector_late")
        return False
    if sector.closed_to < clock.closed_to or sector.time < clock.newest:
        if not empty and sector.time <= clock.newest:
            core.count("sector_late")
            return False
        _restart(core, sector)
    if empty:
        core.time = sector.time  # nothing is held that time could harm: it starts anew
    return True


def _restart(core: Core, sector: SectorPlots) -> None:
    """The radar counts its rows anew."""
    core.count("radar_restarted")
    video, look = core.radars[sector.radar].video, core.store.look[:, sector.radar]
    core.clocks[sector.radar] = RadarClock(video.period_s)
    core.pools[sector.radar].clear()
    look["last"] = sector.closed_from - video.azimuths // 2
    look["planned"], look["wake"] = False, 0

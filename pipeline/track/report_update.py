"""Target reports: identity first, then position; an identity moves only on evidence."""

from __future__ import annotations

import numpy as np

from pipeline.contracts.associate import Assignment, Expected, Measured
from pipeline.tables import Source, TargetCategory, TargetReports, TrackPhase
from pipeline.tables.arrays import Array, Floats
from pipeline.track.core import Core, apply_positions, clear_identity, start_tracks, update_lifecycle
from pipeline.track.table import NEVER

WORST_ACCURACY = 1000.0
"""m; a report of a worse standard deviation is no position on an airport."""

ANTENNA_SD = 0.3
"""Standard deviation of the transmitter's antenna from the centre of the echo, as a fraction of the length, when it
is decided whether a report fits its track. Larger than `report_centroid_sd`, which weighs the update: to refuse a
true report costs more than to take one that is off."""

WINDOW_LAGS = 2.0
"""Longest allowed lags by which a report's time may differ from that at which tracks are expected."""

ADDRESS_HEAD_START = 2
"""Looks that count as hits beforehand of a track begun by a report with an address: only a transponder sends one."""

STANDING_SPEED = 1.0
"""m/s, below which a report without a course still has a velocity: nearly none."""

MOST_SPEED = 300.0
"""m/s, above which a reported speed is not believed; nothing flies faster near an airport."""

SPEED_SD, SPEED_SD_SHARE = 2.0, 0.05
"""m/s and fraction of the speed: standard deviation of each component of a reported velocity; ADS-B of NACv 2 states
3 m/s with 95 %, and the course is rounded."""


def take_target_reports(core: Core, reports: TargetReports) -> int:
    """Take reports in order of time; those of one address one after the other. How many were in time and in reach."""
    reports = _usable(core, reports)
    reports = reports[np.argsort(reports.time, kind="stable")]
    turn = _occurrence(reports.address)
    for number in range(int(turn.max()) + 1 if len(turn) else 0):
        _take_round(core, reports[turn == number])
    update_lifecycle(core)
    return len(reports)


def _usable(core: Core, reports: TargetReports) -> TargetReports:
    sane = np.isfinite(reports.east) & np.isfinite(reports.north)
    sane &= np.isfinite(reports.accuracy) & (reports.accuracy > 0) & (reports.accuracy < WORST_ACCURACY)
    core.count("report_invalid", int((~sane).sum()))
    with np.errstate(invalid="ignore"):
        far = np.hypot(reports.east, reports.north) > core.settings.coverage.report_range
        far |= reports.altitude > core.settings.coverage.report_ceiling
    core.count("report_out_of_area", int((sane & far).sum()))
    reports = reports[sane & ~far]
    return reports[core.in_time(reports.time, "report")]


def _occurrence(address: Array) -> Array:
    """How many reports of the same address stand before each; 0 for reports without an address."""
    order = np.argsort(address, kind="stable")
    ranked = address[order]
    fresh = np.r_[True, ranked[1:] != ranked[:-1]] if len(ranked) else np.zeros(0, np.bool_)
    place = np.arange(len(ranked))
    made = np.empty(len(ranked), np.int64)
    made[order] = np.where(ranked == "", 0, place - np.maximum.accumulate(np.where(fresh, place, 0)))
    return made


def _take_round(core: Core, reports: TargetReports) -> None:
    if not len(reports):
        return
    core.time = max(core.time, float(reports.time.max()))
    row = _known(core, reports)
    old = row >= 0
    late = old & (reports.time < core.column("time")[row] - core.settings.timing.max_lag) if core.table.n else old
    core.count("report_late", int(late.sum()))
    reports, row = reports[~late], row[~late]
    fits = _fits(core, reports, row)
    _apply(core, reports[fits], row[fits])
    lost = np.flatnonzero((row >= 0) & ~fits)
    moved = _reject(core, row[lost])
    named = (reports.address != "") & (row < 0)
    named[lost[moved]] = True
    _identify(core, reports[named])
    _apply_anonymous(core, reports[reports.address == ""])


def _known(core: Core, reports: TargetReports) -> Array:
    """The row of the track that bears each report's address, or -1."""
    ours = core.column("address")
    order = np.argsort(ours, kind="stable")
    if not len(ours):
        return np.full(len(reports), -1)
    where = order[np.minimum(np.searchsorted(ours, reports.address, sorter=order), len(ours) - 1)]
    return np.where((ours[where] == reports.address) & (reports.address != ""), where, -1)


def _noise(accuracy: Array) -> Floats:
    return np.asarray(accuracy.astype(np.float64) ** 2)[:, None, None] * np.eye(2)


def _fits(core: Core, reports: TargetReports, row: Array) -> Array:
    """Which reports of a known address lie where their track may be."""
    made = row >= 0
    rows, table = row[made], core.table
    mine = reports[made]
    state, covariance = core.filter.predict(table.state[rows], table.covariance[rows], mine.time - table.time[rows])
    expected = Expected(mine.time, state, covariance, np.zeros(len(rows)), core.extents(rows), np.zeros(len(rows)))
    along = (ANTENNA_SD * expected.extent[:, 0]) ** 2
    off = np.stack([mine.east, mine.north], axis=1) - state[:, :2]
    spread = covariance[:, :2, :2] + _noise(mine.accuracy) + along[:, None, None] * np.eye(2)
    squared = np.einsum("ni,nij,nj->n", off, np.linalg.inv(spread), off) if len(rows) else np.zeros(0)
    made[made] = squared <= core.settings.identity.gate
    return np.asarray(made)


def _reject(core: Core, row: Array) -> Array:
    """Count reports that do not fit the track (row) of their address; the mask of those whose address leaves it."""
    table = core.table
    table.misfit_reports[row] += 1
    moved = table.misfit_reports[row] >= core.settings.identity.patience
    core.count("report_implausible", int((~moved).sum()))
    core.count("identity_moved", int(moved.sum()))
    rows = row[moved]
    clear_identity(core, rows)
    # a track that no other sensor sees was made by these reports alone: it ends with them
    alone = (
        np.maximum(table.radar_time[rows], table.node_time[rows]) < core.time - core.settings.reporting.source_memory
    )
    table.updated[rows[alone]] = NEVER
    return np.asarray(moved)


def _apply(core: Core, reports: TargetReports, row: Array) -> None:
    """Update tracks by position and identity of their reports."""
    if not len(row):
        return
    noise = _noise(reports.accuracy)
    size = core.extents(row)
    noise += ((core.settings.measurement.report_centroid_sd * size[:, 0]) ** 2)[:, None, None] * np.eye(2)
    apply_positions(core, row, reports.time, np.stack([reports.east, reports.north], axis=1), noise, Source.REPORT)
    _describe(core, reports, row)


def _describe(core: Core, reports: TargetReports, row: Array) -> None:
    """Write what reports say of tracks besides their position."""
    table = core.table
    table.misfit_reports[row] = 0
    table.on_ground[row] = reports.on_ground
    heard = np.isfinite(reports.altitude)
    table.altitude[row[heard]] = reports.altitude[heard]
    table.altitude[row[~heard & reports.on_ground]] = np.nan
    named = reports.address != ""
    table.address[row[named]] = reports.address[named]
    table.simulated[row[named]] = reports.simulated[named]
    called = reports.callsign != ""
    table.callsign[row[called]] = reports.callsign[called]
    says = (reports.category > TargetCategory.UNKNOWN) & (reports.category <= TargetCategory.VEHICLE)
    table.claimed[row[says]] = table.category[row[says]] = reports.category[says]


def _pairs(core: Core, reports: TargetReports, rows: Array) -> Assignment:
    """Assign reports to the tracks `rows`, whoever they are."""
    table, at = core.table, float(np.median(reports.time))
    state, covariance = core.filter.predict(table.state[rows], table.covariance[rows], at - table.time[rows])
    k = len(rows)
    penalty = np.where(table.phase[rows] == TrackPhase.TENTATIVE, core.settings.measurement.tentative_penalty, 0.0)
    expected = Expected(
        np.full(k, at),
        state,
        covariance,
        np.full(k, WINDOW_LAGS * core.settings.timing.max_lag),
        core.extents(rows),
        penalty,
    )
    position = np.stack([reports.east, reports.north], axis=1)
    return core.associate(expected, Measured(reports.time, position, _noise(reports.accuracy)))


def _identify(core: Core, reports: TargetReports) -> None:
    """Give reports of an address that no track bears to the track without a name that fits, or start one."""
    if not len(reports):
        return
    table = core.table
    free = np.flatnonzero((core.column("address") == "") & (core.column("updated") > NEVER))
    answer = _pairs(core, reports, free)
    row = np.full(len(reports), -1)
    own = np.full(len(reports), np.inf)
    other = np.full(len(reports), np.inf)
    track = np.repeat(np.arange(len(free)), np.diff(answer.first))
    chosen = answer.measurement[track] == answer.pair
    row[answer.pair[chosen]] = free[track[chosen]]
    own[answer.pair[chosen]] = answer.cost[chosen]
    rest = answer.measurement[track] < 0
    np.minimum.at(other, answer.pair[rest], answer.cost[rest])
    near = np.isin(np.arange(len(reports)), answer.pair)
    unsure = ((row >= 0) & (other < own + core.settings.identity.ambiguity)) | ((row < 0) & near)
    for report in np.flatnonzero(unsure):
        uid = int(table.uid[row[report]]) if row[report] >= 0 else 0
        unsure[report] = not _repeated(core, str(reports.address[report]), uid)
    core.count("report_ambiguous", int(unsure.sum()))
    core.count("identified", int(((row >= 0) & ~unsure).sum()))
    for address in reports.address[~unsure]:
        core.undecided.pop(str(address), None)
    give = (row >= 0) & ~unsure
    _apply(core, reports[give], row[give])
    _start(core, reports[(row < 0) & ~unsure])


def _repeated(core: Core, address: str, uid: int) -> bool:
    """The same track (0: none) was the best for this address often enough in a row; counts this time, too."""
    before, times = core.undecided.get(address, (uid, 0))
    times = times + 1 if before == uid else 1
    core.undecided[address] = (uid, times)
    if len(core.undecided) > core.table.capacity:
        core.undecided.pop(next(iter(core.undecided)))
    return times > core.settings.identity.patience


def _apply_anonymous(core: Core, reports: TargetReports) -> None:
    """Reports without an address give their position to the track that fits, whoever it is, or start one."""
    if not len(reports):
        return
    everyone = np.flatnonzero(core.column("updated") > NEVER)
    answer = _pairs(core, reports, everyone)
    row = np.full(len(reports), -1)
    hit = answer.measurement >= 0
    row[answer.measurement[hit]] = everyone[hit]
    _apply(core, reports[row >= 0], row[row >= 0])
    alone = (row < 0) & ~np.isin(np.arange(len(reports)), answer.pair)
    core.count("report_ambiguous", int(((row < 0) & ~alone).sum()))
    _start(core, reports[alone])


def _start(core: Core, reports: TargetReports) -> None:
    if not len(reports):
        return
    table = core.table
    position = np.stack([reports.east, reports.north], axis=1)
    head_start = np.where(reports.address != "", ADDRESS_HEAD_START, 0)
    for number in np.unique(head_start):
        mine = reports[head_start == number]
        made = start_tracks(
            core, mine.time, position[head_start == number], _noise(mine.accuracy), Source.REPORT, mine.simulated,
            head_start=int(number),
        )  # fmt: skip
        rows = np.arange(made.start, made.stop)
        mine = mine[: len(rows)]
        core.count("report_started", len(rows))
        speed, course = mine.speed.astype(np.float64), mine.course.astype(np.float64)
        course = np.where(np.isfinite(course) | ~(speed < STANDING_SPEED), course, 0.0)
        knows = np.isfinite(speed) & np.isfinite(course) & (speed >= 0) & (speed < MOST_SPEED)
        k = rows[knows]
        table.state[k, 2], table.state[k, 3] = (speed * np.sin(course))[knows], (speed * np.cos(course))[knows]
        table.covariance[k, 2, 2] = table.covariance[k, 3, 3] = (SPEED_SD + SPEED_SD_SHARE * speed[knows]) ** 2
        table.velocity_unknown[k] = False
        _describe(core, mine, rows)

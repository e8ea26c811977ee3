"""Target reports: identity first, then position; an identity moves only on evidence."""

from __future__ import annotations

import numpy as np

from pipeline.contracts.associate import Association
from pipeline.contracts.measured import Hypotheses, Measured
from pipeline.tables import Source, TargetCategory, TargetReports
from pipeline.tables.arrays import Array, Floats
from pipeline.track.branching import likeliest
from pipeline.track.core import Core, clear_identity
from pipeline.track.judge import judge_tracks
from pipeline.track.latency import CORROBORATED_S, latency_noise, lateness, source_keys, with_latency
from pipeline.track.schedule import forget_plans
from pipeline.track.shape import extents
from pipeline.track.stated_velocity import stated_velocity
from pipeline.track.store import NEVER
from pipeline.track.update import add_score, renew, report_sensor, start_tracks, unknown_velocity, update_tracks

WORST_ACCURACY = 1000.0
"""m; a report of a worse standard deviation is no position on an airport."""

ANTENNA_SD = 0.3
"""Standard deviation of the transmitter's antenna from the centre of the echo, as a fraction of the length, when it
is decided whether a report fits its track. Larger than `report_centroid_sd`, which weighs the update: to refuse a
true report costs more than to take one that is off."""

YOUNG_GATE = 9.0
"""Squared Mahalanobis distance up to which a second report agrees with the velocity that the first stated; 99 %
in two dimensions."""

PART_GATE = 12.0
"""Square of how many standard deviations a report may lie from where the radar has just seen its target: 3.5, which
one report in 400 exceeds by chance; three in a row do not."""

PART_SD = 0.15
"""Standard deviation of the antenna from the centre of a plot, as a fraction of the length; of what is seen, half of
what may be wrong with a track (ANTENNA_SD)."""

PART_TIME_SD = 0.3
"""s, by which a track's velocity is not that of the time between a plot and a report: it brakes and turns."""

GROUND_ALTITUDE = 15.0
"""m above the airport up to which a target that does not say whether it is on the ground is held to be there: what the
slope of an airport and the error of a pressure altitude leave open."""

WINDOW_LAGS = 2.0
"""Longest allowed lags by which a report's time may differ from that at which tracks are expected."""

ADDRESS_HEAD_START = 2
"""Looks that count as hits beforehand of a track begun by a report with an address: only a transponder sends one."""


def take_target_reports(core: Core, reports: TargetReports) -> int:
    """Take reports in order of time; those of one address one after the other. How many were in time and in reach."""
    reports = _usable(core, reports)
    core.reports_taken += len(reports)
    reports = reports[np.argsort(reports.time, kind="stable")]
    turn = _occurrence(reports.address)
    for number in range(int(turn.max()) + 1 if len(turn) else 0):
        _take_round(core, reports[turn == number])
    rows = core.alive()
    judge_tracks(core, rows, np.full(len(rows), core.time))
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
    late = old & (reports.time < core.store.time[row] - core.settings.timing.max_lag)
    core.count("report_late", int(late.sum()))
    reports, row = reports[~late], row[~late]
    fits = _fits(core, reports, row, YOUNG_GATE)
    opened = _open_young(core, row, fits)
    fits[opened] = _fits(core, reports[opened], row[opened], core.settings.identity.gate)
    _apply(core, reports[fits], row[fits])
    lost = np.flatnonzero((row >= 0) & ~fits)
    lost = lost[~_begin_anew(core, reports[lost], row[lost])]
    moved = _reject(core, row[lost])
    named = (reports.address != "") & (row < 0)
    named[lost[moved]] = True
    _identify(core, reports[named])
    _apply_anonymous(core, reports[reports.address == ""])


def _known(core: Core, reports: TargetReports) -> Array:
    """The row of the track that bears each report's address, or -1."""
    rows = likeliest(core, core.alive()[core.column("named")[core.alive()]])
    if not len(rows):
        return np.full(len(reports), -1)
    ours = core.store.address[rows]
    order = np.argsort(ours, kind="stable")
    where = order[np.minimum(np.searchsorted(ours, reports.address, sorter=order), len(ours) - 1)]
    return np.where((ours[where] == reports.address) & (reports.address != ""), rows[where], -1)


def _noise(accuracy: Array) -> Floats:
    return np.asarray(accuracy.astype(np.float64) ** 2)[:, None, None] * np.eye(2)


def _positions(core: Core, reports: TargetReports, size: Floats, share: float) -> Measured:
    """Reports as measurements, at the times at which they were where they say, as far as that is known.

    size: (k, 3) extent of their targets, of whose length the antenna strays by `share`.
    """
    noise = _noise(reports.accuracy) + ((share * size[:, 0]) ** 2)[:, None, None] * np.eye(2)
    late, _ = core.latencies.of(source_keys(reports), reports.time)
    return Measured.of(
        reports.time - late, np.stack([reports.east, reports.north], axis=1), noise, speed=reports.speed,
        course=reports.course, altitude=reports.altitude, sensor=report_sensor(core),
    )  # fmt: skip


def _fits(core: Core, reports: TargetReports, row: Array, young_gate: float) -> Array:
    """Which reports of a known address lie where their track may be; for tracks of one report, within young_gate."""
    made = row >= 0
    rows, mine = row[made], reports[made]
    measured = _positions(core, mine, extents(core.store.records(rows)), ANTENNA_SD)
    _, (state, covariance) = core.predicted(rows, measured.time)
    spread = with_latency(state, covariance, _unsure(core, mine, rows))[:, :2, :2] + measured.noise
    off = measured.position - state[:, :2]
    squared = np.einsum("ni,nij,nj->n", off, np.linalg.inv(spread), off) if len(rows) else np.zeros(0)
    young = _alone(core, rows) & (core.store.hits[rows] == 1)
    gate = np.where(young, young_gate, core.settings.identity.gate)
    made[made] = (squared <= gate) & _beside_plot(core, mine, rows, measured)
    return np.asarray(made)


def _beside_plot(core: Core, reports: TargetReports, rows: Array, measured: Measured) -> Array:
    """Mask of the reports that lie where a radar has just seen their target.

    The state of a track lies between its plots and its reports, and so does not tell when they part: when a vehicle
    that the radar does not see drives away from a target that was given its address.
    """
    store = core.store
    velocity, since = store.state[rows, 2:], reports.time - store.radar_time[rows]
    with np.errstate(invalid="ignore"):
        there = store.plot_position[rows] + velocity * (measured.time - store.radar_time[rows])[:, None]
        length = extents(store.records(rows))[:, 0]
        variance = store.plot_variance[rows] + reports.accuracy.astype(np.float64) ** 2 + (PART_SD * length) ** 2
        late = _unsure(core, reports, rows) ** 2 + PART_TIME_SD**2
        variance = variance + late * (velocity**2).sum(axis=1)
        apart = ((measured.position - there) ** 2).sum(axis=1) > PART_GATE * variance
    return np.asarray(~(apart & (np.abs(since) < CORROBORATED_S)))


def _alone(core: Core, row: Array) -> Array:
    """Mask of the tracks that no sensor but reports has seen of late."""
    newest = np.maximum(core.store.radar_time[row], core.store.node_time[row])
    return np.asarray(newest < core.time - core.settings.reporting.source_memory)


def _open_young(core: Core, row: Array, fits: Array) -> Array:
    """Forget the stated velocity of tracks of one report which the second does not fit; which of `row` those are."""
    opened = np.flatnonzero((row >= 0) & ~fits)
    opened = opened[_alone(core, row[opened]) & (core.store.hits[row[opened]] == 1)]
    rows, store = row[opened], core.store
    if len(rows):
        core.count("report_velocity_dropped", len(rows))
        there = Measured.of(store.time[rows], store.state[rows, :2].copy(), store.covariance[rows, :2, :2].copy())
        core.filter.start(store, rows, there, unknown_velocity(core, len(rows)))
        renew(core, rows)
    return np.asarray(opened)


def _begin_anew(core: Core, reports: TargetReports, row: Array) -> Array:
    """Tracks of reports alone that do not fit for long follow their reports: they begin anew there, and stay what they
    are. Mask of the reports that were taken so."""
    store = core.store
    anew = _alone(core, row) & (store.misfit_reports[row] + 1 >= core.settings.identity.patience)
    rows, reports = row[anew], reports[anew]
    if len(rows):
        core.count("report_restarted", len(rows))
        measured = _positions(core, reports, np.zeros((len(rows), 3)), 0.0)
        core.filter.start(store, rows, measured, unknown_velocity(core, len(rows)))
        renew(core, rows)
        store.updated[rows] = store.report_time[rows] = reports.time
        forget_plans(store.look, rows)
        _describe(core, reports, rows)
    return anew


def _reject(core: Core, row: Array) -> Array:
    """Count reports that do not fit the track (row) of their address; the mask of those whose address leaves it."""
    store = core.store
    store.misfit_reports[row] += 1
    moved = store.misfit_reports[row] >= core.settings.identity.patience
    core.count("report_implausible", int((~moved).sum()))
    core.count("identity_moved", int(moved.sum()))
    clear_identity(core, row[moved])
    return np.asarray(moved)


def _apply(core: Core, reports: TargetReports, row: Array) -> None:
    """Update tracks by position and identity of their reports."""
    if not len(row):
        return
    reports, row = _for_all_hypotheses(core, reports, row)
    size, share = extents(core.store.records(row)), core.settings.measurement.report_centroid_sd
    _learn_latency(core, reports, row, _positions(core, reports, size, share))
    measured = _positions(core, reports, size, share)
    predicted, (state, covariance) = core.predicted(row, measured.time)
    measured.noise[:] += latency_noise(state, covariance, _unsure(core, reports, row))
    update_tracks(core, predicted, measured, Hypotheses.single(np.arange(len(row))), report_sensor(core), Source.REPORT)
    core.store.latency_sd[row] = core.latencies.of(source_keys(reports), reports.time)[1]
    add_score(core, row, report_sensor(core), core.settings.evidence.other_sensor)
    _describe(core, reports, row)


def _seen_by_radar(core: Core, reports: TargetReports, row: Array) -> Array:
    """Mask of the tracks that a radar, too, tells of."""
    slowest = max([1.0, *(one.period for one in core.clocks)])
    return np.asarray(core.store.radar_time[row] >= reports.time - CORROBORATED_S * slowest)


def _unsure(core: Core, reports: TargetReports, row: Array) -> Floats:
    """(k,) s, standard deviation of the latency of reports against what is known of their tracks.

    Where only reports tell of a track, it is as late as they are.
    """
    sd = core.latencies.of(source_keys(reports), reports.time)[1]
    return np.where(_seen_by_radar(core, reports, row), sd, 0.0)


def _learn_latency(core: Core, reports: TargetReports, row: Array, measured: Measured) -> None:
    """Where a radar tells where a moving target is, its reports tell how late their source is."""
    _, (state, covariance) = core.predicted(row, measured.time)
    late, variance = lateness(state, covariance, measured.position, measured.noise)
    keys = source_keys(reports)
    for k in np.flatnonzero(_seen_by_radar(core, reports, row) & np.isfinite(late)):
        core.latencies.learn(keys[k], float(reports.time[k]), float(late[k]), float(variance[k]))


def _for_all_hypotheses(core: Core, reports: TargetReports, row: Array) -> tuple[TargetReports, Array]:
    """Reports reach all rows of their targets."""
    if not core.associate.branching:
        return reports, row
    alive = core.alive()
    of, where = np.nonzero(core.store.target[row][:, None] == core.store.target[alive])
    return reports[of], alive[where]


def _describe(core: Core, reports: TargetReports, row: Array) -> None:
    """Write what reports say of tracks besides their position."""
    store = core.store
    store.misfit_reports[row] = 0
    heard = np.isfinite(reports.altitude)
    low = heard & (reports.altitude <= GROUND_ALTITUDE)
    told = reports.ground_known | heard
    on_ground = np.where(reports.ground_known, reports.on_ground, low)
    store.on_ground[row[told]] = on_ground[told]
    store.altitude[row[heard]] = reports.altitude[heard]
    store.altitude[row[~heard & told & on_ground]] = np.nan
    named = reports.address != ""
    store.address[row[named]] = reports.address[named]
    store.named[row[named]] = True
    store.simulated[row[named]] = reports.simulated[named]
    called = reports.callsign != ""
    store.callsign[row[called]] = reports.callsign[called]
    says = (reports.category > TargetCategory.UNKNOWN) & (reports.category <= TargetCategory.VEHICLE)
    store.claimed[row[says]] = store.category[row[says]] = reports.category[says]


def _pairs(core: Core, reports: TargetReports, rows: Array) -> Association:
    """Assign reports to the tracks `rows`, whoever they are."""
    at = np.full(len(rows), float(np.median(reports.time)))
    _, moments = core.predicted(rows, at)
    window = np.full(len(rows), WINDOW_LAGS * core.settings.timing.max_lag)
    unsure = core.latencies.of(source_keys(reports), reports.time)[1]
    expected = core.expected(rows, at, moments, window, float(unsure.max()))
    measured = _positions(core, reports, np.zeros((len(reports), 3)), 0.0)
    return core.associate(expected, measured, np.arange(len(rows)), np.arange(len(reports), dtype=np.int32))


def _taken(answer: Association) -> Array:
    """(n,) the report that each track takes in its likeliest hypothesis, -1 for none."""
    hypotheses = answer.hypotheses
    made = np.full(len(hypotheses.track_first) - 1, -1, np.int64)
    for track in range(len(made)):
        first, last = hypotheses.track_first[track : track + 2]
        best = first + int(np.argmax(hypotheses.log_weight[first:last]))
        if hypotheses.plot_first[best] < hypotheses.plot_first[best + 1]:
            made[track] = hypotheses.plot[hypotheses.plot_first[best]]
    return made


def _identify(core: Core, reports: TargetReports) -> None:
    """Give reports of an address that no track bears to the track without a name that fits, or start one."""
    if not len(reports):
        return
    alive = likeliest(core, core.alive())
    free = alive[~core.store.named[alive] & (core.store.updated[alive] > NEVER)]
    answer = _pairs(core, reports, free)
    taken = _taken(answer)
    row = np.full(len(reports), -1)
    own = np.full(len(reports), np.inf)
    other = np.full(len(reports), np.inf)
    track = np.repeat(np.arange(len(free)), np.diff(answer.first))
    chosen = taken[track] == answer.pair
    row[answer.pair[chosen]] = free[track[chosen]]
    own[answer.pair[chosen]] = answer.cost[chosen]
    rest = taken[track] < 0
    np.minimum.at(other, answer.pair[rest], answer.cost[rest])
    near = np.isin(np.arange(len(reports)), answer.pair)
    unsure = ((row >= 0) & (other < own + core.settings.identity.ambiguity)) | ((row < 0) & near)
    for report in np.flatnonzero(unsure):
        uid = int(core.store.target[row[report]]) if row[report] >= 0 else 0
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
    if len(core.undecided) > core.store.capacity:
        core.undecided.pop(next(iter(core.undecided)))
    return times > core.settings.identity.patience


def _apply_anonymous(core: Core, reports: TargetReports) -> None:
    """Reports without an address give their position to the track that fits, whoever it is, or start one."""
    if not len(reports):
        return
    alive = likeliest(core, core.alive())
    everyone = alive[core.store.updated[alive] > NEVER]
    answer = _pairs(core, reports, everyone)
    taken = _taken(answer)
    row = np.full(len(reports), -1)
    row[taken[taken >= 0]] = everyone[taken >= 0]
    _apply(core, reports[row >= 0], row[row >= 0])
    alone = (row < 0) & ~np.isin(np.arange(len(reports)), answer.pair)
    core.count("report_ambiguous", int(((row < 0) & ~alone).sum()))
    _start(core, reports[alone])


def _start(core: Core, reports: TargetReports) -> None:
    """Begin tracks; the velocity that their reports state is believed with a doubt."""
    if not len(reports):
        return
    head_start = np.where(reports.address != "", ADDRESS_HEAD_START, 0)
    for number in np.unique(head_start):
        mine = reports[head_start == number]
        rows = start_tracks(
            core, _positions(core, mine, np.zeros((len(mine), 3)), 0.0), stated_velocity(core, mine),
            report_sensor(core), Source.REPORT, mine.simulated, head_start=int(number),
        )  # fmt: skip
        core.count("report_started", len(rows))
        core.store.latency_sd[rows] = core.latencies.of(source_keys(mine), mine.time)[1][: len(rows)]
        _describe(core, mine[: len(rows)], rows)

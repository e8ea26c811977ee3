"""Alerts where none is due, and alerts that one intruder raises."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self

import numpy as np

from pipeline.lab.evaluate import Figure, RecordedTraffic, Row, Trial
from pipeline.lab.evaluate.alert_feeds import (
    Listener,
    Said,
    make_engine,
    radar_inputs,
    report_inputs,
    world_of,
)
from pipeline.lab.evaluate.reported_tracks import reports_of
from pipeline.lab.evaluate.statistics import mean_interval
from pipeline.lab.simulate.incidents import uses
from pipeline.lab.simulate.nodes import node_sites
from pipeline.lab.simulate.paths import Truth
from pipeline.lab.simulate.recording import recorded_movements
from pipeline.lab.simulate.world import World, build_world, in_use
from pipeline.picture import Alert, AlertChange
from pipeline.tables import SectorPlots

CASES = ("demonstration", "reports", "radar")
SEEDS = 5
"""Every case is run with the seeds 1 to this."""

MOST_ALERTS = 1.2
"""Alerts that an intruder may raise on the average: one conflict is one alert."""

NEAR_M = 60.0
"""A target of an alert this near to where an intruder is, is that intruder: a radar track may have no name yet."""

SETTLE_S = 30.0
"""s at the beginning in which the detector learns and tracks are confirmed: intruders of that time do not count."""

AFTER_S = 40.0
"""s from passing the hold until an intruder has left the runway; one that has not at the end does not count."""


@dataclass(frozen=True)
class Alerts:
    """traffic: the recordings. first_incident_s, every_s: when the demonstration's intruders are due, as by default.

    longest_s: of each run.
    """

    title: ClassVar[str] = "Alerts: how many an intruder raises, and false ones in recorded traffic"
    source: ClassVar[str] = "Airside's own requirement; no paper"
    reading: ClassVar[str] = (
        "Seeds 1 to 5 each. Demonstration: recorded movements, vehicles and scripted intruders, through simulated radar"
        " video, node events and reports; an alert belongs to the intruder that it names or that is within 60 m of a"
        " target of it. Recorded traffic: nothing is invented, and every alert is false. As reports alone: as they"
        " were received where the file holds them, three in a hundred lost. Through the radar: the movements, cleaned,"
        " as radar video of a surface movement radar, once alone and once with node events and reports. False alarms"
        " are alerts that were an alarm at least once; the others are information."
    )
    trials: int = len(CASES) * SEEDS
    traffic: tuple[RecordedTraffic, ...] = ()
    first_incident_s: float = 45.0
    every_s: float = 90.0
    longest_s: float = 3600.0 * 24

    def quick(self) -> Self:
        """Two minutes of each, with one seed."""
        return replace(self, trials=len(CASES), longest_s=120.0)

    def trial(self, chance: np.random.Generator, number: int, clock: Callable[[], float]) -> Trial:
        """One case with one seed. Raises ValueError without recorded traffic.

        demonstration: each (n intruders), the alerts of each; other, texts of the alerts of no intruder. reports,
        radar (and named, the same with reports): alarms and information, texts; seconds that were played.
        """
        if not self.traffic:
            raise ValueError("this experiment works on recorded traffic: say which (--file)")
        case, seed = CASES[number % len(CASES)], number // len(CASES) % SEEDS + 1
        if case == "demonstration":
            return self._demonstration(seed)
        parts = [(self._reports if case == "reports" else self._radar)(one, seed) for one in self.traffic]
        return {name: np.concatenate([one[name] for one in parts]) for name in parts[0]}

    def rows(self, results: Sequence[Trial]) -> tuple[Row, ...]:
        """Alerts an intruder and intruders without one; false alarms and other false alerts of each way."""
        demos, reported, radar = (results[k :: len(CASES)] for k in range(len(CASES)))
        made: list[Row] = []
        if demos:
            each = np.concatenate([one["each"] for one in demos]).astype(np.float64)
            low, high = mean_interval(each) if len(each) > 1 else (np.nan, np.nan)
            mean = float(each.mean()) if len(each) else float("nan")
            name = "demonstration"
            made += [
                Row(f"{name}: alerts an intruder", mean, low, high, "", better="lower", wanted=MOST_ALERTS),
                _count(f"{name}: most alerts of one intruder", int(each.max(initial=0))),
                _count(f"{name}: intruders", len(each)),
                _count(f"{name}: intruders without an alert", int((each == 0).sum()), wanted=0.0),
                _count(f"{name}: alerts without an intruder", sum(len(one["other"]) for one in demos)),
            ]
        for way, found, prefix in (
            ("as reports alone", reported, ""),
            ("through the radar alone", radar, ""),
            ("through the radar, with reports", radar, "named_"),
        ):
            if found:
                alarms, others = (sum(len(one[prefix + of]) for one in found) for of in ("alarms", "information"))
                made += [
                    _count(f"recorded traffic {way}: false alarms", alarms, wanted=0.0),
                    _count(f"recorded traffic {way}: false information", others),
                ]
                hours = sum(float(one["seconds"].sum()) for one in found) / 3600.0
                made.append(Row(f"recorded traffic {way}: played", hours, hours, hours, "h"))
        return tuple(made)

    def figures(self, results: Sequence[Trial]) -> tuple[Figure, ...]:
        """None: the rows say it all."""
        return ()

    def _demonstration(self, seed: int) -> Trial:
        """One turn of the demonstration's loop."""
        of = self.traffic[0]
        world = build_world(
            of.airport, of.recording, start=of.recording.start, seed=seed,
            first_incident=self.first_incident_s, incident_every=self.every_s,
        )  # fmt: skip
        seconds = min(self.longest_s, of.recording.length)
        nodes = node_sites(of.airport)
        listener = Listener(make_engine(of.airport, world.runways or {}, (of.radar,), nodes))
        blame = Blame(world)
        for envelope in radar_inputs(world, of.radar, nodes, seed, seconds):
            before = len(listener.told)
            listener.hear(envelope)
            blame.look(listener.told[before:])
        each, other = blame.result(world.start + SETTLE_S, world.start + seconds - AFTER_S)
        return {"each": each, "other": other}

    def _reports(self, of: RecordedTraffic, seed: int) -> Trial:
        runways = in_use(uses(recorded_movements(of.recording), of.airport))
        listener = Listener(make_engine(of.airport, runways))
        reports = reports_of(of.recording) if of.reports is None else of.reports
        begin = end = 0.0
        for envelope in report_inputs(reports, seed, smoothed=of.reports is None, seconds=self.longest_s):
            begin, end = begin or envelope.arrival, envelope.arrival
            listener.hear(envelope)
        return _said(listener.told) | {"seconds": np.array([end - begin])}

    def _radar(self, of: RecordedTraffic, seed: int) -> Trial:
        world = world_of(of.airport, of.recording, seed)
        nodes = node_sites(of.airport)
        runways, seconds = world.runways or {}, min(self.longest_s, of.recording.length)
        alone = Listener(make_engine(of.airport, runways, (of.radar,)), takes=(SectorPlots,))
        named = Listener(make_engine(of.airport, runways, (of.radar,), nodes))
        for envelope in radar_inputs(world, of.radar, nodes, seed, seconds):
            alone.hear(envelope)
            named.hear(envelope)
        with_reports = {f"named_{name}": texts for name, texts in _said(named.told).items()}
        return _said(alone.told) | with_reports | {"seconds": np.array([seconds])}


EXPERIMENT = Alerts


class Blame:
    """Finds the intruder of every alert of the demonstration."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._addresses = {one.vehicle.address for one in world.incidents}
        self._of: dict[int, str] = {}
        self._texts: dict[int, str] = {}

    def look(self, changes: Sequence[AlertChange]) -> None:
        """Take the changes of one look. An alert that has no intruder yet may get one later."""
        for change in changes:
            alert = change.alert
            self._texts.setdefault(alert.id, f"{change.time:.1f} {alert.text}")
            if alert.id not in self._of and change.operation in ("raise", "update"):
                intruder = self._intruder(alert, self._world.truth(change.time))
                if intruder is not None:
                    self._of[alert.id] = intruder

    def result(self, since: float, until: float) -> tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]:
        """(alerts of each intruder that passed its hold between these UTC s, texts of the alerts of no intruder)."""
        passed = [one.vehicle.address for _, one in self._world.incident_times(since, until)]
        raised = list(self._of.values())
        other = [text for id, text in self._texts.items() if id not in self._of]
        return np.array([raised.count(one) for one in passed], np.int64), np.array(other, np.str_)

    def _intruder(self, alert: Alert, truth: Truth) -> str | None:
        named = {one.address for one in alert.targets if one.address} & self._addresses
        if named:
            return min(named)
        there = truth[np.isin(truth.address, list(self._addresses))]
        for one in alert.targets:
            away = np.hypot(there.east - one.east, there.north - one.north)
            if one.address is None and len(away) and away.min() <= NEAR_M:
                return str(there.address[int(away.argmin())])
        return None


def _said(told: Sequence[AlertChange]) -> dict[str, np.ndarray[Any, Any]]:
    said = Said.of(told)
    return {"alarms": np.array(said.alarms, np.str_), "information": np.array(said.information, np.str_)}


def _count(name: str, number: int, wanted: float | None = None) -> Row:
    return Row(name, number, number, number, "", better="near" if wanted is None else "lower", wanted=wanted)

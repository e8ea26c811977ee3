"""The alert monitor: tracks in, changes of alerts out. It holds all the state that alerting has."""

from __future__ import annotations

import copy
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from pipeline.airport.model import Airport
from pipeline.airport.runway_frames import HoldFrames, RunwayFrames
from pipeline.alert.life import Case, LifeSettings, write_alert
from pipeline.alert.merge import find_case, merge
from pipeline.contracts.alert import AlertRule, Entry, Situation, SituationSettings
from pipeline.picture import Alert, AlertChange, RunwayState, Visibility
from pipeline.sites import NodeSite
from pipeline.situation.holds import HoldMemory, HoldSettings, watch_holds
from pipeline.situation.observe import observe
from pipeline.situation.pairs import Pair, watch_pairs
from pipeline.tables import NodeEvents, Tracks


@dataclass
class MonitorState:
    """Everything that the monitor remembers. clock: s that have passed, never backwards; look: counts the looks."""

    next_id: int
    runways: list[RunwayState]
    time: float | None = None
    clock: float = 0.0
    look: int = 0
    looked: float = -np.inf
    cases: list[Case] = field(default_factory=list)
    cleared: deque[Alert] = field(default_factory=lambda: deque(maxlen=256))
    landed: dict[int, float] = field(default_factory=dict)
    holds: HoldMemory = field(default_factory=HoldMemory)
    pairs: dict[tuple[int, int], Pair] = field(default_factory=dict)
    held_back: int = 0
    held_back_total: int = 0

    def before_traffic(self) -> MonitorState:
        """A state that knows how the runways are used and which number the next alert has, and nothing else."""
        return MonitorState(self.next_id, list(self.runways))


class AlertMonitor:
    """Runs the rules on each new set of tracks and leads every alert from raise to clear.

    Not thread-safe: all methods belong to the thread that updates. rules: parts of `pipeline.alert`. nodes: the nodes
    of the engine, in its order; those with `hold` set guard that holding position. first_id: number of the first alert.
    """

    def __init__(
        self,
        airport: Airport,
        rules: Sequence[AlertRule],
        first_id: int = 1,
        *,
        nodes: Sequence[NodeSite] = (),
        runways: Sequence[RunwayState] = (),
        life: LifeSettings | None = None,
        geometry: SituationSettings | None = None,
        entry: HoldSettings | None = None,
    ) -> None:
        """Raise ValueError when `runways` names a runway, or a direction of one, that the airport does not have."""
        self._airport, self._rules, self._first_id = airport, tuple(rules), first_id
        self._life = life or LifeSettings()
        self._geometry = geometry or SituationSettings()
        self._entry = entry or HoldSettings()
        self._frames, self._hold_frames = RunwayFrames.build(airport), HoldFrames.build(airport)
        index = {one: i for i, one in enumerate(self._hold_frames.ids)}
        self._node_holds = np.array([index.get(one.hold or "", -1) for one in nodes], dtype=np.int64)
        self._state = MonitorState(first_id, [RunwayState(one.id) for one in airport.runways])
        for given in runways:
            try:
                self.set_runway(given.id, given.open, given.in_use or "", given.visibility)
            except KeyError as error:
                raise ValueError(f"{airport.icao} has no runway {given.id}") from error

    @property
    def alerts(self) -> tuple[Alert, ...]:
        """The live alerts, alarms first, then the newest first."""
        live = [case.alert for case in self._state.cases if case.alert is not None]
        return tuple(sorted(live, key=lambda one: (one.stage != "alarm", -one.id)))

    @property
    def cleared(self) -> tuple[Alert, ...]:
        """The alerts cleared last, newest first (at most 256)."""
        return tuple(reversed(self._state.cleared))

    @property
    def runways(self) -> tuple[RunwayState, ...]:
        """Every runway with its use, its occupants and its next arrival, as of the last update."""
        return tuple(self._state.runways)

    @property
    def held_back(self) -> tuple[int, int]:
        """(now, since start): conflicts that found no room among the live alerts."""
        return self._state.held_back, self._state.held_back_total

    def set_runway(
        self, id: str, open: bool | None = None, in_use: str | None = None, visibility: Visibility | None = None
    ) -> RunwayState:
        """Set how a runway is used; None leaves as it is, "" for in_use is "not in use".

        Raises KeyError for an unknown runway, ValueError for a direction it has not, and for a closed runway in use.
        """
        row = {one.id: i for i, one in enumerate(self._state.runways)}[id]
        state = self._state.runways[row]
        if in_use and in_use not in self._frames.designators[row]:
            raise ValueError(f"runway {id} has the directions {' and '.join(self._frames.designators[row])}")
        if visibility not in (None, "normal", "low"):
            raise ValueError('visibility is "normal" or "low"')
        state = replace(
            state,
            open=state.open if open is None else open,
            in_use=state.in_use if in_use is None else (in_use or None),
            visibility=visibility or state.visibility,
        )
        if not state.open and state.in_use:
            if in_use:
                raise ValueError(f"runway {id} is closed; open it to put it in use")
            state = replace(state, in_use=None)
        self._state.runways[row] = state
        return state

    def acknowledge(self, id: int, by: str, time: float) -> AlertChange:
        """Acknowledge a live alert; a second time changes nothing and gives the alert with its first name.

        Raises KeyError for a number never given out, ValueError for an alert that is cleared.
        """
        for case in self._state.cases:
            alert = case.alert
            if alert is None or alert.id != id:
                continue
            if alert.state != "acknowledged":
                alert = replace(
                    alert, state="acknowledged", acknowledged_at=time, acknowledged_by=by, updated_at=time, aural=False
                )
                case.alert, case.acknowledged_stage = alert, alert.stage
            return AlertChange("acknowledge", time, alert)
        if self._first_id <= id < self._state.next_id:
            raise ValueError(f"alert {id} is cleared")
        raise KeyError(id)

    def save(self) -> MonitorState:
        """A copy of all state, to go on from later."""
        return copy.deepcopy(self._state)

    def restore(self, state: MonitorState) -> None:
        """Go on from a saved state. Raises ValueError when it belongs to other runways."""
        if [one.id for one in state.runways] != [one.id for one in self._airport.runways]:
            raise ValueError("the saved state belongs to another airport")
        self._state = copy.deepcopy(state)

    def update(
        self,
        tracks: Tracks,
        time: float,
        sensors_degraded: bool = False,
        node_events: NodeEvents | None = None,
    ) -> tuple[AlertChange, ...]:
        """Look at the tracks as they are at `time` and give every change of an alert, in order.

        sensors_degraded: alerts are held at information and say why. node_events: those since the last update. A clock
        that steps back costs nothing: durations go on from where they were.
        """
        state = self._state
        time = self._advance(time)
        tracks = tracks[np.isfinite(tracks.state).all(axis=1) & np.isfinite(tracks.covariance).all(axis=(1, 2))]
        situation = self._observe(tracks, time, sensors_degraded, node_events)
        self._note_use(situation)
        addresses = {int(n): str(a) for n, a in zip(tracks.id, tracks.address, strict=True)}
        met: list[Case] = []
        for conflict in merge(situation, [one for rule in self._rules for one in rule(situation)]):
            named = tuple(addresses.get(track, "") for track in conflict.tracks)
            case = find_case(state.cases, conflict, named, met)
            if case is None:
                case = Case(conflict, named, state.clock)
                state.cases.append(case)
            met.append(case)
            case.meet(conflict, named, state.clock, state.look)
        return tuple(self._lead(situation, {n: row for row, n in enumerate(addresses)}))

    def _advance(self, time: float) -> float:
        state = self._state
        if not np.isfinite(time):
            time = state.time or 0.0
        if state.time is not None:
            state.clock += max(0.0, time - state.time)
        state.time = time
        if state.clock - state.looked >= self._life.look_s:
            state.look, state.looked = state.look + 1, state.clock
        return time

    def _observe(self, tracks: Tracks, time: float, degraded: bool, events: NodeEvents | None) -> Situation:
        state, s = self._state, self._geometry
        situation = observe(
            self._airport,
            self._frames,
            self._hold_frames,
            tracks,
            time,
            self.runways,
            s,
            degraded,
            frozenset(state.landed),
        )
        settled = situation.vacating | situation.rolling | situation.arrival | self._lined_up(situation)
        watch_holds(
            self._hold_frames,
            state.holds,
            self._entry,
            state.clock,
            tracks.id,
            tracks.state[:, :2],
            situation.velocity,
            situation.depth,
            settled,
            self._holds_felt(events),
        )
        rows = {int(n): row for row, n in enumerate(tracks.id)}
        entries = {rows[n]: entry for n, entry in state.holds.entries.items() if n in rows}
        serious = {row: e for row, e in entries.items() if self._serious(situation, row, e)}
        return replace(situation, entries=serious, airframes=watch_pairs(state.pairs, situation, state.clock))

    def _serious(self, s: Situation, row: int, entry: Entry) -> bool:
        runway = int(self._hold_frames.runway[entry.hold])
        if s.depth[runway, row] > 0 or s.entering[runway, row]:
            return True
        if not entry.node:
            return False
        soon = s.position[row] + s.velocity[row] * self._entry.soon_s
        return bool(self._frames.depth(runway, s.runways[runway].visibility, soon[None, :])[0] > 0)

    @staticmethod
    def _lined_up(s: Situation) -> Any:
        heading = np.where(np.isfinite(s.tracks.heading), s.tracks.heading, np.nan)
        nose = np.stack([np.sin(heading), np.cos(heading)], axis=1)
        along, _ = s.frames.resolve(nose)
        return s.on_strip & s.aircraft[None, :] & (np.abs(np.nan_to_num(along)) > np.cos(np.radians(20)))

    def _holds_felt(self, events: NodeEvents | None) -> tuple[int, ...]:
        if events is None or not len(events) or not len(self._node_holds):
            return ()
        known = events.node[(events.node >= 0) & (events.node < len(self._node_holds))]
        return tuple(int(one) for one in self._node_holds[known] if one >= 0)

    def _note_use(self, s: Situation) -> None:
        state = self._state
        for n in s.tracks.id[s.arrival.any(axis=0)]:
            state.landed[int(n)] = state.clock
        state.landed = {n: since for n, since in state.landed.items() if state.clock - since < 180.0}
        for r, runway in enumerate(state.runways):
            times = np.where(s.arrival[r], s.time_to_threshold[r], np.inf)
            first = int(times.argmin()) if len(times) and np.isfinite(times.min()) else None
            state.runways[r] = replace(
                runway,
                occupants=tuple(int(n) for n in s.tracks.id[s.occupant[r]]),
                next_arrival=None if first is None else int(s.tracks.id[first]),
                next_arrival_s=None if first is None else float(times[first]),
            )

    def _lead(self, s: Situation, rows: dict[int, int]) -> list[AlertChange]:
        state, life = self._state, self._life
        changes: list[AlertChange] = []
        kept: list[Case] = []
        for case in state.cases:
            lost = any(track not in rows for track in case.conflict.tracks)
            quiet = state.clock - case.seen
            if case.alert is None:
                if quiet <= life.raise_looks * max(life.look_s, 1.0):
                    kept.append(case)
            elif quiet >= (life.lost_s if lost else life.clear_s) and quiet > 0:
                changes.append(self._clear(case, s.time, _why_cleared(lost, s.degraded)))
            else:
                kept.append(case)
                changes += self._renew(case, s, rows)
        state.cases = kept
        changes += self._raise(s, rows)
        return changes

    def _renew(self, case: Case, s: Situation, rows: dict[int, int]) -> list[AlertChange]:
        state, former = self._state, case.alert
        assert former is not None
        stage = case.stage(state.clock, s.degraded, rows, self._life)
        alert = write_alert(case, s, rows, stage, former)
        if alert.state == "new":
            alert = replace(alert, state="ongoing")
        if stage == "alarm" and former.stage != "alarm" and case.acknowledged_stage != "alarm":
            # what was acknowledged was less than this; who did so stays on record
            alert = replace(alert, state="ongoing")
        alert = replace(alert, aural=alert.state != "acknowledged")
        case.alert = alert
        changed = (
            (alert.stage, alert.rule) != (former.stage, former.rule)
            or alert.degraded != former.degraded
            or [t.track for t in alert.targets] != [t.track for t in former.targets]
        )
        if not changed and state.clock - case.sent < self._life.refresh_s:
            return []
        case.sent = state.clock
        return [AlertChange("update", s.time, alert)]

    def _raise(self, s: Situation, rows: dict[int, int]) -> list[AlertChange]:
        state, life = self._state, self._life
        ripe = [
            case
            for case in state.cases
            if case.alert is None and case.seen == state.clock and case.ripe(state.look, life)
        ]
        ripe.sort(key=lambda case: case.conflict.stage != "alarm")
        changes: list[AlertChange] = []
        held_back = 0
        for case in ripe:
            live = [one for one in state.cases if one.alert is not None]
            if len(live) >= life.most:
                yielding = next((one for one in live if one.alert and one.alert.stage == "information"), None)
                if case.conflict.stage != "alarm" or s.degraded or yielding is None:
                    held_back += 1
                    continue
                changes.append(self._clear(yielding, s.time, "displaced by an alarm"))
                state.cases.remove(yielding)
            stage = case.stage(state.clock, s.degraded, rows, life)
            blank = Alert(
                id=state.next_id,
                rule=case.conflict.rule,
                stage=stage,
                state="new",
                text="",
                raised_at=s.time,
                updated_at=s.time,
                targets=(),
                runway=case.conflict.runway,
            )
            case.alert, case.sent = write_alert(case, s, rows, stage, blank), state.clock
            state.next_id += 1
            changes.append(AlertChange("raise", s.time, case.alert))
        state.held_back_total += max(0, held_back - state.held_back)
        state.held_back = held_back
        return changes

    def _clear(self, case: Case, time: float, reason: str) -> AlertChange:
        assert case.alert is not None
        alert = replace(case.alert, state="cleared", cleared_at=time, updated_at=time, clear_reason=reason, aural=False)
        self._state.cleared.append(alert)
        return AlertChange("clear", time, alert)


def _why_cleared(lost: bool, degraded: bool) -> str:
    """A target that vanished while a radar is not well was lost with its sensor: no proof that the danger is over."""
    if not lost:
        return "conflict ended"
    return "sensor lost" if degraded else "target lost"

"""The engine is a function of what enters it: same inputs, same bits; and no input moves its time that should not."""

from __future__ import annotations

import copy
from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.engine import MOST_AHEAD_S, Outcome, SurfaceEngine
from pipeline.inputs import Acknowledge, ClockStep, Envelope, Input, SensorHealth, SetRunway, Tick
from pipeline.picture import Picture
from pipeline.tables import NodeEvents, SectorPlots, TrackPhase, Tracks
from tests.pipeline.track.scene import T0
from tests.support.engines import LATENCY_S, make_engine, minute, reports_of

HOUR = 3600.0


def bits(outcome: Outcome) -> Any:
    """All of an outcome in a form that is equal only when every bit is."""
    picture = outcome.picture
    shown: Any = None
    if picture is not None:
        columns = {name: getattr(picture.tracks, name).tobytes() for name in Tracks.columns()}
        shown = (picture.time, columns, picture.alerts, picture.runways)
    return shown, outcome.changes, outcome.answer, repr(outcome.refused)


def fed(engine: SurfaceEngine, envelopes: Iterable[Envelope]) -> list[Any]:
    return [bits(engine.step(one)) for one in envelopes]


def newest(engine: SurfaceEngine, envelopes: Iterable[Envelope]) -> Picture:
    pictures = [made.picture for one in envelopes if (made := engine.step(one)).picture is not None]
    return pictures[-1]


def with_commands() -> list[Envelope]:
    envelopes = list(minute())
    for place, body in (
        (90, SetRunway("06/24", open=False)),
        (150, SetRunway("06/24", open=True)),
        (151, SetRunway("nowhere")),
        (170, SensorHealth(("smr",))),
        (200, SensorHealth(())),
        (230, Acknowledge(1, "tower")),
        (260, ClockStep(-1.0)),
    ):
        envelopes.insert(place, Envelope(envelopes[place].arrival, body))
    return envelopes


def test_the_same_inputs_give_the_same_bits() -> None:
    first, second = fed(make_engine(), with_commands()), fed(make_engine(), with_commands())
    assert first == second
    assert any(shown is not None and shown[2] for shown, *_ in first), "no alert: nothing was tried"


@pytest.mark.parametrize("place", [1, 77, 200, 333])
def test_a_saved_state_goes_on_with_the_same_bits(place: int) -> None:
    envelopes, engine, other = with_commands(), make_engine(), make_engine()
    fed(engine, envelopes[:place])
    saved = copy.deepcopy(engine.save())
    fed(other, minute(seed=9, scans=3))  # another past, of which nothing may stay
    other.restore(saved)
    assert fed(engine, envelopes[place:]) == fed(other, envelopes[place:])


def test_saving_changes_nothing_and_shares_nothing() -> None:
    envelopes, engine = with_commands(), make_engine()
    fed(engine, envelopes[:200])
    saved = engine.save()
    before = copy.deepcopy(saved)
    went_on = fed(engine, envelopes[200:])
    engine.restore(saved)
    assert fed(engine, envelopes[200:]) == went_on
    other = make_engine()
    other.restore(before)
    assert fed(other, envelopes[200:]) == went_on


@pytest.mark.parametrize("late", [HOUR, 73 * 365.25 * 24 * HOUR, MOST_AHEAD_S + 0.1])
@pytest.mark.parametrize("kind", ["report", "node", "sector"])
@pytest.mark.parametrize("scans", [0, 12])
def test_what_is_dated_after_its_arrival_changes_nothing_but_a_counter(kind: str, late: float, scans: int) -> None:
    engine, twin = make_engine(), make_engine()
    fed(engine, minute(scans=scans))
    fed(twin, minute(scans=scans))
    arrival = T0 + scans + LATENCY_S
    engine.step(Envelope(arrival, Tick()))
    twin.step(Envelope(arrival, Tick()))
    bad: dict[str, Input] = {
        "report": reports_of(arrival + late),
        "node": NodeEvents.build(1, time=arrival + late, node=0),
        "sector": SectorPlots(0, 99, arrival + late, 99 * 4096, 100 * 4096, next(minute()).body.plots),  # type: ignore[union-attr]
    }
    engine.step(Envelope(arrival, bad[kind]))
    assert engine.counters.get(f"{kind}_ahead") == 1
    assert engine.time == twin.time
    later = [Envelope(arrival + 0.3, Tick()), Envelope(arrival + 1.5, reports_of(arrival + 1.4))]
    assert fed(engine, later) == fed(twin, later)


def test_tracks_coast_and_end_although_refused_data_keeps_coming() -> None:
    engine = make_engine()
    fed(engine, minute(scans=15))
    assert len(engine.look()[0].tracks) >= 3
    silent = []
    for k in range(1, 400):
        arrival = T0 + 15 + 0.25 * k
        silent += [Envelope(arrival, reports_of(arrival + HOUR)), Envelope(arrival, Tick())]
    five, end = newest(engine, silent[:40]), newest(engine, silent[40:])
    assert five.time == pytest.approx(T0 + 20, abs=1.0)
    assert (five.tracks.phase == TrackPhase.COASTING).all()
    assert end.time == pytest.approx(T0 + 114, abs=1.5)
    assert len(end.tracks) == 0


def test_an_alert_ends_as_sensor_lost_when_its_radar_is_lost_with_it() -> None:
    engine = make_engine()
    alerts = [a for one in minute(scans=20) if (p := engine.step(one).picture) is not None for a in p.alerts]
    assert alerts, "the scene has no alert"
    changes = []
    for k in range(1, 400):
        arrival = T0 + 20 + 0.25 * k
        if k == 12:
            changes += engine.step(Envelope(arrival, SensorHealth(("smr",)))).changes
        changes += engine.step(Envelope(arrival, Tick())).changes
    assert [c.alert.clear_reason for c in changes if c.operation == "clear"] != []
    assert {c.alert.clear_reason for c in changes if c.operation == "clear"} <= {"sensor lost", "conflict ended"}
    assert "sensor lost" in {c.alert.clear_reason for c in changes}
    assert engine.look()[0].alerts == ()


def test_before_anything_is_heard_the_picture_follows_the_host() -> None:
    engine = make_engine()
    times = [engine.step(Envelope(T0 + k, Tick())).picture.time for k in range(3)]  # type: ignore[union-attr]
    assert np.diff(times) == pytest.approx([1.0, 1.0])
    assert times[0] == pytest.approx(T0, abs=1.0)


@pytest.mark.parametrize("seconds", [-1.0, HOUR, -HOUR])
def test_a_step_of_the_host_clock_moves_everything_and_loses_nothing(seconds: float) -> None:
    """The host's clock and with it all sources are set: the same tracks go on under the same numbers."""
    engine, twin = make_engine(), make_engine()
    fed(engine, minute(scans=12))
    fed(twin, minute(scans=12))
    engine.step(Envelope(T0 + 12 + seconds, ClockStep(seconds)))
    after = [one for one in minute(scans=16) if one.arrival > T0 + 12 + LATENCY_S + 0.01]
    moved = newest(engine, (shifted(one, seconds) for one in after))
    still = newest(twin, after)
    assert moved.time == pytest.approx(still.time + seconds, abs=1e-5)
    assert moved.tracks.id.tolist() == still.tracks.id.tolist()
    assert moved.tracks.hits.tolist() == still.tracks.hits.tolist()
    assert np.abs(moved.tracks.state - still.tracks.state).max() < 1e-3


def shifted(envelope: Envelope, seconds: float) -> Envelope:
    body: Any = envelope.body
    if isinstance(body, SectorPlots):
        plots = body.plots.replace(time=body.plots.time + seconds)
        body = replace(body, time=body.time + seconds, plots=plots, mark_time=body.mark_time + seconds)
    elif not isinstance(body, Tick):
        body = body.replace(time=body.time + seconds)
    return Envelope(envelope.arrival + seconds, body)


def test_a_wrong_command_is_answered_and_changes_nothing() -> None:
    engine = make_engine()
    fed(engine, minute(scans=3))
    assert isinstance(engine.step(Envelope(T0 + 3, Acknowledge(7, "tower"))).refused, KeyError)
    assert isinstance(engine.step(Envelope(T0 + 3, SetRunway("06/24", in_use="99"))).refused, ValueError)
    outcome = engine.step(Envelope(T0 + 3, SetRunway("06/24", visibility="low")))
    assert outcome.answer.visibility == "low"
    assert outcome.picture is not None
    assert outcome.picture.runways[0].visibility == "low"


@settings(max_examples=40, deadline=None)
@given(st.lists(st.floats(allow_nan=True, allow_infinity=True), min_size=1, max_size=6), st.floats(0, 3))
def test_no_time_whatever_breaks_it_or_runs_away(times: list[float], wait: float) -> None:
    engine = make_engine()
    fed(engine, minute(scans=2, sectors=2))
    arrival = T0 + 2 + wait
    for one in times:
        engine.step(Envelope(arrival, reports_of(T0).replace(time=one)))
        engine.step(Envelope(arrival, NodeEvents.build(1, time=one, node=0)))
    assert T0 + 1 <= engine.time <= arrival + MOST_AHEAD_S

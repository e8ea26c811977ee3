"""What `app.contract.Service` promises, of the real service and of the fake one that the display tests use."""

from __future__ import annotations

import time
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.contract import Refused, RefusedTime, Service, Submitted, UnknownId, WrongParts
from app.ingest.octets import encode_sweeps
from app.service import SurfaceService
from pipeline.picture import AlertChange, Picture
from pipeline.tables import NodeEvents, TargetReports
from tests.support.fake_service import FakeService
from tests.support.running import until
from tests.support.service_rigs import HEARD, QUEUE, RUNWAY, UNHEARD, FakeRig, RealRig, Rig, settings_here
from tests.support.small_airport import as_geojson, small_airport
from tests.support.sweeps import sweeps_of


def report(**given: Any) -> TargetReports:
    """A report from so far outside that it makes no track."""
    return TargetReports.build(1, **{"time": time.time(), "address": "39ffff", "east": 1e6, "north": 0.0, **given})


class ServiceContract:
    """Every test may assume that the service stands and that runways are open; it leaves it so."""

    # readiness, picture, listening

    def test_it_is_ready_when_every_check_is_passed(self, rig: Rig) -> None:
        rig.next_picture()
        checks = rig.service.readiness().checks
        assert checks.keys() >= {"database", "warm", "picture"}
        assert all(checks.values())
        assert rig.service.readiness().ready

    def test_the_newest_picture_is_whole(self, rig: Rig) -> None:
        made = rig.next_picture()
        newest = rig.service.picture()
        assert newest is not None
        assert newest.time >= made.time
        assert abs(newest.time - time.time()) < 30
        assert {one.id for one in newest.runways} == {one.id for one in rig.service.airport.runways}
        assert [one.id for one in newest.sensors] == [one.id for one in rig.service.sensors()]

    def test_a_listener_hears_of_every_picture_until_it_ends(self, rig: Rig) -> None:
        heard: list[Picture] = []
        other: list[Picture] = []
        end = rig.service.listen(lambda picture, changes: heard.append(picture))
        end_other = rig.service.listen(lambda picture, changes: other.append(picture))
        first, second = rig.next_picture(), rig.next_picture()
        until(lambda: any(one is second for one in heard), "the second picture is heard")
        assert any(one is first for one in heard)
        assert all(a.time <= b.time for a, b in pairwise(heard))
        end()
        end()
        many = len(heard)
        third = rig.next_picture()
        until(lambda: any(one is third for one in other), "the third picture is heard by the other")
        end_other()
        assert len(heard) == many

    # sensors

    def test_every_radar_and_the_nodes_are_among_the_sensors(self, rig: Rig) -> None:
        sensors = rig.service.sensors()
        assert len({one.id for one in sensors}) == len(sensors)
        assert [one.id for one in sensors if one.kind == "radar"] == [one.id for one in rig.service.radars]
        assert "node" in {one.kind for one in sensors}
        for one in sensors:
            assert one.status in {"ok", "degraded", "silent", "waiting"}
            assert (one.last is None) == (one.status == "waiting"), one
            assert all(isinstance(count, int) and count >= 0 for count in one.counters.values())

    def test_a_radar_tells_its_parts_by_name(self, rig: Rig) -> None:
        for site in rig.service.radars:
            running = rig.service.front_end(site.id).running
            assert rig.sensor(site.id).parts == {verb: part["name"] for verb, part in running.items()}

    def test_counters_grow_with_what_is_taken(self, rig: Rig) -> None:
        rig.service.submit_node_events(NodeEvents.build(1, time=time.time(), node=0))
        rig.service.submit_target_reports(report())
        before = [one.counters["taken"] for one in rig.service.sensors() if one.kind in ("node", "report")]
        rig.service.submit_node_events(NodeEvents.build(2, time=time.time(), node=0))
        rig.service.submit_target_reports(report())
        after = [one.counters["taken"] for one in rig.service.sensors() if one.kind in ("node", "report")]
        assert [b - a for a, b in zip(before, after, strict=True)] == [2, 1]

    # video

    def test_the_video_of_a_radar_is_its_newest_turn(self, rig: Rig) -> None:
        video = rig.service.video(HEARD)
        assert video.site == rig.service.radars[0]
        assert video.amplitude.shape == (video.site.video.azimuths, video.site.video.ranges)
        assert video.amplitude.dtype == np.uint8
        assert video.amplitude.max() > 0
        assert abs(video.time - time.time()) < 60

    def test_there_is_no_video_of_a_radar_not_heard_yet(self, rig: Rig) -> None:
        with pytest.raises(Refused, match="not been heard"):
            rig.service.video(UNHEARD)

    # parts

    def test_an_unknown_radar_is_named_so(self, rig: Rig) -> None:
        with pytest.raises(UnknownId):
            rig.service.video("nobody")
        with pytest.raises(UnknownId):
            rig.service.front_end("nobody")
        with pytest.raises(UnknownId):
            rig.service.choose_parts("nobody", {})
        with pytest.raises(UnknownId):
            rig.service.submit_sweeps("nobody", b"")

    def test_what_works_on_a_radar_is_told_with_its_settings(self, rig: Rig) -> None:
        told = rig.service.front_end(UNHEARD)
        assert told.radar == UNHEARD
        assert told.running.keys() == {"detect", "extract", "bearing"}
        assert "pfa" in told.running["detect"]
        assert (told.next, told.scans_left) == (None, None)
        assert told.cut == {}

    @pytest.mark.parametrize(
        ("wanted", "says"),
        [
            ({"detekt": {"name": "hybrid"}}, "detect"),
            ({"detect": {"name": "hybird"}}, "hybrid"),
            ({"detect": {"name": "hybrid", "pfaa": 1e-5}}, "pfa"),
            ({"detect": {"name": "hybrid", "pfa": 2.0}}, "pfa"),
        ],
    )
    def test_parts_that_do_not_exist_change_nothing(self, rig: Rig, wanted: dict[str, Any], says: str) -> None:
        before = rig.service.front_end(UNHEARD)
        with pytest.raises(WrongParts, match=says):
            rig.service.choose_parts(UNHEARD, wanted)
        assert rig.service.front_end(UNHEARD) == before

    def test_a_part_that_is_chosen_runs_and_the_others_stay(self, rig: Rig) -> None:
        before = rig.service.front_end(UNHEARD).running
        told = rig.service.choose_parts(UNHEARD, {"extract": {"name": "manhattan", "min_cells": 2}})
        assert told.running["extract"]["name"] == "manhattan"
        assert told.running["extract"]["min_cells"] == 2
        assert {**told.running, "extract": None} == {**before, "extract": None}
        assert rig.sensor(UNHEARD).parts["extract"] == "manhattan"
        assert rig.service.choose_parts(UNHEARD, before).running == before

    # alerts

    def test_a_live_alert_is_acknowledged_once(self, rig: Rig) -> None:
        alert = rig.raise_alert()
        changes: list[AlertChange] = []
        end = rig.service.listen(lambda _, changed: changes.extend(changed))
        made = rig.service.acknowledge(alert, "tower")
        assert (made.id, made.state, made.acknowledged_by, made.aural) == (alert, "acknowledged", "tower", False)
        assert made.acknowledged_at is not None
        rig.next_picture()
        until(lambda: [one.operation for one in changes] == ["acknowledge"], "the change goes out")
        end()
        assert changes[0].alert.acknowledged_by == "tower"
        again = rig.service.acknowledge(alert, "ground")
        assert (again.acknowledged_by, again.acknowledged_at) == ("tower", made.acknowledged_at)
        assert [one.acknowledged_by for one in rig.next_picture().alerts if one.id == alert] == ["tower"]
        rig.clear_alert()
        with pytest.raises(Refused, match="cleared"):
            rig.service.acknowledge(alert, "tower")

    def test_an_alert_that_never_was_is_unknown(self, rig: Rig) -> None:
        for id in (0, 999_999):
            with pytest.raises(UnknownId):
                rig.service.acknowledge(id, "tower")

    # runways

    def test_a_runway_is_turned_and_closed(self, rig: Rig) -> None:
        change = rig.service.set_runway
        made = change(RUNWAY, open=None, in_use="24", visibility="low")
        assert (made.id, made.open, made.in_use, made.visibility) == (RUNWAY, True, "24", "low")
        made = change(RUNWAY, open=None, in_use=None, visibility=None)
        assert (made.open, made.in_use, made.visibility) == (True, "24", "low")
        shown = {one.id: one for one in rig.next_picture().runways}[RUNWAY]
        assert (shown.open, shown.in_use, shown.visibility) == (True, "24", "low")
        made = change(RUNWAY, open=None, in_use="", visibility="normal")
        assert (made.open, made.in_use, made.visibility) == (True, None, "normal")

    def test_a_closed_runway_is_not_in_use(self, rig: Rig) -> None:
        change = rig.service.set_runway
        change(RUNWAY, open=True, in_use="06", visibility=None)
        made = change(RUNWAY, open=False, in_use=None, visibility=None)
        assert (made.open, made.in_use) == (False, None)
        with pytest.raises(Refused, match="closed"):
            change(RUNWAY, open=None, in_use="06", visibility=None)
        made = change(RUNWAY, open=True, in_use="06", visibility=None)
        assert (made.open, made.in_use) == (True, "06")
        with pytest.raises(Refused, match="closed"):
            change(RUNWAY, open=False, in_use="06", visibility=None)
        made = change(RUNWAY, open=None, in_use="", visibility=None)
        assert (made.open, made.in_use) == (True, None)

    def test_a_wrong_runway_direction_or_visibility_changes_nothing(self, rig: Rig) -> None:
        change = rig.service.set_runway
        with pytest.raises(UnknownId):
            change("13/31", open=False, in_use=None, visibility=None)
        with pytest.raises(Refused, match="06 and 24"):
            change(RUNWAY, open=False, in_use="13", visibility="low")
        with pytest.raises(Refused, match="visibility"):
            change(RUNWAY, open=False, in_use=None, visibility="fog")  # type: ignore[arg-type]
        made = change(RUNWAY, open=None, in_use=None, visibility=None)
        assert (made.open, made.visibility) == (True, "normal")

    # what is submitted

    def test_sweeps_are_taken_and_counted(self, rig: Rig) -> None:
        site = rig.service.radars[0]
        assert rig.service.submit_sweeps(HEARD, encode_sweeps(sweeps_of(site, rows=8), site)) == {"taken": 8}

    def test_octets_that_are_no_sweeps_of_the_radar_are_refused(self, rig: Rig) -> None:
        site = rig.service.radars[0]
        body = encode_sweeps(sweeps_of(site, rows=8), site)
        for wrong, says in ((b"", "header"), (b"JUNK" + body[4:], "ASWP"), (body[:-1], "octets")):
            with pytest.raises(Refused, match=says):
                rig.service.submit_sweeps(HEARD, wrong)

    def test_nothing_submitted_is_nothing_done(self, rig: Rig) -> None:
        assert rig.service.submit_node_events(NodeEvents.empty()) == Submitted(0)
        assert rig.service.submit_target_reports(TargetReports.empty()) == Submitted(0)

    def test_what_is_dated_wrongly_is_refused_by_name_and_the_rest_is_taken(self, rig: Rig) -> None:
        now = time.time()
        with pytest.raises(RefusedTime, match="ahead") as told:
            rig.service.submit_target_reports(report(time=now + 3600.0))
        assert [(one.row, one.reason) for one in told.value.rows] == [(0, "ahead")]
        both = TargetReports.build(2, time=np.array([now + 3600.0, now]), address="39ffff", east=1e6, north=0.0)
        submitted = rig.service.submit_target_reports(both)
        assert submitted.taken == 1
        assert [(one.row, one.reason) for one in submitted.refused] == [(0, "ahead")]
        with pytest.raises(RefusedTime):
            rig.service.submit_node_events(NodeEvents.build(1, time=now + 3600.0, node=0))
        assert {one.status for one in rig.service.sensors() if one.kind in ("node", "report")} == {"degraded"}

    def test_rows_that_could_not_be_read_are_counted_with_their_feed(self, rig: Rig) -> None:
        def counted(id: str) -> int:
            return sum(one.counters.get("refused_bad_value", 0) for one in rig.service.sensors() if one.id == id)

        before = counted("reports"), counted("nodes")
        rig.service.note_bad_rows("reports", {"bad_value": 2})
        rig.service.note_bad_rows("nodes", {"bad_value": 1})
        assert (counted("reports"), counted("nodes")) == (before[0] + 2, before[1] + 1)

    def test_events_of_unknown_nodes_do_not_stop_the_pictures(self, rig: Rig) -> None:
        rig.service.submit_node_events(NodeEvents.build(2, time=time.time(), node=np.array([-1, 99])))
        rig.next_picture()

    def test_what_finds_no_room_is_refused_until_there_is_some(self, rig: Rig) -> None:
        with rig.stalled():
            taken = [self._taken(rig) for _ in range(QUEUE + 1)]
            assert taken[0]
            assert not taken[-1]
            with pytest.raises(Refused, match="full"):
                rig.service.submit_target_reports(report())
            with pytest.raises(Refused, match="full"):
                rig.service.submit_node_events(NodeEvents.build(1, time=time.time(), node=0))
        rig.next_picture()
        until(lambda: self._taken(rig), "there is room again")

    @staticmethod
    def _taken(rig: Rig) -> bool:
        try:
            rig.service.submit_target_reports(report())
        except Refused:
            return False
        return True


class TestRealService(ServiceContract):
    @pytest.fixture(scope="class")
    @classmethod
    def rig(cls, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Rig]:
        made = RealRig(tmp_path_factory.mktemp("service"))
        yield made
        made.real.stop()


class TestFakeService(ServiceContract):
    @pytest.fixture(scope="class")
    @classmethod
    def rig(cls, tmp_path_factory: pytest.TempPathFactory) -> Rig:
        return FakeRig(tmp_path_factory.mktemp("service"))


@pytest.fixture(params=["real", "fake"])
def starting(request: pytest.FixtureRequest, tmp_path: Path) -> Service:
    """A service that has not been prepared yet."""
    settings, airport = settings_here(tmp_path), small_airport()
    if request.param == "real":
        return SurfaceService(settings, airport, as_geojson(airport))
    made = FakeService(settings)
    made.ready = False
    return made


def test_a_service_that_starts_has_no_picture_and_takes_nothing(starting: Service) -> None:
    assert not starting.readiness().ready
    assert starting.picture() is None
    site = starting.radars[0]
    body = encode_sweeps(sweeps_of(site, rows=8), site)
    for work in (
        lambda: starting.video(HEARD),
        lambda: starting.front_end(HEARD),
        lambda: starting.choose_parts(HEARD, {}),
        lambda: starting.acknowledge(1, "tower"),
        lambda: starting.set_runway(RUNWAY, open=False, in_use=None, visibility=None),
        lambda: starting.submit_sweeps(HEARD, body),
        lambda: starting.submit_node_events(NodeEvents.build(1, time=time.time(), node=0)),
        lambda: starting.submit_target_reports(report()),
    ):
        with pytest.raises(Refused):
            work()
    with pytest.raises(UnknownId):
        starting.video("nobody")
    with pytest.raises(UnknownId):
        starting.front_end("nobody")

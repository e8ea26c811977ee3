"""A journal of several radars, reports, nodes and commands, over a restart, gives the same bits again."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from app.assembly import radar_site
from app.journal.reader import open_journal
from app.replay.verify import verify
from app.settings import RadarSettings
from pipeline.inputs import Envelope, SetRunway
from pipeline.sites import RadarSite
from pipeline.tables import NodeEvents, TargetReports
from tests.app.replay.recording import RADAR, Recording, airport
from tests.pipeline.track.scene import T0
from tests.pipeline.track.sensors import Antenna, blocks_of
from tests.support.engines import LATENCY_S, TRAFFIC, reports_of
from tests.support.small_airport import FRAME

SECONDS, RESTART = 40, 24


def also(name: str, north: float, **words: Any) -> RadarSettings:
    given = {"range_step_m": 4.0, "udp": None, **words}
    return RadarSettings(id=name, latitude=FRAME.latitude + north, longitude=FRAME.longitude, **given)


RADARS = (RADAR, also("slow", 0.004, period_s=2.5), also("fast", -0.003, period_s=0.5, azimuths=2048))


def antennas() -> tuple[Antenna, ...]:
    sites: list[RadarSite] = [radar_site(one, airport()) for one in RADARS]
    return tuple(Antenna(site, phase=0.13 * place, false=10.0) for place, site in enumerate(sites))


def second(number: int) -> list[Envelope]:
    """What arrives in one second: blocks of all radars in the order of their times, then all others."""
    now = T0 + number + 1.0
    blocks = blocks_of(antennas(), TRAFFIC, number, number + 1.0)
    made = [Envelope(one.time + LATENCY_S, one) for one in blocks]
    east, north = TRAFFIC[2].path(0.0)
    nameless = TargetReports.build(1, time=now - 0.1, east=east, north=north + 5.0, accuracy=10.0, source="mlat")
    made += [Envelope(now + LATENCY_S, one) for one in (reports_of(now - 0.02, source="ads-b"), nameless)]
    if number % 7 == 3:
        made.append(Envelope(now + LATENCY_S, NodeEvents.build(1, time=now - 0.05, node=0, speed=4.0)))
    if number % 10 == 9:
        low = "low" if number % 20 == 9 else "normal"
        made.append(Envelope(now + LATENCY_S, SetRunway("06/24", visibility=low)))
    return made


def test_a_day_of_several_radars_is_identical_over_a_restart(tmp_path: Path) -> None:
    before = Recording(tmp_path, radars=RADARS)
    before.feed(one for number in range(RESTART) for one in second(number))
    before.close()
    after = Recording(tmp_path, begin=T0 + RESTART, radars=RADARS)
    after.engine.restore(before.engine.save())
    after.feed(one for number in range(RESTART, SECONDS) for one in second(number))
    after.close()
    found = verify(open_journal(tmp_path))
    assert found.difference is None
    assert (found.runs, found.gaps, found.failures) == (2, 0, 0)
    assert before.raised == after.raised == 0
    assert found.inputs == sum(len(second(number)) for number in range(SECONDS))
    assert found.snapshots >= 4
    for since in (12.0, 22.0, 35.0):  # begins at a snapshot: all that the tracker remembers must be in it
        part = verify(open_journal(tmp_path), since=T0 + since)
        assert part.difference is None
        assert 0 < part.inputs < found.inputs
    counters = after.engine.tracker.counters
    assert {"confirmed", "node_pulled", "report_started"} <= counters.keys()
    tracks = after.engine.tracker.tracks()
    assert len(tracks) >= 3
    assert (tracks.address == "3944ef").any()

"""Run as a program: warms a tracker up in a process of its own, has it work, and tells which kernels were then new.

Prints a line for each kernel that was compiled or loaded while working, and one with what the tracker counted.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from numba.core.dispatcher import Dispatcher

import app  # noqa: F401  says where compiled kernels are kept
from pipeline.lifecycle.m_of_n import MOfN
from pipeline.sites import NodeSite
from pipeline.tables import NodeEvents, SectorPlots, TargetReports
from pipeline.tables.codec import decode, encode
from pipeline.track.tracker import Tracker
from tests.pipeline.track.scene import T0, Target, line, make_tracker
from tests.pipeline.track.sensors import Antenna, antenna, blocks_of, even_cut, report

SECONDS = 45
NODE = NodeSite("n1", 0.0, 500.0, 0.0, "", "", 2.0, False)
CROSSING = Target(line(-400, 300, 20, 0), 40, 30)
NORTHBOUND = Target(line(300, 300, 0, 5), 10, 4)
PARKED = Target(line(500, -400, 0, 0), 40, 35, fragments=lambda scan: 1 + scan % 3)
LOST = Target(line(100, -300, 10, 0), hidden=((5.0, 60.0),))
BUILDING = Target(line(1000, 1000, 0, 0))
UNSEEN = Target(line(800, 800, 3, 3))


def loaded() -> set[tuple[str, str]]:
    """Name and signature of every kernel that this process has compiled or loaded."""
    modules = [module for name, module in sys.modules.items() if name.startswith("pipeline")]
    kernels = {one for module in modules for one in vars(module).values() if isinstance(one, Dispatcher)}
    return {
        (f"{one.py_func.__module__}.{one.py_func.__name__}", str(each)) for one in kernels for each in one.signatures
    }


def reports(rng: np.random.Generator, t: float) -> list[TargetReports]:
    """With an address and without one, of targets that radars see, lose, and never see."""
    words: dict[str, Any] = {"rng": rng, "sd": 3.0}
    return [
        report(CROSSING, t - 0.1, "aaaaaa", latency=0.6, source=1, speed=20.0, course=np.pi / 2, altitude=0.0, **words),
        report(NORTHBOUND, t - 0.2, "", **words),
        report(LOST, t - 0.2, "eeeeee", speed=10.0, **words),
        report(UNSEEN, t - 0.2, "f0f0f0", **words),
    ]


def work(tracker: Tracker, antennas: tuple[Antenna, ...], nodes: bool, decoded: bool) -> None:
    """Radar plots, reports, node events, silence and a restored state. decoded: tables lie in the octets they were
    received as, and are read-only."""
    rng = np.random.default_rng(3)
    targets = (CROSSING, NORTHBOUND, PARKED, LOST, BUILDING)
    for second in range(SECONDS):
        whole = second % 5 == 3
        for sector in blocks_of(antennas, targets, second, second + 1.0, cut=even_cut(1 if whole else 32)):
            tracker.sector(as_received(sector) if decoded else sector)
        for one in reports(rng, second + 1.0):
            tracker.target_reports(decode(encode(one), TargetReports) if decoded else one)
        for speed in (5.0, np.nan) if nodes else ():
            tracker.node_events(NodeEvents.build(1, time=T0 + second + 1.0, node=0, speed=speed))
        tracker.tracks()
        tracker.tracks(T0 + second + 1.0)
        if second % 20 == 10:
            tracker.restore(tracker.save())
            tracker.shift(0.0)
    tracker.advance(T0 + 4 * SECONDS)
    tracker.tracks()


def as_received(sector: SectorPlots) -> SectorPlots:
    """The same, its tables read-only."""
    mark, mark_time = (np.frombuffer(one.tobytes(), one.dtype) for one in (sector.mark, sector.mark_time))
    return replace(sector, plots=decode(encode(sector.plots)), mark=mark, mark_time=mark_time)


ONE = (antenna(false=30.0),)
SEVERAL = (*ONE, antenna("b", 500.0, 200.0, period=2.5, false=5.0), antenna("c", -300.0, -300.0, period=0.5))
CASES: dict[str, tuple[tuple[Antenna, ...], bool, dict[str, Any]]] = {
    "one_radar": (ONE, False, {}),
    "several_radars": (SEVERAL, True, {}),
    "m_of_n": (SEVERAL, True, {"lifecycle": MOfN()}),
    "no_radar": ((), True, {}),
}


def found(case: str, decoded: bool) -> Iterator[str]:
    """What is printed of one case."""
    antennas, nodes, words = CASES[case]
    tracker = make_tracker((NODE,) if nodes else (), [one.site for one in antennas], **words)
    tracker.warm()
    before = loaded()
    work(tracker, antennas, nodes, decoded)
    yield from sorted({name for name, _ in loaded() - before})
    yield json.dumps(tracker.counters)


if __name__ == "__main__":
    print("\n".join(found(sys.argv[1], sys.argv[2] == "decoded")))

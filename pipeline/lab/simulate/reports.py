"""Target reports: the recorded positions of aircraft, and the transponders of simulated vehicles."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from pipeline.lab.simulate.paths import Truth
from pipeline.tables import TargetClass, TargetReports

VEHICLE_ERROR = 2.5
"""Standard deviation, in metres, of the positions that simulated vehicles report."""

RECORD_SOURCE, BEACON_SOURCE = "traffic-record", "beacons"
"""Sources of the reports: recorded aircraft are reported where the record of the traffic has them, simulated targets by
transmitters of their own."""


class ReportSimulator:
    """One report a second of every target whose transponder is heard, each at its own phase of the second.

    Recorded aircraft are reported where the record has them and are not marked as simulated. missed: share of reports
    that are lost. nameless: every so-manieth recorded aircraft reports its address only.
    """

    SLOTS = 4

    def __init__(self, seed: int, *, missed: float = 0.03, nameless: int = 9) -> None:
        self.seed, self.missed, self.nameless = seed, missed, nameless

    def reports(self, since: float, until: float, truth_at: Callable[[float], Truth]) -> TargetReports:
        """The reports of [since, until), in ascending time; split as you like, they are the same."""
        first = math.ceil(since * self.SLOTS - 1e-9)
        made = []
        slot = first
        while slot / self.SLOTS < until:
            made.append(self._slot(slot, truth_at(slot / self.SLOTS)))
            slot += 1
        return TargetReports.concatenate(made)

    def _slot(self, slot: int, truth: Truth) -> TargetReports:
        rng = np.random.default_rng([self.seed, 41, slot % 2**40])
        # one draw for every target there is, so that what is heard of one does not depend on another's phase
        lost = rng.random(len(truth)) < self.missed
        error = rng.standard_normal((len(truth), 2))
        due = truth.reporting & (truth.id % self.SLOTS == slot % self.SLOTS) & ~lost
        seen, error = truth[due], error[due] * np.where(truth.simulated[due], VEHICLE_ERROR, 0.0)[:, None]
        nameless = ~seen.simulated & (seen.id % self.nameless == 0)
        return TargetReports.build(
            len(seen),
            time=slot / self.SLOTS,
            address=seen.address,
            callsign=np.where(nameless, "", seen.callsign),
            east=seen.east + error[:, 0],
            north=seen.north + error[:, 1],
            accuracy=np.where(seen.simulated, 3.0, 7.5),
            altitude=seen.altitude,
            speed=seen.speed,
            course=seen.heading,
            on_ground=seen.on_ground,
            category=np.where(seen.category == TargetClass.AIRCRAFT, 1, 2),
            simulated=seen.simulated,
            source=np.where(seen.simulated, BEACON_SOURCE, RECORD_SOURCE),
        )

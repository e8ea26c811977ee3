"""Geomagnetic nodes: where they lie in the pavement, and what they feel of the truth."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from shapely import STRtree
from shapely.geometry import Point
from shapely.ops import unary_union

from pipeline.airport.model import Airport
from pipeline.lab.simulate.paths import Truth
from pipeline.sites import NodeSite
from pipeline.tables import NodeEventKind, NodeEvents, TargetClass

Floats = NDArray[np.float64]


def node_sites(airport: Airport, spacing: float = 220.0, most: int = 120) -> tuple[NodeSite, ...]:
    """A node at every holding position and one about every `spacing` metres along the taxiways, at most `most`."""
    made: list[NodeSite] = []
    for number, hold in enumerate(airport.holding_positions[:most]):
        made.append(
            NodeSite(
                f"H{number + 1:03d}", hold.position.x, hold.position.y, hold.heading, hold.id, hold.runway, 2.0, True
            )
        )
    runways = unary_union([one.strip.buffer(15.0) for one in airport.runways])
    taken = [Point(one.east, one.north) for one in made]
    number = 0
    for *_, line in sorted(airport.graph.edges, key=lambda edge: -edge[2]):
        for at in np.arange(line.length / 2 % spacing, line.length, spacing):
            place = line.interpolate(float(at))
            if len(made) >= most or runways.intersects(place):
                continue
            if taken and STRtree(taken).query(place, predicate="dwithin", distance=0.8 * spacing).size:
                continue
            a, b = line.interpolate(max(float(at) - 2.0, 0.0)), line.interpolate(min(float(at) + 2.0, line.length))
            heading = math.atan2(b.x - a.x, b.y - a.y) % (2 * math.pi)
            number += 1
            taken.append(place)
            made.append(NodeSite(f"T{number:03d}", place.x, place.y, heading, accuracy=2.0, simulated=True))
    return tuple(made)


@dataclass(frozen=True, slots=True)
class NodeBehaviour:
    """How well the nodes work. timing: s, standard deviation. speed, length: relative. missed: share of events lost."""

    timing: float = 0.03
    speed: float = 0.05
    length: float = 0.08
    missed: float = 0.01
    false_per_hour: float = 0.05


class NodeSimulator:
    """Makes the events of all nodes from a truth; the same seed and times give the same events.

    A target is over a node from the moment its nose reaches it (ARRIVED) until its tail has passed (LEFT); when its
    middle is over the node the field is strongest (PASSAGE). ARRIVED does not know the length yet.
    """

    STEP = 0.25

    def __init__(self, sites: tuple[NodeSite, ...], seed: int, behaviour: NodeBehaviour | None = None) -> None:
        self.sites, self.seed = sites, seed
        self.behaviour = behaviour or NodeBehaviour()
        self._east = np.array([one.east for one in sites])
        self._north = np.array([one.north for one in sites])

    def events(self, since: float, until: float, truth_at: Callable[[float], Truth]) -> NodeEvents:
        """The events whose true time lies in [since, until), in ascending time. Looks at the truth every 0.25 s."""
        found: list[dict[str, Any]] = []
        if len(self.sites):
            first, last = math.floor(since / self.STEP), math.ceil(until / self.STEP)
            before = truth_at(first * self.STEP) if last > first else Truth.empty()
            for step in range(first, last):
                after = truth_at((step + 1) * self.STEP)
                self._between(step * self.STEP, before, after, since, until, found)
                before = after
            self._false(since, until, found)
        found.sort(key=lambda one: float(one["time"]))
        names = ("time", "node", "kind", "speed", "length", "strength")
        columns = {name: [one[name] for one in found] for name in names}
        return NodeEvents.build(len(found), **columns, simulated=True)

    def _between(
        self, time: float, before: Truth, after: Truth, since: float, until: float, found: list[dict[str, Any]]
    ) -> None:
        _, a, b = np.intersect1d(before.id, after.id, assume_unique=True, return_indices=True)
        low = (before.altitude[a] < 3.0) & (after.altitude[b] < 3.0) & (before.speed[a] + after.speed[b] > 0.02)
        a, b = a[low], b[low]
        if not len(a):
            return
        old_along, old_across = self._relative(before, a)
        new_along, new_across = self._relative(after, b)
        half = before.length[a, None] / 2
        reach = np.where(before.category[a, None] == TargetClass.AIRCRAFT, 6.0, 2.5)
        for side, kind in ((1, NodeEventKind.ARRIVED), (0, NodeEventKind.PASSAGE), (-1, NodeEventKind.LEFT)):
            line = side * half
            crossed = (old_along > line) & (new_along <= line) & (np.abs(old_along - new_along) < 40.0)
            target, node = np.nonzero(crossed)
            if not len(target):
                continue
            part = (old_along - line)[target, node] / (old_along - new_along)[target, node]
            across = old_across[target, node] * (1 - part) + new_across[target, node] * part
            for t, n, p, y in zip(target, node, part, across, strict=True):
                true_time = time + float(p) * self.STEP
                if abs(y) <= reach[t, 0] and since <= true_time < until:
                    self._feel(true_time, int(n), kind, before[int(a[t])], found)

    def _relative(self, truth: Truth, rows: NDArray[np.int64]) -> tuple[Floats, Floats]:
        """Nodes in the targets' frames: (along, across), each (targets, nodes)."""
        x = self._east - truth.east[rows, None]
        y = self._north - truth.north[rows, None]
        sine, cosine = np.sin(truth.heading[rows, None]), np.cos(truth.heading[rows, None])
        return x * sine + y * cosine, x * cosine - y * sine

    def _feel(self, time: float, node: int, kind: NodeEventKind, target: Truth, found: list[dict[str, Any]]) -> None:
        rng = np.random.default_rng([self.seed, 31, int(target.id[0]), node, int(kind), int(time) % 2**31])
        how = self.behaviour
        if rng.random() < how.missed:
            return
        length = float(target.length[0])
        measured = length * (1 + how.length * rng.standard_normal())
        found.append(
            {
                "time": time + how.timing * rng.standard_normal(),
                "node": node,
                "kind": kind,
                "speed": max(float(target.speed[0]) * (1 + how.speed * rng.standard_normal()), 0.0),
                "length": math.nan if kind == NodeEventKind.ARRIVED else measured,
                "strength": 1.0 + length / 8.0 * float(np.exp(0.2 * rng.standard_normal())),
            }
        )

    def _false(self, since: float, until: float, found: list[dict[str, Any]]) -> None:
        for minute in range(math.floor(since / 60.0), math.floor(until / 60.0) + 1):
            rng = np.random.default_rng([self.seed, 37, minute % 2**31])
            for _ in range(int(rng.poisson(self.behaviour.false_per_hour * len(self.sites) / 60.0))):
                time = minute * 60.0 + 60.0 * float(rng.random())
                node, strength = int(rng.integers(len(self.sites))), 1.0 + float(rng.random())
                if since <= time < until:
                    found.append(
                        {
                            "time": time, "node": node, "kind": NodeEventKind.PASSAGE, "speed": math.nan,
                            "length": math.nan, "strength": strength,
                        }
                    )  # fmt: skip

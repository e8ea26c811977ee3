"""Vehicles: laps around the buildings at the apron and runs along the taxiways, with stops."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components, dijkstra
from shapely import STRtree
from shapely.geometry import LineString
from shapely.ops import substring, unary_union

from pipeline.airport.model import Airport
from pipeline.lab.simulate.paths import Movement

Floats = NDArray[np.float64]


def service_roads(airport: Airport, clearance: float = 14.0) -> list[LineString]:
    """Closed ways around the buildings, `clearance` from their walls, clear of every runway; the longest first.

    They stand in for the service roads where the map has none. Only those at an apron are taken, if there is one.
    """
    buildings = [f.geometry for f in airport.features if f.kind == "Building" and f.geometry.area > 400.0]
    aprons = STRtree([f.geometry for f in airport.features if f.kind == "ApronElement"])
    keep_out = unary_union([one.strip.buffer(60.0) for one in airport.runways])
    around = unary_union([one.buffer(clearance) for one in buildings])
    rings = [LineString(part.exterior.coords) for part in getattr(around, "geoms", [around]) if not part.is_empty]
    roads = [
        ring
        for ring in rings
        if 150.0 < ring.length < 6000.0
        and not ring.intersects(keep_out)
        and (not len(aprons.geometries) or len(aprons.query(ring, predicate="dwithin", distance=20.0)))
    ]
    return sorted(roads, key=lambda one: -one.length)


def taxi_runs(airport: Airport, rng: np.random.Generator, count: int, shortest: float = 500.0) -> list[LineString]:
    """Ways along the taxiway network that stay out of the runways' protection areas; fewer when there are no more."""
    protected = [one.protection.get("normal", one.strip).union(one.strip) for one in airport.runways]
    keep_out = unary_union(protected)
    lines: dict[tuple[int, int], LineString] = {}
    for a, b, _, _, line in airport.graph.edges:
        if a != b and not line.intersects(keep_out):
            lines[a, b] = line
    n = len(airport.graph.nodes)
    if not lines:
        return []
    ends = np.array(list(lines))
    lengths = np.array([max(line.length, 0.1) for line in lines.values()])
    graph = csr_matrix((lengths, (ends[:, 0], ends[:, 1])), shape=(n, n))
    _, group = connected_components(graph, directed=False)
    nodes = np.flatnonzero(group == np.bincount(group).argmax())
    made: list[LineString] = []
    for _ in range(count * 20):
        if len(made) == count or len(nodes) < 2:
            break
        a, b = (int(one) for one in rng.choice(nodes, 2, replace=False))
        reached, before = dijkstra(graph, directed=False, indices=np.array(a), return_predecessors=True)
        if shortest <= reached[b] <= 3000.0:
            made.append(_walk(airport, lines, before, a, b))
    return made


def _walk(
    airport: Airport, lines: dict[tuple[int, int], LineString], before: NDArray[np.int32], a: int, b: int
) -> LineString:
    way = [b]
    while way[-1] != a:
        way.append(int(before[way[-1]]))
    way.reverse()
    points: list[tuple[float, float]] = [airport.graph.nodes[a]]
    for i, j in pairwise(way):
        line = lines.get((i, j)) or lines[j, i]
        coordinates = [(float(x), float(y)) for x, y, *_ in line.coords]
        here = airport.graph.nodes[i]
        if math.dist(coordinates[0], here) > math.dist(coordinates[-1], here):
            coordinates.reverse()
        points += coordinates[1:]
    return LineString(points)


def distances(total: float, speed: float, acceleration: float) -> Floats:
    """Distance run at whole seconds from rest to rest over `total` metres."""
    peak = min(speed, math.sqrt(total * acceleration))
    ramp = peak / acceleration
    cruise = max(total - peak * ramp, 0.0) / peak
    whole = 2 * ramp + cruise
    t = np.arange(math.ceil(whole) + 1.0)
    run = np.where(
        t < ramp,
        acceleration * t**2 / 2,
        np.where(
            t < ramp + cruise,
            peak * ramp / 2 + peak * (t - ramp),
            total - acceleration * np.maximum(whole - t, 0) ** 2 / 2,
        ),
    )
    return np.asarray(np.clip(run, 0.0, total))


def along(line: LineString, run: Floats, turning: float = 1.0) -> tuple[Floats, Floats, Floats, Floats]:
    """(east, north, heading, speed) at the distances `run` (one a second) along the line.

    The direction of a run backwards is that of driving forwards there. turning: s over which a turn is spread.
    On a closed line a run longer than it goes round again.
    """
    points = np.asarray(line.coords)[:, :2]
    steps = np.hypot(*np.diff(points, axis=0).T)
    reach = np.concatenate([[0.0], np.cumsum(steps)])

    def place(at: Floats) -> tuple[Floats, Floats]:
        within = np.mod(at, reach[-1]) if line.is_ring else np.clip(at, 0.0, reach[-1])
        return np.interp(within, reach, points[:, 0]), np.interp(within, reach, points[:, 1])

    east, north = place(run)
    moved = np.gradient(run)
    sense = np.where(moved >= 0, 3.0, -3.0)
    (east_ahead, north_ahead), (east_behind, north_behind) = place(run + sense), place(run - sense)
    de, dn = east_ahead - east_behind, north_ahead - north_behind
    moving = np.abs(moved) > 0.05
    held = np.maximum.accumulate(np.where(moving, np.arange(len(run)), -1))
    first = int(np.argmax(moving)) if moving.any() else 0
    held[held < 0] = first
    heading = np.unwrap(np.arctan2(de, dn)[held])
    return east, north, gaussian_filter1d(heading, turning, mode="nearest"), np.abs(moved)


def lap(
    line: LineString, seconds: int, rng: np.random.Generator, speed: float, *, back: bool
) -> tuple[Floats, Floats, Floats, Floats]:
    """A round of exactly `seconds` repeated as often as it fits: drives with stops along the line.

    back: drives to the end and back again; otherwise the line is closed and driven round and round.
    """
    stops = max(2, int(line.length / rng.uniform(250.0, 500.0)))
    marks = np.concatenate([[0.0], np.sort(rng.uniform(0.05, 0.95, stops)) * line.length, [line.length]])
    legs = [(a, b) for a, b in pairwise(marks) if b - a > 5.0]
    if back:
        legs += [(b, a) for a, b in reversed(legs)]
    runs: list[Floats] = []
    for a, b in legs:
        runs += [a + np.sign(b - a) * distances(abs(b - a), speed, 1.2), np.full(int(rng.uniform(6.0, 45.0)), b)]
    once = np.concatenate(runs)
    if len(once) > seconds:
        # too long a way for the time: only its first part, there and back
        part = LineString(substring(line, 0.0, 0.75, normalized=True).coords)
        return lap(part, seconds, rng, speed, back=True)
    times = max(1, seconds // len(once))
    spare = seconds - times * len(once)
    # the time that is left over is spent standing at the end of each round
    rounds = [np.concatenate([once, np.full(spare // times + (i < spare % times), once[-1])]) for i in range(times)]
    # a closed line is driven on and on: a round that began at 0 again would be a leap in the distance run
    run = np.concatenate([one + (0.0 if back else i * line.length) for i, one in enumerate(rounds)])
    return along(line, run, 1.0)


def vehicles(airport: Airport, seconds: float, count: int, seed: int) -> list[Movement]:
    """`count` vehicles for a whole loop: service vehicles round the buildings, follow-me cars and tugs on taxiways.

    Fewer only where the map has neither a building at an apron nor a taxiway.
    """
    rng = np.random.default_rng([seed, 11])
    roads = service_roads(airport)[:8]
    runs = taxi_runs(airport, rng, max(count // 3, 1))
    made: list[Movement] = []
    whole = int(seconds)
    for number in range(count):
        on_taxiway = number % 3 == 2
        lines = (runs or roads) if on_taxiway else (roads or runs)
        if not lines:
            break
        line = lines[number // 3 % len(lines)] if on_taxiway else lines[number % len(lines)]
        closed = line.is_ring
        name = ("CAR", "TUG")[number // 3 % 2] if on_taxiway else ("CAR", "TRUCK", "BUS", "TUG")[number % 4]
        speed = {"CAR": 10.0, "TUG": 5.5, "TRUCK": 8.0, "BUS": 8.0}[name] * float(rng.uniform(0.8, 1.1))
        east, north, heading, pace = lap(line, whole, rng, speed, back=not closed)
        shift = int(rng.integers(0, whole))
        columns = [np.roll(one, shift) for one in (east, north, pace)]
        turned = np.roll(heading, shift)
        callsign = f"{'FOLLOW' if on_taxiway and name == 'CAR' else name}{number + 1}"
        closing = [np.append(one, one[0]) for one in columns]
        made.append(
            Movement(
                name, callsign, f"{0x3A0000 + number:06x}", 0.0, closing[0], closing[1], np.zeros(whole + 1),
                np.unwrap(np.append(turned, turned[0])), closing[2], np.ones(whole + 1, bool),
                np.full(whole + 1, number % 5 != 4),
            )
        )  # fmt: skip
    return made

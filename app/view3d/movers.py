"""From a picture to the arrays of the moving scene: one instance a track, in places that stay."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from app.view3d.slots import Slots
from pipeline.picture import Alert, Picture
from pipeline.tables import TargetClass, TrackPhase, Tracks

CAPACITY = 1024
RINGS = 64
ALERT_LINES = 256
MAST_M = 150.0
"""Height of the line that stands over an alerted target."""

RING_M = 70.0
"""Least radius of the ring around an alerted target: it must be found from far away."""

VECTOR_S = 10.0
"""A speed vector ends where the target would be after this time."""

SLOW_MPS = 1.5
"""Below this a vector is not drawn and the course is not taken for a heading."""

COLOURS = np.array([[186, 192, 204], [52, 158, 255], [112, 222, 58]], np.uint8)
"""By TargetClass: unknown, aircraft, vehicle."""

COASTING = np.array([128, 132, 138], np.uint8)
INFORMATION = (255, 168, 0)
ALARM = (255, 26, 26)
SHAPES = ("unknown", "aircraft", "vehicle", "round")
"""By TargetClass, and one for aircraft whose nose is not known."""

ROUND = 3

# Length, width (m) where not known, and the limits within which the shape stays itself; by TargetClass.
USUAL = np.array([[8.0, 8.0], [37.0, 35.0], [8.0, 3.5]])
LEAST = np.array([[6.0, 6.0], [15.0, 14.0], [7.0, 3.5]])
MOST = np.array([[25.0, 25.0], [80.0, 80.0], [22.0, 8.0]])

Floats = NDArray[np.float32]
Colours = NDArray[np.uint8]


@dataclass(frozen=True, eq=False)
class Instances:
    """What a batched mesh takes: positions (N, 3) m, wxyzs (N, 4), scales (N, 3), colours (N, 3), opacities (N,)."""

    positions: Floats
    wxyzs: Floats
    scales: Floats
    colours: Colours
    opacities: Floats


@dataclass(frozen=True, eq=False)
class Strokes:
    """What a line-segment node takes: points (N, 2, 3) m, colours (N, 2, 3); unused ones lie in one point."""

    points: Floats
    colours: Colours


@dataclass(frozen=True)
class Target:
    """One track as the labels and panels need it. number: what it is called where it has no name. stage: of its gravest
    live alert, or None. heading: rad or nan."""

    id: int
    number: int
    row: int
    east: float
    north: float
    height: float
    speed: float
    size: float
    name: str
    category: int
    on_runway: bool
    coasting: bool
    simulated: bool
    stage: str | None


@dataclass(frozen=True, eq=False)
class Frame:
    """One state of the moving scene. bodies, by shape name; marks: rings in class colour under every mover."""

    picture: Picture
    bodies: dict[str, Instances]
    marks: Instances
    rings: dict[str, Instances]
    vectors: Strokes
    alert_lines: Strokes
    targets: dict[int, Target]


class Movers:
    """Keeps places and last headings between pictures; used by one thread. slots: of the tracks, by track id."""

    def __init__(self, runway_outlines: dict[str, Floats] | None = None) -> None:
        self.slots = Slots(CAPACITY)
        self._outlines = runway_outlines or {}
        self._heading = np.full(CAPACITY, np.nan)

    def arrange(self, picture: Picture) -> Frame:
        """The arrays for this picture. Tracks whose state is not finite are left out; so are those beyond CAPACITY."""
        tracks = picture.tracks[np.isfinite(picture.tracks.state).all(axis=1)]
        places, fresh = self.slots.assign(tracks.id.tolist())
        self._heading[fresh] = np.nan
        place = np.array([places.get(one, -1) for one in tracks.id.tolist()], np.int64)
        tracks, place = tracks[place >= 0], place[place >= 0]
        live = [one for one in picture.alerts if one.state != "cleared"]
        stages = _stages(live)
        height = np.where(np.isfinite(tracks.altitude) & ~tracks.on_ground, np.maximum(tracks.altitude, 0.0), 0.0)
        position: NDArray[np.float64] = np.round(np.column_stack([tracks.state[:, :2], height]), 1)
        speed: NDArray[np.float64] = np.hypot(tracks.state[:, 2], tracks.state[:, 3])
        category = np.minimum(tracks.category.astype(np.int64), int(max(TargetClass)))
        size = _sizes(tracks, category)
        colour = _colours(tracks, category, stages)
        heading = self._headings(tracks, place, speed)
        shape = np.where(np.isnan(heading) & (category == TargetClass.AIRCRAFT), ROUND, category)
        coasting = tracks.phase == TrackPhase.COASTING
        axis = np.deg2rad(np.round(np.rad2deg(tracks.axis)))
        wxyz = _turned(np.nan_to_num(np.where(np.isfinite(heading), heading, axis)))
        bodies = {}
        for k, name in enumerate(SHAPES):
            one = shape == k
            scale = np.column_stack([size, _tallness(k, size)])
            opacity = np.where(coasting, 0.4, 1.0)
            bodies[name] = _instances(
                CAPACITY, place[one], position[one], wxyz[one], scale[one], colour[one], opacity[one]
            )
        radius = np.maximum(size.max(axis=1, initial=0.0) * 0.75, 14.0)
        flat = np.column_stack([radius, radius, np.ones(len(radius))])
        lifted = position + np.array([0, 0, 0.3])
        marks = _instances(
            CAPACITY, place, lifted, _turned(np.zeros(len(place))), flat, colour, np.where(coasting, 0.25, 0.6)
        )
        targets = _targets(tracks, position, speed, size, category, stages)
        return Frame(
            picture=picture,
            bodies=bodies,
            marks=marks,
            rings=_rings(targets),
            vectors=_vectors(place, position, tracks.state[:, 2:4], speed, colour),
            alert_lines=self._alert_lines(live, targets),
            targets=targets,
        )

    def _headings(self, tracks: Tracks, place: NDArray[np.int64], speed: NDArray[np.float64]) -> NDArray[np.float64]:
        """The nose; where not known the course of what moves, otherwise what was known last. Steps of 1 degree."""
        course = np.arctan2(tracks.state[:, 2], tracks.state[:, 3])
        heading = tracks.heading.astype(np.float64)
        heading = np.where(np.isfinite(heading), heading, np.where(speed >= SLOW_MPS, course, self._heading[place]))
        heading = np.deg2rad(np.round(np.rad2deg(heading)))
        self._heading[place] = heading
        return heading

    def _alert_lines(self, alerts: list[Alert], targets: dict[int, Target]) -> Strokes:
        """Links between the targets of an alert, a mast over each of them, and the outline of its runway."""
        points: list[Floats] = []
        colours: list[tuple[int, int, int]] = []
        drawn: set[object] = set()
        for alert in sorted(alerts, key=lambda one: one.stage != "alarm"):
            colour = ALARM if alert.stage == "alarm" else INFORMATION
            feet = [targets[one.track] for one in alert.targets if one.track in targets]
            made: dict[object, Floats] = {}
            for one in feet:
                foot = np.array([one.east, one.north, one.height + 6.0], np.float32)
                made[one.id] = np.array([[foot, foot + np.array([0, 0, MAST_M])]], np.float32)
            for a, b in pairwise(feet):
                link = [[(one.east, one.north, one.height + 6.0) for one in (a, b)]]
                made[frozenset((a.id, b.id))] = np.array(link, np.float32)
            if alert.runway in self._outlines:
                made[alert.runway] = self._outlines[alert.runway]
            for what, segments in made.items():
                # The gravest alert comes first and nothing is drawn over it.
                if what not in drawn:
                    drawn.add(what)
                    points.append(segments)
                    colours += [colour] * len(segments)
        return _strokes(ALERT_LINES, np.concatenate([np.zeros((0, 2, 3), np.float32), *points]), colours)


def outline(east: NDArray[np.float64], north: NDArray[np.float64]) -> Floats:
    """A closed line a little above the ground, as segments."""
    points = np.column_stack([east, north, np.full(len(east), 0.8)])
    return np.stack([points[:-1], points[1:]], axis=1).astype(np.float32)


def _stages(alerts: list[Alert]) -> dict[int, str]:
    """The gravest stage of every track in a live alert."""
    found: dict[int, str] = {}
    for alert in alerts:
        for target in alert.targets:
            if found.get(target.track) != "alarm":
                found[target.track] = alert.stage
    return found


def _sizes(tracks: Tracks, category: NDArray[np.int64]) -> NDArray[np.float64]:
    """(n, 2) length and width in steps of half a metre; what is not known is usual for the class."""
    size = np.column_stack([tracks.length, tracks.width]).astype(np.float64)
    size = np.where(np.isfinite(size) & (size > 0), size, USUAL[category])
    size = np.clip(size, LEAST[category], MOST[category])
    plane = category == TargetClass.AIRCRAFT
    # A radar sees the extent of an airliner badly across its nose; outside these proportions it would look broken.
    size[plane, 1] = np.clip(size[plane, 1], 0.75 * size[plane, 0], 1.1 * size[plane, 0])
    return np.round(size * 2) / 2


def _tallness(kind: int, size: NDArray[np.float64]) -> NDArray[np.float64]:
    if kind == TargetClass.AIRCRAFT:
        return size[:, 0]
    return np.clip(size[:, 0] * 0.42, 3.2, 6.0)


def _colours(tracks: Tracks, category: NDArray[np.int64], stages: dict[int, str]) -> Colours:
    colour = COLOURS[category]
    colour[tracks.phase == TrackPhase.COASTING] = COASTING
    if stages:
        for row, one in enumerate(tracks.id.tolist()):
            if one in stages:
                colour[row] = ALARM if stages[one] == "alarm" else INFORMATION
    return colour


def _turned(heading: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n, 4) quaternions that turn +x towards a heading clockwise from north."""
    half = (np.pi / 2 - heading) / 2
    nought = np.zeros(len(half))
    return np.column_stack([np.cos(half), nought, nought, np.sin(half)])


def _instances(
    capacity: int,
    place: NDArray[np.int64],
    position: NDArray[np.float64],
    wxyz: NDArray[np.float64],
    scale: NDArray[np.float64],
    colour: Colours,
    opacity: NDArray[np.float64],
) -> Instances:
    positions, scales = np.zeros((capacity, 3), np.float32), np.zeros((capacity, 3), np.float32)
    wxyzs = np.tile(np.array([1, 0, 0, 0], np.float32), (capacity, 1))
    colours, opacities = np.full((capacity, 3), 128, np.uint8), np.ones(capacity, np.float32)
    positions[place], wxyzs[place], scales[place] = position, wxyz, scale
    colours[place], opacities[place] = colour, opacity
    return Instances(positions, wxyzs, scales, colours, opacities)


def _targets(
    tracks: Tracks,
    position: NDArray[np.float64],
    speed: NDArray[np.float64],
    size: NDArray[np.float64],
    category: NDArray[np.int64],
    stages: dict[int, str],
) -> dict[int, Target]:
    columns = zip(
        tracks.id.tolist(), tracks.shown_number.tolist(), position.tolist(), speed.tolist(), size[:, 0].tolist(),
        tracks.callsign.tolist(), category.tolist(), (tracks.runway >= 0).tolist(),
        (tracks.phase == TrackPhase.COASTING).tolist(), tracks.simulated.tolist(), strict=True,
    )  # fmt: skip
    return {
        id: Target(
            id,
            number,
            row,
            where[0],
            where[1],
            where[2],
            fast,
            long,
            name.strip(),
            kind,
            on_runway,
            coasting,
            simulated,
            stages.get(id),
        )
        for row, (id, number, where, fast, long, name, kind, on_runway, coasting, simulated) in enumerate(columns)
    }


def _rings(targets: dict[int, Target]) -> dict[str, Instances]:
    made = {}
    for stage, colour in (("information", INFORMATION), ("alarm", ALARM)):
        hit = [one for one in targets.values() if one.stage == stage][:RINGS]
        radius = np.array([max(one.size * 1.3, RING_M) for one in hit])
        position = np.array([(one.east, one.north, one.height + 0.9) for one in hit]).reshape(-1, 3)
        made[stage] = _instances(
            RINGS, np.arange(len(hit)), position, _turned(np.full(len(hit), np.pi / 2)),
            np.column_stack([radius, radius, np.ones(len(hit))]), np.array(colour, np.uint8), np.ones(len(hit)),
        )  # fmt: skip
    return made


def _vectors(
    place: NDArray[np.int64],
    position: NDArray[np.float64],
    velocity: NDArray[np.float64],
    speed: NDArray[np.float64],
    colour: Colours,
) -> Strokes:
    points, colours = np.zeros((CAPACITY, 2, 3), np.float32), np.zeros((CAPACITY, 2, 3), np.uint8)
    shown = speed >= SLOW_MPS
    from_ = position[shown] + np.array([0, 0, 2.0])
    to = from_ + np.column_stack([velocity[shown] * VECTOR_S, np.zeros(int(shown.sum()))])
    points[place[shown]] = np.stack([from_, to], axis=1)
    colours[place[shown]] = colour[shown, None, :]
    return Strokes(points, colours)


def _strokes(capacity: int, points: Floats, colours: list[tuple[int, int, int]]) -> Strokes:
    count = min(len(points), capacity)
    all_points, all_colours = np.zeros((capacity, 2, 3), np.float32), np.zeros((capacity, 2, 3), np.uint8)
    all_points[:count] = points[:count]
    if count:
        all_colours[:count] = np.array(colours[:count], np.uint8)[:, None, :]
    return Strokes(all_points, all_colours)

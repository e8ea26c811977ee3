"""The demonstration's sensors and runways as settings, and its world."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from app.airports import load_airport
from app.demo.traffic import load_recording
from app.settings import NodeSettings, RadarSettings, RunwaySettings, Settings, SettingsError
from app.settings_sources import UdpSettings
from pipeline.airport.model import Airport
from pipeline.lab.simulate.nodes import node_sites
from pipeline.lab.simulate.recording import Recording, RecordingError
from pipeline.lab.simulate.scenes import synthetic_world
from pipeline.lab.simulate.world import World, build_world

PLACES = {"LFPO": (-100.0, -500.0, 40.0)}
"""Where the radar stands: east, north, height of the antenna (m). At Orly most runway is in sight from there."""


@lru_cache(maxsize=2)
def _scene(airport: str, traffic: str) -> tuple[Airport, Recording]:
    loaded, _ = load_airport(airport)
    try:
        recording = load_recording(traffic, loaded)
    except RecordingError as error:
        raise SettingsError(f"demo.traffic: {error}") from error
    if recording.icao != loaded.icao:
        raise SettingsError(f"demo.traffic: recorded at {recording.icao}, but the airport is {loaded.icao}")
    return loaded, recording


def demo_world(settings: Settings, start: float) -> World:
    """What is true from `start` (UTC s) on. Raises SettingsError."""
    airport, recording = _scene(settings.airport, settings.demo.traffic)
    if settings.demo.synthetic_targets:
        return synthetic_world(airport, settings.demo.synthetic_targets, settings.demo.seed, start=start)
    return build_world(
        airport,
        recording,
        start=start,
        seed=settings.demo.seed,
        first_incident=settings.demo.first_incident_s,
        incident_every=settings.demo.incident_every_s,
    )


def demo_settings(settings: Settings) -> Settings:
    """The settings with the demonstration's radar, nodes and runways in use, all marked as simulated.

    Raises SettingsError when there is no traffic for the airport.
    """
    world = demo_world(settings, 0.0)
    airport = world.airport
    nodes = []
    for site in node_sites(airport):
        latitude, longitude = airport.frame.to_geodetic(site.east, site.north)
        nodes.append(
            NodeSettings(
                id=site.id,
                latitude=float(latitude),
                longitude=float(longitude),
                heading_deg=math.degrees(site.heading) % 360.0,
                hold=site.hold,
                runway=site.runway,
                accuracy_m=site.accuracy,
                simulated=True,
            )
        )
    runways = tuple(RunwaySettings(id=id, in_use=end) for id, end in sorted((world.runways or {}).items()))
    return settings.model_copy(
        update={
            "mode": "demo",
            "radars": (demo_radar(airport, settings.demo.udp_port),),
            "nodes": tuple(nodes),
            "runways": runways,
        }
    )


def demo_radar(airport: Airport, port: int) -> RadarSettings:
    """A 60 rpm surface movement radar that reaches every runway end."""
    ends = np.array([(end.threshold.x, end.threshold.y) for one in airport.runways for end in one.ends])
    middle = (ends.min(axis=0) + ends.max(axis=0)) / 2 if len(ends) else np.zeros(2)
    east, north, height = PLACES.get(airport.icao, (float(middle[0]), float(middle[1]), 40.0))
    reach = float(np.hypot(ends[:, 0] - east, ends[:, 1] - north).max()) if len(ends) else 3000.0
    step = max(3.0, math.ceil(1.02 * reach / 1024 * 10) / 10)
    latitude, longitude = airport.frame.to_geodetic(east, north)
    return RadarSettings(
        id="SMR1",
        latitude=float(latitude),
        longitude=float(longitude),
        height_m=height,
        azimuths=4096,
        ranges=1024,
        range_step_m=step,
        beamwidth_deg=0.18,
        period_s=1.0,
        simulated=True,
        udp=UdpSettings(address="127.0.0.1", port=port),
    )

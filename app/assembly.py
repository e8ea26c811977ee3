"""From settings to the parts of the core: sites, chains, tracker and alert monitor."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.settings import NodeSettings, PartSettings, RadarSettings, Settings, SettingsError
from pipeline import parts
from pipeline.airport.model import Airport
from pipeline.airport.surfaces import surface_of_radar
from pipeline.alert.monitor import AlertMonitor
from pipeline.chain import RadarChain
from pipeline.engine import SurfaceEngine
from pipeline.sites import NodeSite, RadarSite
from pipeline.tables import VideoFormat
from pipeline.track.settings import ReportingSettings, TrackerSettings
from pipeline.track.tracker import Tracker


def radar_site(radar: RadarSettings, airport: Airport) -> RadarSite:
    """The radar in local metres and radians."""
    east, north = airport.frame.to_local(radar.latitude, radar.longitude)
    video = VideoFormat(
        azimuths=radar.azimuths,
        ranges=radar.ranges,
        first_range_m=radar.first_range_m,
        range_step_m=radar.range_step_m,
        beamwidth_rad=math.radians(radar.beamwidth_deg),
        period_s=radar.period_s,
        db_per_step=radar.db_per_step,
    )
    return RadarSite(
        id=radar.id,
        east=float(east),
        north=float(north),
        height=radar.height_m,
        video=video,
        north_offset=math.radians(radar.north_offset_deg),
        simulated=radar.simulated,
    )


def node_site(node: NodeSettings, airport: Airport) -> NodeSite:
    """The node in local metres and radians."""
    east, north = airport.frame.to_local(node.latitude, node.longitude)
    return NodeSite(
        id=node.id,
        east=float(east),
        north=float(north),
        heading=math.radians(node.heading_deg),
        hold=node.hold,
        runway=node.runway,
        accuracy=node.accuracy_m,
        simulated=node.simulated,
    )


def radar_heard_at(radar: RadarSettings, address: str) -> RadarSettings:
    """A radar whose datagrams are awaited at this address where it names neither an address nor a group."""
    if radar.udp is None or radar.udp.address or radar.udp.group:
        return radar
    return radar.model_copy(update={"udp": radar.udp.model_copy(update={"address": address})})


AHEAD_MARGIN_S = 1.0
"""The engine refuses what is dated this much further ahead than the clock settings allow: a second line of defence."""

FRONT_END = {"detect": "detector", "extract": "extractor", "bearing": "bearing"}
"""The verbs whose parts work on one radar's video, and what `RadarChain` calls the part."""


def radar_chain(
    site: RadarSite,
    index: int,
    settings: Settings,
    airport: Airport | None,
    clock: Callable[[], float] | None = None,
) -> RadarChain:
    """The chosen parts on one radar's video."""
    surface = surface_of_radar(airport, site) if airport is not None else None
    return chain_of(site, index, build_parts(settings, FRONT_END), surface, clock)


def chain_of(
    site: RadarSite,
    index: int,
    made: Mapping[str, Any],
    surface: NDArray[np.uint8] | None,
    clock: Callable[[], float] | None = None,
) -> RadarChain:
    """A chain of parts that are built. made: the part of each verb of FRONT_END."""
    return RadarChain(
        site, index, **{word: made[verb] for verb, word in FRONT_END.items()}, surface=surface, clock=clock
    )


def build_parts(settings: Settings, verbs: Iterable[str]) -> dict[str, Any]:
    """The part that the settings choose for each verb. Raises SettingsError."""
    return {verb: _part(verb, getattr(settings.parts, verb)) for verb in verbs}


def scans_to_learn(settings: Settings) -> int:
    """Turns in which the chosen detector only learns. Raises SettingsError."""
    return int(getattr(build_parts(settings, ("detect",))["detect"], "learn_scans", 0))


def parts_of(chain: RadarChain) -> dict[str, Any]:
    """The part of each verb of FRONT_END."""
    return {verb: getattr(chain, word) for verb, word in FRONT_END.items()}


def surface_engine(
    settings: Settings,
    airport: Airport,
    radars: tuple[RadarSite, ...],
    nodes: tuple[NodeSite, ...],
    *,
    first_alert: int = 1,
    clock: Callable[[], float] | None = None,
) -> SurfaceEngine:
    """Tracker and alert monitor as chosen, with the runways in the state that the settings give."""
    tracker = Tracker(
        airport,
        radars,
        nodes,
        filter=_part("filter", settings.parts.filter),
        associate=_part("associate", settings.parts.associate),
        lifecycle=_part("lifecycle", settings.parts.lifecycle),
        classify=_part("classify", settings.parts.classify),
        capacity=settings.tracker.capacity,
        settings=TrackerSettings(reporting=ReportingSettings(asterix_numbers=settings.tracker.asterix_numbers)),
    )
    rules = tuple(_part("alert", one) for one in settings.parts.alert)
    monitor = AlertMonitor(airport, rules, first_id=first_alert, nodes=nodes)
    for runway in settings.runways:
        try:
            monitor.set_runway(runway.id, open=runway.open, in_use=runway.in_use or "", visibility=runway.visibility)
        except (KeyError, ValueError) as error:
            raise SettingsError(f"runways: {error}") from error
    return SurfaceEngine(airport, radars, nodes, tracker, monitor, clock, _most_ahead(settings))


def _most_ahead(settings: Settings) -> float:
    """How far after its arrival anything may be dated: more than the clock of any source is allowed to be off, s."""
    clocks = (settings.clocks.reports, settings.clocks.nodes, *(one.clock for one in settings.radars))
    return max(one.max_offset_s for one in clocks) + AHEAD_MARGIN_S


def check_parts(settings: Settings) -> None:
    """Build every chosen part once, so that a wrong name or setting stops the start. Raises SettingsError."""
    for verb, chosen in settings.parts:
        for one in chosen if isinstance(chosen, tuple) else (chosen,):
            _part(verb, one)


def _part(verb: str, chosen: PartSettings) -> Any:
    try:
        return parts.build(verb, chosen.name, chosen.settings())
    except parts.PartError as error:
        raise SettingsError(f"parts.{verb}: {error}") from error

"""The demonstration through radar chain and tracker, scored against its truth."""

from __future__ import annotations

from collections.abc import Callable

from app.assembly import node_site, radar_chain, radar_site, surface_engine
from app.demo.scene import demo_settings, demo_world
from app.settings import Settings
from pipeline.lab.measure.picture_quality import Score, picture_quality
from pipeline.lab.simulate.nodes import NodeSimulator
from pipeline.lab.simulate.reports import ReportSimulator
from pipeline.lab.simulate.video import VideoSimulator

START = 1_700_000_000.0


def demo_quality(
    scans: int,
    progress: Callable[[int], None] | None = None,
    settings: Settings | None = None,
    settle: float = 30.0,
    seed: int | None = None,
) -> Score:
    """Run `scans` turns of the demonstration; the same every time.

    settle: s at the start that are not counted. seed: instead of the one in the settings.
    """
    settings = settings or Settings()
    if seed is not None:
        settings = settings.model_copy(update={"demo": settings.demo.model_copy(update={"seed": seed})})
    settings = demo_settings(settings)
    world = demo_world(settings, START)
    site = radar_site(settings.radars[0], world.airport)
    nodes = tuple(node_site(one, world.airport) for one in settings.nodes)
    chosen = settings.demo.seed
    return picture_quality(
        world,
        radar_chain(site, 0, settings, world.airport),
        surface_engine(settings, world.airport, (site,), nodes),
        VideoSimulator(world.airport, site, chosen, start=START),
        NodeSimulator(nodes, chosen),
        ReportSimulator(chosen),
        scans,
        settle,
        progress,
    )

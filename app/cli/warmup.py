"""`airside warmup`: compile every kernel, so that the next start is quick."""

from __future__ import annotations

import typer


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(warmup)


def warmup() -> None:
    """Compile every kernel into the cache (a Docker image does this when it is built). Ctrl-C ends it, status 130."""
    import time

    from rich.console import Console

    from app.airports import load_airport
    from app.assembly import FRONT_END, build_parts, chain_of
    from app.demo import demo_settings
    from app.demo import warm as warm_simulator
    from app.logs import log_to
    from app.service import SurfaceService
    from app.settings import load
    from app.startup import say, steps
    from pipeline import parts

    console = Console()
    log_to(console)
    settings = demo_settings(load())
    log_to(console, settings.log_level, settings.log_format)
    begun = time.perf_counter()
    with steps(console, settings) as step:
        step("compiling the kernels of the chain and the tracker")
        service = SurfaceService(settings, *load_airport(settings.airport))
        service.prepare(resume=False)
        step("compiling the kernels of the other parts of a radar")
        for verb in FRONT_END:
            for name in parts.available(verb):
                made = {**build_parts(settings, FRONT_END), verb: parts.build(verb, name)}
                chain_of(service.radars[0], 0, made, None).warm()
        step("compiling the kernels of the simulator")
        warm_simulator()
    say(console, settings, f"every kernel is compiled ({time.perf_counter() - begun:.1f} s)")

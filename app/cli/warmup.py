"""`airside warmup`: compile every kernel, so that the next start is quick."""

from __future__ import annotations

import typer


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(warmup)


def warmup() -> None:
    """Compile every kernel into the cache (a Docker image does this when it is built)."""
    import time

    from rich.console import Console

    from app.airports import load_airport
    from app.assembly import FRONT_END, build_parts, chain_of
    from app.demo import demo_settings
    from app.demo import warm as warm_simulator
    from app.service import SurfaceService
    from app.settings import load
    from pipeline import parts

    console = Console()
    begun = time.perf_counter()
    settings = demo_settings(load())
    service = SurfaceService(settings, *load_airport(settings.airport))
    with console.status("compiling the kernels of the chain and the tracker", spinner="line"):
        service.prepare(resume=False)
    with console.status("compiling the kernels of the other parts of a radar", spinner="line"):
        for verb in FRONT_END:
            for name in parts.available(verb):
                made = {**build_parts(settings, FRONT_END), verb: parts.build(verb, name)}
                chain_of(service.radars[0], 0, made, None).warm()
    with console.status("compiling the kernels of the simulator", spinner="line"):
        warm_simulator()
    console.print(f"every kernel is compiled ({time.perf_counter() - begun:.1f} s)")

"""`airside airport`: import, show and list airport maps."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, NoReturn

import typer

airport = typer.Typer(no_args_is_help=True, help="Import, show and list airport maps.")


@airport.command("import")
def import_(
    file: Annotated[Path, typer.Argument(help="Extract: Overpass JSON, OSM XML, or GeoJSON of overpass-turbo.")],
    icao: Annotated[str, typer.Option(help="ICAO code of the airport in it, such as LFPO.")],
    output: Annotated[Path | None, typer.Option(help="Where to write the map; ICAO.geojson here by default.")] = None,
    name: Annotated[str | None, typer.Option(help="Name, when the extract does not tell it.")] = None,
    elevation: Annotated[
        float | None, typer.Option(help="Metres above mean sea level, when the extract does not tell them.")
    ] = None,
) -> None:
    """Make an airport map (GeoJSON) of an OpenStreetMap extract.

    Get an extract from any Overpass server with, for example,
    [bold]\\[out:json];nwr\\["aeroway"](48.70,2.28,48.77,2.42);out geom;[/bold]
    (and the buildings and roads of the same box); `out body; >; out skel;`, the exports of overpass-turbo and files of
    openstreetmap.org do as well. What the map does not tell (widths, heights, missing holding positions) is derived at
    the values of ICAO Annex 14 and marked in the file. The summary counts what was derived, left out or not used, and
    says what to check. An extract that the server cut off, or without a runway in use, is refused.
    """
    import json

    from app.ingest.osm_extract import parse_extract
    from pipeline.airport.geojson import AirportFault, airport_from_geojson
    from pipeline.airport.osm import ImportFault, airport_geojson

    try:
        document = airport_geojson(parse_extract(file.read_bytes()), icao, name, elevation=elevation)
        airport_from_geojson(document)
    except OSError as error:
        _fail(f"{file}: cannot be read ({error})")
    except (ImportFault, AirportFault) as error:
        _fail(f"{file}: {error}")
    target = output or Path(f"{document['icao']}.geojson")
    try:
        target.write_text(json.dumps(document, ensure_ascii=False, separators=(",", ":")), encoding="utf-8")
    except OSError as error:
        _fail(f"{target}: cannot be written ({error})")
    _summarise(document)
    typer.echo(f'\nWritten to {target}. Use it with: airport = "{target}" in the settings, or AIRSIDE_AIRPORT={target}')


@airport.command("show")
def show(
    which: Annotated[str, typer.Argument(metavar="ICAO|FILE", help="Shipped airport, or the path of a map.")],
) -> None:
    """Print what a map holds: runways, holding positions, counts."""
    from app.airports import load_airport
    from pipeline.airport.geojson import AirportFault

    try:
        loaded, document = load_airport(which)
    except AirportFault as error:
        _fail(str(error))
    _summarise(document)
    typer.echo(f"\nTaxiway network: {len(loaded.graph.nodes)} nodes, {len(loaded.graph.edges)} edges")
    for runway in loaded.runways:
        typer.echo(f"\nRunway {runway.id}  {runway.centreline.length:.0f} x {runway.width:.0f} m")
        for hold in sorted((one for one in loaded.holding_positions if one.runway == runway.id), key=lambda h: h.name):
            derived = "  derived" if hold.derived else ""
            metres = runway.centreline.distance(hold.position)
            typer.echo(f"  hold {hold.name or '(unnamed)':10} {hold.category:11} {metres:4.0f} m{derived}  {hold.id}")


@airport.command("list")
def list_() -> None:
    """Print the airports that come with the program."""
    import json

    from app.airports import shipped_airports

    for code, path in shipped_airports().items():
        typer.echo(f"{code}  {json.loads(path.read_text(encoding='utf-8'))['name']}")


def register(app: typer.Typer) -> None:
    """Add `airport` to the command line."""
    app.add_typer(airport, name="airport")


def _summarise(document: dict[str, Any]) -> None:
    from collections import Counter

    counts = Counter(one["properties"]["kind"] for one in document["features"])
    typer.echo(f"{document.get('icao', '')}  {document.get('name', '')}")
    elevation = document.get("elevation_m")
    typer.echo(f"Elevation: {'not known' if elevation is None else f'{elevation:g} m'}")
    elements = [one["properties"] for one in document["features"] if one["properties"]["kind"] == "RunwayElement"]
    runways = [str(one.get("runway")) for one in elements if one.get("status", "open") == "open"]
    typer.echo(f"Runways: {', '.join(runways)}")
    _table("Features", dict(sorted(counts.items())))
    told = document.get("import")
    if isinstance(told, dict):
        _table("Derived, not in the source", told.get("derived"))
        _table("Left out", told.get("left_out"))
        _table("Not used", told.get("not_used"))
        _list("To check", told.get("to_check"))
    typer.echo(f"\n{document.get('attribution', '')}")


def _table(title: str, rows: Any) -> None:
    if not isinstance(rows, dict) or not rows:
        return
    typer.echo(f"\n{title}")
    for name, count in rows.items():
        typer.echo(f"  {count:6}  {name}")


def _list(title: str, sentences: Any) -> None:
    if isinstance(sentences, list) and sentences:
        typer.echo(f"\n{title}")
        for one in sentences:
            typer.echo(f"  - {one}")


def _fail(message: str) -> NoReturn:
    typer.echo(f"airside: {message}", err=True)
    raise typer.Exit(1)

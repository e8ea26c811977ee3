"""The words beside the scene: state of the feed, alerts, and what is known about the selected target."""

from __future__ import annotations

from datetime import UTC, datetime
from html import escape
from math import degrees, isfinite

import numpy as np

from app.contract import ReplayState
from app.view3d.labels import KNOTS
from app.view3d.movers import Frame, Target
from pipeline.airport.model import Airport
from pipeline.picture import Picture
from pipeline.tables import Source, TargetClass, TrackPhase

LOST_S = 3.0
"""Without a new picture for this long the feed counts as lost."""

SHOWN_ALERTS = 6
DEMO_TEXT = "DEMO: recorded traffic, simulated sensors"


def _line(text: str, style: str) -> str:
    return f'<div style="{style}">{text}</div>'


def status(
    airport: Airport, mode: str, picture: Picture | None, age: float | None, replay: ReplayState | None = None
) -> str:
    """The head of the panel as HTML. age: seconds since the newest picture came, or since the replay was let go on.

    replay: where the replay stands; while it is paused no picture is awaited, so none is lost.
    """
    rows = []
    if mode == "replay":
        look = "background:#4b3f73;color:#fff;padding:6px 8px;border-radius:4px;font-weight:700;font-size:15px"
        rows.append(_line(_replay_words(picture, replay), look))
    elif mode != "live":
        text = DEMO_TEXT
        rows.append(_line(text, "background:#4b3f73;color:#fff;padding:4px 8px;border-radius:4px;font-weight:700"))
    if picture is None or age is None:
        rows.append(_line("waiting for the first picture", "color:#f2b441;font-weight:700"))
        return _boxed(rows)
    if _lost(age, replay):
        text = f"FEED LOST: picture {age:.0f} s old"
        rows.append(_line(text, "background:#c81e1e;color:#fff;padding:6px 8px;border-radius:4px;font-weight:700"))
    clock = datetime.fromtimestamp(picture.time, UTC).strftime("%H:%M:%S")
    rows.append(_line(f"<b>{escape(airport.icao)}</b> {clock} UTC, {len(picture.tracks)} targets", ""))
    live = [one for one in picture.alerts if one.state != "cleared"]
    for alert in sorted(live, key=lambda one: one.stage != "alarm")[:SHOWN_ALERTS]:
        colour, word = ("#ff5a5a", "ALARM") if alert.stage == "alarm" else ("#f2b441", "INFORMATION")
        rows.append(
            _line(
                f'<b style="color:{colour}">{word}</b> {escape(alert.text)}',
                f"border-left:3px solid {colour};padding-left:6px",
            )
        )
    if len(live) > SHOWN_ALERTS:
        rows.append(_line(f"and {len(live) - SHOWN_ALERTS} more", ""))
    if not live:
        rows.append(_line("no alerts", "color:#8796a3"))
    return _boxed(rows)


def _lost(age: float, replay: ReplayState | None) -> bool:
    if replay is None:
        return age > LOST_S
    return replay.playing and age > LOST_S / min(1.0, replay.speed)


def _replay_words(picture: Picture | None, replay: ReplayState | None) -> str:
    """That it is a replay, with the date and time of what is shown."""
    time = picture.time if picture is not None else replay.time if replay is not None else None
    shown = "of a recording" if time is None else datetime.fromtimestamp(time, UTC).strftime("%Y-%m-%d %H:%M:%S UTC")
    how = "not live"
    if replay is not None:
        how += f", {replay.speed:g} times the recorded pace" if replay.playing else ", paused"
    return f'REPLAY {shown}<div style="font-weight:400;font-size:12px">{how}</div>'


def legend() -> str:
    """What the colours and signs mean."""
    signs = (
        ("#60beff", "aircraft"), ("#96e66e", "vehicle"), ("#c4cbd4", "unknown"), ("#80848a", "coasting"),
        ("#ffb21e", "information: ring"), ("#ff3434", "alarm: double ring"),
    )  # fmt: skip
    dots = " ".join(f'<span style="white-space:nowrap"><b style="color:{c}">&#9679;</b> {t}</span>' for c, t in signs)
    return _boxed([_line(dots, "font-size:0.9em"), _line("vectors: 10 s ahead; click a target", "color:#8796a3")])


def selected(airport: Airport, frame: Frame, target: Target | None) -> str:
    """What is known about one track, as markdown."""
    if target is None:
        return "*Nothing selected: click a target.*"
    tracks = frame.picture.tracks
    row = int(np.flatnonzero(tracks.id == target.id)[0])
    sources = [str(one.name).lower() for one in Source if one and tracks.sources[row] & one]
    zone, runway = int(tracks.zone[row]), int(tracks.runway[row])
    feature = airport.features[zone] if 0 <= zone < len(airport.features) else None
    facts = {
        "Class": TargetClass(min(int(tracks.category[row]), 2)).name.lower(),
        "Address": str(tracks.address[row]) or "not known",
        "Speed": f"{target.speed * KNOTS:.0f} kt ({target.speed:.1f} m/s)",
        "Heading": _angle(float(tracks.heading[row])),
        "Altitude": "on the ground" if tracks.on_ground[row] else _metres(float(tracks.altitude[row])),
        "Length, width": f"{_metres(float(tracks.length[row]))}, {_metres(float(tracks.width[row]))}",
        "Zone": (feature.name or feature.id) if feature else "none",
        "Runway": airport.runways[runway].id if 0 <= runway < len(airport.runways) else "none",
        "Phase": TrackPhase(min(int(tracks.phase[row]), 2)).name.lower(),
        "Sources": ", ".join(sources) or "none",
        "Alert": target.stage or "none",
    }
    name = _plain(target.name) or f"Track {target.number}"
    head = f"### {name}\nTrack {target.number}{', **simulated input**' if target.simulated else ''}\n"
    return head + "\n| | |\n| --- | --- |\n" + "\n".join(f"| {k} | {_plain(v)} |" for k, v in facts.items())


def _plain(text: str) -> str:
    """Text from outside without anything that markdown or HTML would take for its own."""
    return escape("".join(one for one in text if one.isprintable() and one not in "|`*_[]#\\"), quote=False)


def _metres(value: float) -> str:
    return f"{value:.0f} m" if isfinite(value) else "not known"


def _angle(value: float) -> str:
    return f"{degrees(value) % 360:03.0f} degrees" if isfinite(value) else "not known"


def _boxed(rows: list[str]) -> str:
    return f'<div style="padding:0 12px 4px;font-size:13px;line-height:1.45;display:grid;gap:5px">{"".join(rows)}</div>'

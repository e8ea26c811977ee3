"""Runway designators: read as mappers write them, turned round, compared with a direction.

A designator is a number of tens of degrees with the side of parallel runways (ICAO Annex 14 Volume I, 5.2.2) and, in
some countries, a letter for what it counts from or for whom it is: T (true north), W (water), G (grass or gravel),
S (short), U (ultralight), H (helicopters). Water lanes may be called by points of the compass ("NE/SW").
"""

from __future__ import annotations

import math
import re

COMPASS = (
    "N", "NNE", "NE", "ENE", "E", "ESE", "SE", "SSE", "S", "SSW", "SW", "WSW", "W", "WNW", "NW", "NNW"
)  # fmt: skip
GRID_NORTH_SOUTH_OF = -60.0
"""Degrees of latitude. In the Antarctic, designators count from grid north: the direction of the Greenwich meridian."""

_END = r"0?(\d{1,2})(?:\s?([LCR]))?([A-Z]{0,2})"
_PAIR = re.compile(rf"(?<![A-Z0-9]){_END}\s*[/-]\s*{_END}(?![A-Z0-9])")
_SINGLE = re.compile(_END)
_COMPASS_PAIR = re.compile(rf"\s*({'|'.join(COMPASS)})\s*[/-]\s*({'|'.join(COMPASS)})\s*")
_HELICOPTERS = re.compile(r"^\s*H\d|^\s*\d{1,2}[LCR]?H(?![A-Z])")


def read_designators(text: str) -> tuple[str, str] | None:
    """("06", "24") from "06/24", "6-24", "RWY 24"; the first pair of "09L/27R;09/27"; None when there is none.

    A single designator gives the other end as well, and counts only when nothing else is in the text.
    """
    plain = _plain(text).removeprefix("RUNWAY").removeprefix("RWY").strip()
    compass = _COMPASS_PAIR.fullmatch(plain)
    if compass:
        return compass[1], compass[2]
    return _pair(plain) or _listed(plain)


def named_designators(text: str) -> tuple[str, str] | None:
    """The first pair in a name such as "Runway 10/28"; None when there is none."""
    return _pair(_plain(text))


def for_helicopters(text: str) -> bool:
    """Is this the reference of a strip for helicopters: "H01/H19", "14H/32H"?"""
    return bool(_HELICOPTERS.match(_plain(text)))


def _plain(text: str) -> str:
    return re.sub("[‐‑‒–—−\\\\]", "/", text.strip().upper())


def _pair(text: str) -> tuple[str, str] | None:
    for found in _PAIR.finditer(text):
        first, second = _designator(*found.group(1, 2, 3)), _designator(*found.group(4, 5, 6))
        if first and second:
            return first, second
    return None


def _listed(text: str) -> tuple[str, str] | None:
    parts = [one for one in re.split(r"[/\-;,\s]+", text) if one][:2]
    matches = [_SINGLE.fullmatch(one) for one in parts]
    made = [_designator(*one.group(1, 2, 3)) for one in matches if one]
    if not made or len(made) != len(parts) or not all(made):
        return None
    return made[0], made[1] if len(made) > 1 else opposite_designator(made[0])


def _designator(number: str, side: str | None, letters: str) -> str:
    return f"{int(number):02d}{side or ''}{letters}" if 1 <= int(number) <= 36 else ""


def opposite_designator(designator: str) -> str:
    """The other end's name: "06L" gives "24R", "09T" gives "27T", "NE" gives "SW"."""
    if designator in COMPASS:
        return COMPASS[(COMPASS.index(designator) + 8) % 16]
    number = (int(designator[:2]) + 17) % 36 + 1
    return f"{number:02d}{designator[2:].translate(str.maketrans('LR', 'RL'))}"


def are_opposite(designators: tuple[str, str]) -> bool:
    """Do they name both ends of one runway? The letters may disagree: what is published is sometimes so."""
    first, second = (re.sub(r"(?<=\d)[A-Z]+$", "", one) for one in designators)
    return opposite_designator(first) == second


def sorted_ends(designators: tuple[str, str]) -> tuple[str, str]:
    """Both, the lower number first."""
    low, high = sorted(designators, key=lambda one: (direction_of(one), one))
    return low, high


def runway_id(designators: tuple[str, str]) -> str:
    """Both designators, the lower first."""
    return "/".join(sorted_ends(designators))


def numbers_and_sides(designators: tuple[str, str]) -> tuple[str, ...]:
    """Without the letters that are no side: what holding positions say of a runway whose letters they leave out."""
    return tuple(re.sub(r"^(\d\d[LCR]?).*", r"\1", one) for one in sorted_ends(designators))


def direction_of(designator: str) -> float:
    """Degrees of a landing on this end, from the north that the designator counts from."""
    if designator in COMPASS:
        return 22.5 * COMPASS.index(designator)
    return 10.0 * int(designator[:2])


def misfit(heading: float, designator: str, latitude: float, longitude: float) -> float:
    """Degrees between a heading (rad from true north) and the designator, 0 to 180.

    latitude, longitude: degrees, of the airport; grid north is so many degrees off true north as its longitude.
    """
    expected = direction_of(designator) - (longitude if latitude < GRID_NORTH_SOUTH_OF else 0.0)
    difference = (math.degrees(heading) - expected) % 360.0
    return min(difference, 360.0 - difference)

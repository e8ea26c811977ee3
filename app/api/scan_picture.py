"""Radar video as a north-up picture: nearest-cell scan conversion through a table made once a radar and size."""

from __future__ import annotations

import io
import threading
from collections import OrderedDict
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from app.contract import Video
from pipeline.sites import RadarSite

PALETTES: dict[str, tuple[tuple[int, int, int], tuple[int, int, int]]] = {
    "green": ((0, 40, 10), (150, 255, 170)),
    "amber": ((60, 30, 0), (255, 210, 110)),
    "blue": ((0, 20, 60), (170, 215, 255)),
    "grey": ((40, 40, 40), (255, 255, 255)),
}
"""Colours of the weakest and the strongest echo."""

ABOVE_NOISE_DB = 9.0
"""Decibels above the median amplitude at which echoes become visible when no floor is asked for."""

TABLES = 8
PICTURES = 32


def half_width(site: RadarSite) -> float:
    """Metres from the radar to each edge of its picture: the far edge of the last range cell."""
    return site.video.first_range_m + (site.video.ranges - 0.5) * site.video.range_step_m


def index_table(site: RadarSite, size: int, pool: int) -> NDArray[np.int32]:
    """(size, size) flat index of the nearest cell of the (azimuths, ranges // pool) video; its size for outside.

    Row 0 is the northern edge. pool: range cells that were joined into one before the look-up.
    """
    video = site.video
    half = half_width(site)
    centres = (np.arange(size) + 0.5) * (2 * half / size) - half
    east, north = np.meshgrid(centres, centres[::-1])
    azimuth = np.mod(np.arctan2(east, north), 2 * np.pi)
    row = np.round(azimuth / video.azimuth_step_rad - 0.5).astype(np.int64) % video.azimuths
    cells = video.ranges // pool
    cell = np.round(
        (np.hypot(east, north) - video.first_range_m) / (video.range_step_m * pool) - 0.5 * (pool - 1) / pool
    )
    inside = (cell >= 0) & (cell < cells)
    return np.where(inside, row * cells + cell.astype(np.int64), video.azimuths * cells).astype(np.int32)


class ScanPictures:
    """Renders PNGs and keeps the newest of each kind, so that many viewers cost one rendering. For any thread."""

    def __init__(self) -> None:
        self._tables: OrderedDict[Any, NDArray[np.int32]] = OrderedDict()
        self._pictures: OrderedDict[Any, tuple[float, bytes]] = OrderedDict()
        self._lock = threading.Lock()

    def png(self, video: Video, size: int, palette: str, floor: int | None) -> bytes:
        """The picture of a turn as PNG with a palette; cells below the floor are transparent."""
        key = (video.site.id, size, palette, floor)
        with self._lock:
            kept = self._pictures.get(key)
            if kept is not None and kept[0] == video.time:
                return kept[1]
            made = self._render(video, size, palette, floor)
            _keep(self._pictures, key, (video.time, made), PICTURES)
            return made

    def _render(self, video: Video, size: int, palette: str, floor: int | None) -> bytes:
        site = video.site
        pool = max(1, int(2 * half_width(site) / size / site.video.range_step_m))
        key = (site.id, size, site.video, pool)
        table = self._tables.get(key)
        if table is None:
            table = index_table(site, size, pool)
            _keep(self._tables, key, table, TABLES)
        cells = site.video.ranges // pool
        amplitude = video.amplitude[:, : cells * pool].reshape(len(video.amplitude), cells, pool).max(axis=2)
        flat = np.append(amplitude.ravel(), np.uint8(0))
        if floor is None:
            noise = float(np.median(amplitude[::16, ::4]))
            floor = min(254, int(noise + ABOVE_NOISE_DB / site.video.db_per_step))
        image = Image.fromarray(flat[table])
        image.putpalette(_palette(palette, floor))
        opacity = np.clip((np.arange(256) - floor) * 3 + 60, 0, 255)
        opacity[: floor + 1] = 0
        opacity[0] = 0
        file = io.BytesIO()
        image.save(file, "PNG", transparency=opacity.astype(np.uint8).tobytes(), compress_level=1)
        return file.getvalue()


def _palette(name: str, floor: int) -> bytes:
    weak, strong = np.array(PALETTES[name], dtype=np.float64)
    share = np.clip((np.arange(256) - floor) / max(255 - floor, 1) * 1.6, 0, 1)[:, None]
    return bytes(np.round(weak + (strong - weak) * share).astype(np.uint8).tobytes())


def _keep(kept: OrderedDict[Any, Any], key: Any, value: Any, limit: int) -> None:
    kept[key] = value
    kept.move_to_end(key)
    while len(kept) > limit:
        kept.popitem(last=False)

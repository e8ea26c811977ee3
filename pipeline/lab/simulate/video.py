"""Radar video: what the receiver of a surface movement radar would put out, sweep by sweep."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from pipeline.airport.model import Airport
from pipeline.kernels.compiled import allocating
from pipeline.lab.simulate.clutter import FINE, ClutterMap, PowerLaw, build_clutter, quantiles
from pipeline.lab.simulate.paths import Truth
from pipeline.lab.simulate.rain import RainCell, rain_power
from pipeline.lab.simulate.scatter import catalogue
from pipeline.sites import RadarSite

SECTORS = 64
"""The truth is looked up once for each of these equal parts of a turn, whatever block is asked for."""

_GROUP = 16
"""Sweeps that share one look at the rain."""


class VideoSimulator:
    """Makes the video of one radar from a truth. The same seed, scan and rows give the same video, however it is split.

    site: the radar; its video format says the grid. surface: (azimuths, ranges) SurfaceKind as the radar sees it; made
    from the airport when it is not given. start: UTC s at which row 0 of scan 0 begins. swerling: 0, 1 or 3, the
    fluctuation of each scattering centre from scan to scan. noise_step: mean thermal noise in amplitude steps.
    shadow_loss: dB. pulse_cells: length of the pulse (between its half-power points) in range cells.
    Raises ValueError when the surface does not fit or swerling is another number.
    """

    def __init__(
        self,
        airport: Airport,
        site: RadarSite,
        seed: int,
        *,
        start: float = 0.0,
        surface: NDArray[np.uint8] | None = None,
        law: PowerLaw | None = None,
        noise_step: float = 80.0,
        shadow_loss: float = 18.0,
        pulse_cells: float = 1.3,
        swerling: int = 3,
        rain: tuple[RainCell, ...] = (),
    ) -> None:
        if swerling not in (0, 1, 3):
            raise ValueError(f"swerling must be 0, 1 or 3, not {swerling}")
        if surface is None:
            from pipeline.airport.surfaces import surface_of_radar

            surface = surface_of_radar(airport, site)
        self.site, self.seed, self.start = site, seed, start
        self._law = law or PowerLaw()
        self._noise_step, self._shadow_loss = noise_step, shadow_loss
        self.clutter: ClutterMap = build_clutter(airport, site, surface, seed, self._law, noise_step, shadow_loss)
        unit = FINE / (site.video.db_per_step * 1e6)
        main, tail = quantiles()
        self._main = np.round(main * unit).astype(np.int16)
        self._tail = np.round(tail * unit).astype(np.int16)
        levels = np.arange(-64 * FINE, 320 * FINE)
        # powers over noise of fine levels, offset so that index 0 is level -64 steps
        self._power = (10 ** ((levels / FINE - noise_step) * site.video.db_per_step / 10)).astype(np.float32)
        self._pulse_cells, self._swerling, self._rain = pulse_cells, swerling, rain
        rows = -(-site.video.azimuths // SECTORS)
        self._echo = np.zeros((rows, site.video.ranges, 2), np.float32)
        self._bounds = np.zeros((rows, 2), np.int32)
        self._fine = np.zeros(site.video.ranges, np.int32)
        cells = np.arange(site.video.ranges, dtype=np.float64)
        self._slant = site.video.first_range_m + cells * site.video.range_step_m

    def time(self, scan: int, row: float) -> float:
        """UTC s at which the centre of `row` of `scan` is swept."""
        return self.start + (scan + (row + 0.5) / self.site.video.azimuths) * self.site.video.period_s

    def sweeps(self, scan: int, row_from: int, row_to: int, truth_at: Callable[[float], Truth]) -> NDArray[np.uint8]:
        """(row_to - row_from, ranges) uint8 log amplitude of the rows from `row_from` until before `row_to`.

        truth_at: gives the truth at a UTC time; asked once for each 1/64 turn touched. Not for two threads at once.
        Raises ValueError when the rows do not lie in one turn.
        """
        video = self.site.video
        if not 0 <= row_from <= row_to <= video.azimuths:
            raise ValueError(f"rows {row_from} to {row_to} are not in a turn of {video.azimuths}")
        out = np.empty((row_to - row_from, video.ranges), np.uint8)
        height = len(self._echo)
        for first in range(row_from // height * height, row_to, height):
            last = min(first + height, video.azimuths)
            truth = truth_at(self.time(scan, (first + last) / 2 - 0.5))
            self._illuminate(scan, first, last, truth)
            begin, end = max(first, row_from), min(last, row_to)
            self._render(scan, first, begin, end, out[begin - row_from : end - row_from])
        return out

    def _illuminate(self, scan: int, first: int, last: int, truth: Truth) -> None:
        """Sum the echoes of all targets over the rows of a sector."""
        video = self.site.video
        models, first_centre = catalogue()
        self._bounds[:, 0], self._bounds[:, 1] = video.ranges, 0
        geometry = np.array(
            [
                self.site.east, self.site.north, self.site.height, video.first_range_m, video.range_step_m,
                video.azimuth_step_rad, video.beamwidth_rad / video.azimuth_step_rad, self._pulse_cells,
                10 ** (self._law.reference / 10), self._law.exponent, self._law.nearest,
                10 ** (-self._shadow_loss / 10),
            ]
        )  # fmt: skip
        _illuminate(
            truth.id, truth.east, truth.north, truth.altitude, truth.heading, truth.type, truth.length, truth.width,
            models, first_centre, geometry, video.azimuths, first, last - first, self.clutter.slope,
            np.uint64(self.seed), np.uint64(scan), self._swerling, self._echo, self._bounds,
        )  # fmt: skip

    def _render(self, scan: int, first: int, begin: int, end: int, out: NDArray[np.uint8]) -> None:
        raining = len(self._rain) > 0
        rain = np.zeros((1, self.site.video.ranges), np.float32)
        step = _GROUP if raining else max(end - begin, 1)
        at = begin
        while at < end:
            until = min(end, at // step * step + step) if raining else end
            if raining:
                middle = at // step * step + step / 2
                azimuth = middle * self.site.video.azimuth_step_rad
                rain[0] = rain_power(self._rain, self.site, self.time(scan, middle), azimuth, self._slant)
            _render(
                self.clutter.code[at:until], self._echo[at - first : until - first],
                self._bounds[at - first : until - first], rain[0], raining, self._main, self._tail, self._power,
                FINE / self.site.video.db_per_step, self._noise_step * FINE, np.uint64(self.seed), np.uint64(scan), at,
                self._fine, out[at - begin : until - begin],
            )  # fmt: skip
            at = until


@allocating
def _mix(x):  # type: ignore[no-untyped-def]
    """The finaliser of splitmix64: 64 well-mixed bits."""
    x = (x ^ (x >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    x = (x ^ (x >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return x ^ (x >> np.uint64(31))


@allocating
def _key(seed, scan, what):  # type: ignore[no-untyped-def]
    mixed = _mix(seed * np.uint64(0x9E3779B97F4A7C15) + scan)
    return _mix(mixed + what * np.uint64(0xD1342543DE82EF95) + np.uint64(1))


@allocating
def _unit(x):  # type: ignore[no-untyped-def]
    """A number in (0, 1) from 64 bits."""
    return (np.float64(x >> np.uint64(12)) + 0.5) * (1.0 / 4503599627370496.0)


@allocating
def _illuminate(  # type: ignore[no-untyped-def]
    ids, east, north, altitude, heading, kind, length, width, models, first_centre, geometry, azimuths, first_row,
    rows, slope, seed, scan, swerling, echo, bounds,
):  # fmt: skip
    site_east, site_north, antenna = geometry[0], geometry[1], geometry[2]
    first_range, range_step, azimuth_step = geometry[3], geometry[4], geometry[5]
    beam, pulse = geometry[6], geometry[7]
    reference, exponent, nearest, shadow = geometry[8], geometry[9], geometry[10], geometry[11]
    ranges = echo.shape[1]
    reach_rows = int(np.ceil(2.1 * beam))
    reach_cells = int(np.ceil(2.1 * pulse))
    for i in range(rows):
        row = echo[i]
        for j in range(ranges):
            row[j, 0] = 0.0
            row[j, 1] = 0.0
    middle = first_row + 0.5 * rows
    for t in range(len(ids)):
        x, y = east[t] - site_east, north[t] - site_north
        ground = np.sqrt(x * x + y * y)
        size = 0.5 * np.sqrt(length[t] * length[t] + width[t] * width[t]) + 1.0
        if ground - size > first_range + ranges * range_step:
            continue
        if ground > size:
            half = np.arctan2(size, ground) / azimuth_step + reach_rows + 0.5 * rows
            off = np.arctan2(x, y) / azimuth_step - middle
            off -= azimuths * np.floor(off / azimuths + 0.5)
            if abs(off) > half:
                continue
        sine, cosine = np.sin(heading[t]), np.cos(heading[t])
        key = _key(seed ^ np.uint64(0x5851F42D4C957F2D), scan, np.uint64(ids[t]))
        look = np.arctan2(-x, -y) - heading[t]
        for c in range(first_centre[kind[t]], first_centre[kind[t] + 1]):
            forward, right, up = models[c, 0], models[c, 1], models[c, 2]
            px = x + forward * sine + right * cosine
            py = y + forward * cosine - right * sine
            pz = up + altitude[t] - antenna
            flat = np.sqrt(px * px + py * py)
            slant = np.sqrt(flat * flat + pz * pz)
            row_at = np.arctan2(px, py) / azimuth_step - 0.5 - first_row
            row_at -= azimuths * np.floor((row_at - 0.5 * rows) / azimuths + 0.5)
            cell_at = (slant - first_range) / range_step
            top = int(np.ceil(row_at - reach_rows))
            bottom = int(np.floor(row_at + reach_rows))
            near = int(np.ceil(cell_at - reach_cells))
            far = int(np.floor(cell_at + reach_cells))
            if bottom < 0 or top >= rows or far < 0 or near >= ranges:
                continue
            power = reference * models[c, 3] * (max(slant, nearest) / 1000.0) ** (-exponent)
            narrow = models[c, 5]
            if narrow > 0.0:
                facing = max(np.cos(look - models[c, 4]), 0.0)
                power *= 0.06 + 0.94 * facing**narrow
            shade_row = (int(np.floor(row_at + 0.5)) + first_row) % azimuths
            shade_cell = min(max(int(cell_at), 0), ranges - 1)
            if pz / max(flat, 1.0) * 16384.0 < slope[np.uintp(shade_row), np.uintp(shade_cell)]:
                power *= shadow
            lift = pz / max(flat, 1.0)
            if lift > 0.03:
                # the beam looks down: what flies well above the horizon is seen by its edge only
                power *= max(10.0 ** (-25.0 * (lift - 0.03) / 0.1), 1e-5)
            draw = _mix(key + np.uint64(c - first_centre[kind[t]]) * np.uint64(0x9E3779B97F4A7C15))
            if swerling == 1:
                power *= -np.log(_unit(_mix(draw + np.uint64(3))))
            elif swerling == 3:
                power *= -0.5 * np.log(_unit(_mix(draw + np.uint64(3))) * _unit(_mix(draw + np.uint64(5))))
            amplitude = np.sqrt(power)
            phase = 2.0 * np.pi * _unit(draw)
            re, im = amplitude * np.cos(phase), amplitude * np.sin(phase)
            top, bottom = max(top, 0), min(bottom, rows - 1)
            near, far = max(near, 0), min(far, ranges - 1)
            for i in range(top, bottom + 1):
                a = (i - row_at) / beam
                in_beam = np.exp(-1.3862943611 * a * a)
                row = echo[i]
                bounds[i, 0] = min(bounds[i, 0], near)
                bounds[i, 1] = max(bounds[i, 1], far + 1)
                for j in range(near, far + 1):
                    b = (j - cell_at) / pulse
                    gain = in_beam * np.exp(-1.3862943611 * b * b)
                    row[np.uintp(j), 0] += np.float32(gain * re)
                    row[np.uintp(j), 1] += np.float32(gain * im)


@allocating
def _render(  # type: ignore[no-untyped-def]
    code, echo, bounds, rain, raining, main, tail, power_of, fine_per_db, noise_fine, seed, scan, first_row, fine, out
):
    rows, ranges = out.shape
    main_flat = main.ravel()
    for i in range(rows):
        state = _key(seed, scan, np.uint64(first_row + i)) | np.uint64(1)
        codes, result = code[i], out[i]
        bits = np.uint64(0)
        for j in range(ranges):
            if j & 3 == 0:
                state ^= state << np.uint64(13)
                state ^= state >> np.uint64(7)
                state ^= state << np.uint64(17)
                bits = state * np.uint64(0x2545F4914F6CDD1D)
            else:
                bits >>= np.uint64(16)
            u = np.uintp((bits >> np.uint64(4)) & np.uint64(0xFFF))
            packed = np.uintp(codes[j])
            level = np.int32(packed & np.uintp(0xFFF))
            family = packed >> np.uintp(12)
            if raining and rain[j] > 0.05:
                of_ground = power_of[level + 1024]
                level = np.int32(noise_fine + 10.0 * fine_per_db * np.log10(of_ground + rain[j]))
                if rain[j] > of_ground:
                    family = np.uintp(0)
            if u == np.uintp(4095):
                v = np.uintp(_mix(state + np.uint64(j)) & np.uint64(0xFFFF))
                fine[j] = level + tail[family, v]
            else:
                fine[j] = level + main_flat[family * np.uintp(4096) + u]
        for j in range(bounds[i, 0], bounds[i, 1]):
            k = np.uintp(j)
            re, im = echo[i, k, 0], echo[i, k, 1]
            signal = re * re + im * im
            if signal > 0.02:
                at = min(max(fine[k] + 1024, 0), len(power_of) - 1)
                background = power_of[np.uintp(at)]
                phase = 2.0 * np.pi * _unit(_mix(state + np.uint64(j) * np.uint64(0x9E3779B97F4A7C15)))
                total = background + signal + 2.0 * np.sqrt(background * signal) * np.cos(phase)
                fine[k] = np.int32(noise_fine + 10.0 * fine_per_db * np.log10(max(total, 1e-7)))
        for j in range(ranges):
            result[j] = np.uint8(min(max((fine[j] + 8) >> 4, 0), 255))

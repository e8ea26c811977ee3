"""Where recorded radar video is sent, and as whose."""

from __future__ import annotations

from dataclasses import dataclass
from urllib.parse import urlsplit

from app.ingest.recording import Recording
from app.settings import RadarSettings, Settings, SettingsError

USUAL = ("127.0.0.1", 8600)
"""Where video goes when nothing is set: the port that a service takes by default."""

USUAL_SOURCE = (0, 1)
"""SAC and SIC of video that has none: SAC 0 is local to the airport."""


@dataclass(frozen=True, slots=True)
class Destination:
    """An address, and the radar of the settings that listens there; None when none is known."""

    address: tuple[str, int]
    radar: RadarSettings | None

    @property
    def interface(self) -> str:
        """Address of the interface by which a multicast group is sent to."""
        return "0.0.0.0" if self.radar is None or self.radar.udp is None else self.radar.udp.interface

    @property
    def source(self) -> tuple[int | None, int | None]:
        """SAC and SIC that the radar is set to; None takes any."""
        return (
            (None, None) if self.radar is None or self.radar.udp is None else (self.radar.udp.sac, self.radar.udp.sic)
        )

    def must_fit(self, recording: Recording) -> None:
        """Raises SettingsError when the radar would refuse the recording."""
        video, radar = recording.site.video, self.radar
        if radar is None:
            return
        same_step = abs(video.range_step_m / radar.range_step_m - 1) * video.ranges <= 0.5
        same_cells = radar.resample or (video.ranges == radar.ranges and same_step)
        if video.azimuths != radar.azimuths or not same_cells:
            raise SettingsError(
                f"radar {radar.id} is set to {radar.azimuths} azimuths of {radar.ranges} cells of "
                f"{radar.range_step_m:g} m and would refuse this recording: set azimuths = {video.azimuths}, "
                f"ranges = {video.ranges}, range_step_m = {video.range_step_m:.6g}, "
                f"first_range_m = {video.first_range_m:.6g}, period_s = {video.period_s:.4g}, "
                f"or send it elsewhere with --to"
            )


def find_destination(settings: Settings, radar: str | None, to: str | None) -> Destination:
    """The radar called so, or the first, and its own port on this machine, or `to`. Raises SettingsError."""
    names = {one.id: one for one in settings.radars}
    if radar is not None and radar not in names:
        raise SettingsError(f"no radar is called {radar!r}; there are: {', '.join(names) or 'none'}")
    chosen = names[radar] if radar is not None else next(iter(names.values()), None)
    if to is not None:
        return Destination(_address(to), chosen)
    if chosen is None:
        return Destination(USUAL, None)
    if chosen.udp is None or chosen.udp.port == 0:
        raise SettingsError(f"radar {chosen.id} has no fixed UDP port; say where to send with --to")
    host = chosen.udp.group or chosen.udp.address or settings.udp_address
    return Destination(("127.0.0.1" if host in ("0.0.0.0", "::") else host, chosen.udp.port), chosen)


def source_to_send(
    recording: Recording, to: Destination, asked: tuple[int | None, int | None], rewrite: bool, must_fit: bool
) -> tuple[int, int]:
    """SAC and SIC that a recording is sent with: its own; what is asked for, or what the radar is set to, where it has
    none; with `rewrite` always what the radar is set to.

    must_fit: raises SettingsError when the radar would refuse it. Raises SettingsError, too, when `rewrite` is asked
    for and nothing is set.
    """
    wanted = to.source
    if rewrite and wanted == (None, None):
        raise SettingsError("--rewrite-source: no radar with sac or sic in its udp settings is chosen")
    own = recording.source
    if own is None:
        own = _filled(asked, _filled(wanted, USUAL_SOURCE))
    sent = _filled(wanted, own) if rewrite else own
    if must_fit and sent != _filled(wanted, sent) and to.radar is not None:
        set_to = " ".join(f"{name} {one}" for name, one in zip(("SAC", "SIC"), wanted, strict=True) if one is not None)
        raise SettingsError(
            f"radar {to.radar.id} takes only {set_to} and would refuse this recording of SAC {sent[0]} SIC {sent[1]}: "
            "send it with --rewrite-source, set sac and sic of the radar, or send it elsewhere with --to"
        )
    return sent


def _filled(source: tuple[int | None, int | None], other: tuple[int, int]) -> tuple[int, int]:
    sac, sic = source
    return (other[0] if sac is None else sac, other[1] if sic is None else sic)


def _address(to: str) -> tuple[str, int]:
    parts = urlsplit(to)
    try:
        if parts.scheme == "udp" and parts.hostname and parts.port:
            return parts.hostname, parts.port
    except ValueError:
        pass
    raise SettingsError(f"--to {to}: must look like udp://127.0.0.1:8600")

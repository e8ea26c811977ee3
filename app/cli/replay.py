"""`airside replay`: send a recording of radar video to a running service, or replay a journal."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from rich.console import Console

    from app.ingest.recording import Recording
    from app.settings import RadarSettings, Settings


File = Annotated[
    Path,
    typer.Argument(
        help="A journal (.mcap, or the folder of one), or radar video: .npz (scans, t), a folder of polar PNGs with a"
        " YAML, pcap, pcapng or bare ASTERIX blocks under any name, also gzipped."
    ),
]
Headless = Annotated[
    bool, typer.Option("--headless", help="Serve and send nothing: print what the engine or the detector makes of it.")
]
Speed = Annotated[float, typer.Option(min=0.01, max=1000, help="Times the recorded pace; on the displays 0.1 to 64.")]
Verify = Annotated[
    bool, typer.Option("--verify", help="Journal, with --headless: compare every bit with what was recorded.")
]
From = Annotated[
    str | None,
    typer.Option(
        "--from",
        metavar="T",
        help="Journal: not before this time: ISO 8601, epoch seconds, or +90: 90 s after its first record.",
    ),
]
Until = Annotated[
    str | None, typer.Option("--until", metavar="T", help="Journal: not after this time, in the same forms.")
]
Change = Annotated[
    list[str] | None,
    typer.Option(
        "--set", metavar="KEY=VALUE", help="Journal: run with another setting, such as parts.lifecycle=m_of_n."
    ),
]
JsonFile = Annotated[
    Path | None, typer.Option("--json", metavar="FILE", help="Journal, with --headless: write what is found as JSON.")
]
HttpPort = Annotated[
    int,
    typer.Option("--http-port", envvar="AIRSIDE_PORT", min=0, max=65535, help="Journal: port of the displays."),
]
Radar = Annotated[str | None, typer.Option(help="Video: the radar of the settings that it is sent as; else the first.")]
To = Annotated[str | None, typer.Option(help="Video: udp://host:port; else the radar's own port on this machine.")]
Loop = Annotated[bool, typer.Option("--loop", help="Video: begin again at the end.")]
Port = Annotated[int | None, typer.Option(min=1, max=65535, help="Video: take only this UDP port of a capture.")]
SettingsFile = Annotated[
    Path | None, typer.Option("--settings", "-s", envvar="AIRSIDE_SETTINGS", help="Video: settings of the service.")
]


def register(app: typer.Typer) -> None:
    """Add the command."""
    app.command()(replay)


def replay(
    file: File,
    headless: Headless = False,
    speed: Speed = 1.0,
    verify: Verify = False,
    begin: From = None,
    until: Until = None,
    change: Change = None,
    json: JsonFile = None,
    http_port: HttpPort = 8000,
    radar: Radar = None,
    to: To = None,
    loop: Loop = False,
    port: Port = None,
    settings: SettingsFile = None,
) -> None:
    """Replay a journal, or send recorded radar video to a running service.

    [bold]airside replay day.mcap[/bold] serves the displays with the picture of that day, to play, pause and seek;
    [bold]airside replay day.mcap --headless --verify[/bold] proves that the same inputs give the same bits;
    [bold]airside replay day.mcap --headless --set parts.lifecycle=m_of_n[/bold] says what would have been different.

    Radar video is sent as ASTERIX CAT240, as if the radar were turning now:
    [bold]airside replay turns.npz[/bold] sends to the first radar of the settings on this machine;
    [bold]airside replay turns.pcap --to udp://239.1.2.3:8600[/bold] to wherever you say;
    [bold]airside replay turns.npz --headless[/bold] prints what the detector makes of it.
    """
    from rich.console import Console

    from app.console import fail
    from app.replay.command import is_journal

    console = Console()
    asked = verify or begin or until or change or json
    if is_journal(file) or (asked and file.is_dir()):
        changes = tuple(change or ())
        _replay_journal(console, file, speed, headless, verify, (begin, until), changes, json, http_port)
    elif asked:
        raise fail(f"{file}: --verify, --from, --until, --set and --json are for journals (.mcap)")
    else:
        _replay_video(console, file, speed, headless, (radar, to), loop, port, settings)


def _replay_video(
    console: Console,
    file: Path,
    speed: float,
    headless: bool,
    destination: tuple[str | None, str | None],
    loop: bool,
    port: int | None,
    settings: Path | None,
) -> None:
    from app.console import fail
    from app.contract import Refused
    from app.ingest.recordings import open_recording
    from app.settings import SettingsError, load

    try:
        recording = open_recording(file, port=port)
        _describe(console, recording)
        loaded = load(settings)
        if headless:
            _print_plots(console, recording, loaded)
            return
        radar, to = destination
        address, chosen = _destination(loaded, radar, to)
        if chosen is not None and to is None:
            _must_fit(recording, chosen)
        interface = chosen.udp.interface if chosen is not None and chosen.udp is not None else "0.0.0.0"
        _send(console, recording, address, interface, speed, loop)
    except (Refused, SettingsError, OSError) as error:
        raise fail(str(error)) from error
    except KeyboardInterrupt:
        raise typer.Exit(130) from None


def _replay_journal(
    console: Console,
    path: Path,
    speed: float,
    headless: bool,
    verify: bool,
    times: tuple[str | None, str | None],
    change: tuple[str, ...],
    json: Path | None,
    port: int,
) -> None:
    from app.console import fail
    from app.contract import Refused
    from app.journal.names import JournalError
    from app.replay.command import JournalReplay
    from app.settings import SettingsError

    try:
        if json is not None:
            if not headless:
                raise SettingsError("--json goes with --headless")
            _check(json)
        work = JournalReplay(console, path, times, change, json)
        if verify and (change or not headless):
            raise SettingsError("--verify goes with --headless, and not with --set")
        if verify:
            status = work.verify()
        elif headless:
            status = work.compare()
        else:
            status = work.serve(port, speed)
    except (JournalError, Refused, SettingsError, OSError) as error:
        raise fail(str(error)) from error
    except KeyboardInterrupt:
        raise typer.Exit(130) from None
    raise typer.Exit(status)


def _check(json: Path) -> None:
    from app.output_files import check_writable
    from app.settings import SettingsError

    try:
        check_writable(json)
    except ValueError as error:
        raise SettingsError(str(error)) from error


def _describe(console: Console, recording: Recording) -> None:
    video = recording.site.video
    turns = "" if recording.scans is None else f"{recording.scans} turns, "
    console.print(
        f"{recording.path}: {turns}{video.azimuths} azimuths of {video.ranges} cells of {video.range_step_m:.3g} m, "
        f"a turn in {video.period_s:.3g} s",
        highlight=False,
        markup=False,
    )
    for note in recording.notes:
        console.print(note, style="yellow", highlight=False, markup=False)


def _destination(settings: Settings, radar: str | None, to: str | None) -> tuple[tuple[str, int], RadarSettings | None]:
    from urllib.parse import urlsplit

    from app.settings import SettingsError

    names = {one.id: one for one in settings.radars}
    if radar is not None and radar not in names:
        raise SettingsError(f"no radar is called {radar!r}; there are: {', '.join(names) or 'none'}")
    chosen = names[radar] if radar is not None else next(iter(names.values()), None)
    if to is not None:
        parts = urlsplit(to)
        try:
            if parts.scheme == "udp" and parts.hostname and parts.port:
                return (parts.hostname, parts.port), chosen
        except ValueError:
            pass
        raise SettingsError(f"--to {to}: must look like udp://127.0.0.1:8600")
    if chosen is None:
        return ("127.0.0.1", 8600), None
    if chosen.udp is None or chosen.udp.port == 0:
        raise SettingsError(f"radar {chosen.id} has no fixed UDP port; say where to send with --to")
    host = chosen.udp.group or chosen.udp.address
    return ("127.0.0.1" if host in ("0.0.0.0", "::") else host, chosen.udp.port), chosen


def _must_fit(recording: Recording, radar: RadarSettings) -> None:
    from app.settings import SettingsError

    video = recording.site.video
    fits = (video.azimuths, video.ranges) == (radar.azimuths, radar.ranges)
    if not fits or abs(video.range_step_m / radar.range_step_m - 1) * video.ranges > 0.5:
        raise SettingsError(
            f"radar {radar.id} is set to {radar.azimuths} azimuths of {radar.ranges} cells of {radar.range_step_m:g} m "
            f"and would refuse this recording: set azimuths = {video.azimuths}, ranges = {video.ranges}, "
            f"range_step_m = {video.range_step_m:.6g}, first_range_m = {video.first_range_m:.6g}, "
            f"period_s = {video.period_s:.4g}, or send it elsewhere with --to"
        )


def _progress(console: Console) -> Any:
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    columns = (
        TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TextColumn("turns"), TimeElapsedColumn(),
        TimeRemainingColumn(),
    )  # fmt: skip
    return Progress(*columns, console=console)


def _send(
    console: Console, recording: Recording, address: tuple[str, int], interface: str, speed: float, loop: bool
) -> None:
    from app.ingest.replay import Replayer

    replayer = Replayer(recording, address, speed, interface=interface)
    with _progress(console) as progress:
        total = None if loop else recording.scans
        task = progress.add_task(f"to udp://{address[0]}:{address[1]}", total=total)
        replayer.run(lambda block: progress.advance(task, 1.0 if block.last else 0.0), loop)
    console.print(f"{replayer.sent} datagrams sent", highlight=False)
    if replayer.refused:
        console.print(f"[yellow]{replayer.refused} found nobody listening at that port[/yellow]")
    _left_out(console, recording)


def _left_out(console: Console, recording: Recording) -> None:
    plain = ("packets", "taken", "sweeps", "scans", "summary", "fragments", "blocks")
    left = {name: count for name, count in recording.counters.items() if count and name not in plain}
    if left:
        console.print(f"[yellow]left out: {', '.join(f'{name} {count}' for name, count in left.items())}[/yellow]")


def _print_plots(console: Console, recording: Recording, settings: Settings) -> None:
    from app.assembly import radar_chain
    from pipeline.tables import Plots, SectorPlots

    chain = radar_chain(recording.site, 0, settings, None)
    turn: list[Plots] = []

    def show(scan: int, time: float) -> None:
        plots = Plots.concatenate(turn)
        turn.clear()
        strong = plots[plots.peak_amplitude.argsort()[::-1][:5]] if len(plots) else plots
        told = "  ".join(
            f"({one.east[0]:.0f}, {one.north[0]:.0f}) m" for one in (strong[i] for i in range(len(strong)))
        )
        console.print(f"turn {scan:5d}  {time:.2f}  {len(plots):4d} plots  {told}", highlight=False)

    scan, time = 0, float("nan")
    for block in recording.blocks():
        if block.scan != scan and turn:
            show(scan, time)
        sector: SectorPlots = chain.process(block)
        scan, time = block.scan, float(block.time[-1])
        turn.append(sector.plots)
    turn.append(chain.flush().plots)
    show(scan, time)
    _left_out(console, recording)

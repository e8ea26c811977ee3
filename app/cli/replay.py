"""`airside replay`: send a recording of radar video to a running service, or replay a journal."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from rich.console import Console

    from app.ingest.recording import Recording
    from app.replay.destination import Destination


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
Loop = Annotated[bool, typer.Option("--loop", help="Video: begin again at the end, until interrupted.")]
Port = Annotated[int | None, typer.Option(min=1, max=65535, help="Video: take only this UDP port of a capture.")]
Sac = Annotated[
    int | None,
    typer.Option(min=0, max=255, help="Video: take only this SAC of a capture; what else has none is sent with it."),
]
Sic = Annotated[int | None, typer.Option(min=0, max=255, help="Video: the same for the SIC.")]
Rewrite = Annotated[
    bool,
    typer.Option(
        "--rewrite-source", help="Video: send it with the SAC and SIC that the radar is set to, not with its own."
    ),
]
Resample = Annotated[
    bool,
    typer.Option("--resample", help="Video: convert cells of other lengths in a capture instead of leaving them out."),
]
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
    sac: Sac = None,
    sic: Sic = None,
    rewrite_source: Rewrite = False,
    resample: Resample = False,
    settings: SettingsFile = None,
) -> None:
    """Replay a journal, or send recorded radar video to a running service.

    [bold]airside replay day.mcap[/bold] serves the displays with the picture of that day, to play, pause and seek;
    [bold]airside replay day.mcap --headless --verify[/bold] proves that the same inputs give the same bits;
    [bold]airside replay day.mcap --headless --set parts.lifecycle=m_of_n[/bold] says what would have been different.

    Radar video is sent as ASTERIX CAT240, as if the radar were turning now:
    [bold]airside replay turns.npz[/bold] sends to the first radar of the settings on this machine;
    [bold]airside replay turns.pcap --to udp://239.1.2.3:8600[/bold] to wherever you say;
    [bold]airside replay turns.npz --headless --loop[/bold] prints what the detector makes of it, once it has learned.
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
        wanted = (port, sac, sic, resample)
        _replay_video(console, file, speed, headless, (radar, to), loop, wanted, rewrite_source, settings)


def _replay_video(
    console: Console,
    file: Path,
    speed: float,
    headless: bool,
    destination: tuple[str | None, str | None],
    loop: bool,
    wanted: tuple[int | None, int | None, int | None, bool],
    rewrite: bool,
    settings: Path | None,
) -> None:
    from app.console import fail
    from app.contract import Refused
    from app.ingest.recordings import open_recording
    from app.replay.destination import find_destination, source_to_send
    from app.replay.plots import print_plots
    from app.settings import SettingsError, load

    port, sac, sic, resample = wanted
    try:
        recording = open_recording(file, port=port, sac=sac, sic=sic, resample=resample)
        _describe(console, recording)
        loaded = load(settings)
        if headless:
            print_plots(console, recording, loaded, loop)
            _left_out(console, recording)
            return
        radar, to = destination
        found = find_destination(loaded, radar, to)
        if to is None:
            found.must_fit(recording)
        _send(console, recording, found, source_to_send(recording, found, (sac, sic), rewrite, to is None), speed, loop)
    except (Refused, SettingsError, OSError) as error:
        raise fail(str(error)) from error


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
    console: Console, recording: Recording, to: Destination, source: tuple[int, int], speed: float, loop: bool
) -> None:
    from app.ingest.replay import Replayer

    address, (sac, sic) = to.address, source
    replayer = Replayer(recording, address, speed, sac=sac, sic=sic, interface=to.interface)
    with _progress(console) as progress:
        total = None if loop else recording.scans
        task = progress.add_task(f"to udp://{address[0]}:{address[1]}", total=total)
        replayer.run(lambda block: progress.advance(task, 1.0 if block.last else 0.0), loop)
    console.print(f"{replayer.sent} datagrams sent as SAC {sac} SIC {sic}", highlight=False)
    if replayer.refused:
        console.print(f"[yellow]{replayer.refused} found nobody listening at that port[/yellow]")
    _left_out(console, recording)


def _left_out(console: Console, recording: Recording) -> None:
    plain = ("packets", "taken", "sweeps", "scans", "summary", "fragments", "blocks")
    left = {name: count for name, count in recording.counters.items() if count and name not in plain}
    if left:
        console.print(f"[yellow]left out: {', '.join(f'{name} {count}' for name, count in left.items())}[/yellow]")

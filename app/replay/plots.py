"""What the detector makes of recorded radar video, turn by turn."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from rich.console import Console

from app.assembly import radar_chain
from app.ingest.recording import Recording
from app.settings import Settings
from pipeline.tables import Plots, Sweeps

MOST_SHOWN = 5
"""Plots of a turn whose places are printed, the strongest."""


def print_plots(console: Console, recording: Recording, settings: Settings, loop: bool) -> None:
    """Print a line for each turn; of those in which the detector only learns, how far it is.

    loop: begin again at the end, for ever. Raises RecordingError where the file turns out to be damaged.
    """
    chain = radar_chain(recording.site, 0, settings, None)
    turn: list[Plots] = []
    turns, scan, time = 0, -1, float("nan")

    def show() -> None:
        plots = Plots.concatenate(turn)
        turn.clear()
        head = f"turn {scan:5d}  {time:.2f}  "
        if turns <= chain.scans_to_learn:
            console.print(f"{head}learning, {turns} of {chain.scans_to_learn} turns", highlight=False)
        else:
            console.print(f"{head}{len(plots):4d} plots  {_places(plots)}", highlight=False)

    for block in _blocks(recording, loop):
        if block.scan != scan:
            if turns:
                show()
            turns += 1
        plots = chain.process(block).plots
        scan, time = block.scan, float(block.time[-1])
        turn.append(plots)
    turn.append(chain.flush().plots)
    show()
    if turns <= chain.scans_to_learn:
        console.print(
            f"the detector learns for {chain.scans_to_learn} turns and there were {turns}: --loop plays them again",
            highlight=False,
        )


def _places(plots: Plots) -> str:
    strong = plots[plots.peak_amplitude.argsort()[::-1][:MOST_SHOWN]] if len(plots) else plots
    return "  ".join(f"({one.east[0]:.0f}, {one.north[0]:.0f}) m" for one in (strong[i] for i in range(len(strong))))


def _blocks(recording: Recording, loop: bool) -> Iterator[Sweeps]:
    """The blocks of a recording; with `loop` for ever, turns and times going on."""
    video = recording.site.video
    scans, shift = 0, 0.0
    while True:
        begin, newest = None, None
        for block in recording.blocks():
            begin = float(block.time[0]) if begin is None else begin
            newest = block
            yield replace(block, scan=block.scan + scans, time=block.time + shift)
        if not loop or newest is None or begin is None:
            return
        scans += newest.scan + 1
        shift += float(newest.time[-1]) + video.period_s / video.azimuths - begin

"""One call of `airside evaluate`: run, show, write."""

from __future__ import annotations

import shlex
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import joblib
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from app.evaluate.choose import ALL, choose, needs_reports, needs_traffic
from app.evaluate.circumstances import Circumstances, circumstances
from app.evaluate.documents import document, markdown
from app.evaluate.recorded import name_of, recorded_video
from app.evaluate.reported import recorded_reports, shipped_reports
from app.evaluate.runs import EvaluationError, Run, carry_out, usable_backend
from app.evaluate.table import summary, told
from app.evaluate.traffic import recorded_traffic, shipped_traffic
from app.output_files import check_writable, json_text, write_whole
from pipeline.lab.evaluate import Experiment

PLAIN_WIDTH = 160
"""Characters a line where there is no terminal that says how wide it is."""


@dataclass(frozen=True)
class Options:
    """What was asked on the command line. Raises ValueError when it cannot be done."""

    name: str
    trials: int | None = None
    seed: int = 1
    jobs: int | None = None
    backend: str = "loky"
    quick: bool = False
    file: Path | None = None
    json: Path | None = None
    markdown: Path | None = None
    report: Path | None = None

    def __post_init__(self) -> None:
        usable_backend(self.backend)
        for path in (self.json, self.markdown):
            if path is not None:
                check_writable(path)
        if self.report is not None and self.report.exists() and not self.report.is_dir():
            raise ValueError(f"--report {self.report}: is a file; a folder is wanted")

    @property
    def command(self) -> str:
        """The command that gives the same figures."""
        said = ["airside", "evaluate", self.name, "--seed", str(self.seed)]
        said += ["--trials", str(self.trials)] if self.trials is not None else []
        said += ["--jobs", str(self.jobs)] if self.jobs is not None else []
        said += ["--backend", self.backend] if self.backend != "loky" else []
        said += ["--quick"] if self.quick else []
        said += ["--file", name_of(self.file)] if self.file is not None else []
        return shlex.join(said)


def usable_console() -> Console:
    """Standard output: as wide as the terminal, or wide enough for the tables where there is none."""
    console = Console(highlight=False)
    return console if console.is_terminal else Console(highlight=False, width=PLAIN_WIDTH)


def run_all(console: Console, options: Options) -> list[str]:
    """Run what was asked, show it as it comes and write it; gives the names of those that failed.

    Raises UnknownExperiment, RecordingError, OSError.
    """
    about = circumstances(options.command)
    file = options.file
    of_reports = file is not None and needs_reports(options.name)
    of_traffic = file is not None and needs_traffic(options.name)
    chosen = choose(
        options.name,
        quick=options.quick,
        trials=options.trials,
        video=recorded_video(file) if file is not None and not of_reports and not of_traffic else None,
        reports=partial(recorded_reports, file) if file is not None and of_reports else shipped_reports,
        traffic=partial(recorded_traffic, file) if file is not None and of_traffic else shipped_traffic,
    )
    if options.report is not None:
        options.report.mkdir(parents=True, exist_ok=True)
    for line in chosen.left_out:
        console.print(line)
    runs: list[Run] = []
    failed: list[str] = []
    for index, (name, experiment) in enumerate(chosen.experiments.items(), 1):
        place = f"{index}/{len(chosen.experiments)} " if len(chosen.experiments) > 1 else ""
        try:
            runs.append(_with_progress(console, place + name, name, experiment, options))
        except EvaluationError as error:
            failed.append(_explained(name, error))
            continue
        console.print(told(runs[-1]))
    if options.name == ALL:
        console.print(summary(runs))
    _write(console, options, runs, [*chosen.left_out, *(f"{name} failed" for name in failed)], about)
    if options.report is not None:
        failed += _without_figures(runs)
    return failed


def _explained(name: str, error: EvaluationError) -> str:
    """The name, after what went wrong was told."""
    print(error.details or "", f"airside: {error}", sep="\n" if error.details else "", file=sys.stderr)
    return name


def _without_figures(runs: Sequence[Run]) -> list[str]:
    """The names of those whose figures could not be drawn; the page says so, and has the rest."""
    failed = []
    for run in runs:
        try:
            run.figures()
        except EvaluationError as error:
            failed.append(_explained(run.name, error))
    return failed


def _with_progress(console: Console, label: str, name: str, experiment: Experiment, options: Options) -> Run:
    jobs = options.jobs or joblib.cpu_count()
    screen = console if console.is_terminal else Console(stderr=True)
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("trials"),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
    )
    if not screen.is_terminal:
        print(f"airside: {label}, {experiment.trials} trials", file=sys.stderr, flush=True)
    with Progress(*columns, console=screen, transient=True, disable=not screen.is_terminal) as progress:
        task = progress.add_task(label, total=experiment.trials)
        return carry_out(
            name,
            experiment,
            seed=options.seed,
            jobs=jobs,
            backend=usable_backend(options.backend),
            quick=options.quick,
            done=lambda finished: progress.update(task, completed=finished),
        )


def _write(
    console: Console, options: Options, runs: Sequence[Run], left_out: Sequence[str], about: Circumstances
) -> None:
    """Write what was asked for. Raises OSError."""
    if options.json is not None and runs:
        found = [document(run) for run in runs]
        write_whole(options.json, json_text(found if options.name == ALL else found[0]))
        console.print(f"written: {options.json}")
    if options.markdown is not None and runs:
        write_whole(options.markdown, markdown(runs, left_out, about))
        console.print(f"written: {options.markdown}")
    if options.report is not None and runs:
        from app.evaluate.page import page

        path = options.report / f"{options.name}.html"
        write_whole(path, page(options.name, runs, left_out, about))
        console.print(f"written: {path}")

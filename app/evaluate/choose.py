"""Which experiments are to be run, and with what settings."""

from __future__ import annotations

import difflib
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from typing import Any

from pipeline.lab import evaluate
from pipeline.lab.evaluate import Experiment, RecordedReports, RecordedTraffic, RecordedVideo

ALL = "all"


class UnknownExperiment(ValueError):
    """There is no experiment of that name, or it cannot be run like that; the message says what can."""


@dataclass(frozen=True, eq=False)
class Chosen:
    """What is to be run. experiments: by name, in order. left_out: why others are not, one line each."""

    experiments: dict[str, Experiment]
    left_out: tuple[str, ...] = ()


def needs_video(kind: type[Any]) -> bool:
    """Whether an experiment works on recorded video."""
    return any(one.name == "video" for one in fields(kind))


def needs_reports(name: str) -> bool:
    """Whether the experiment called so works on recorded target reports; False where there is none of that name."""
    return _has_field(name, "reports")


def needs_traffic(name: str) -> bool:
    """Whether the experiment called so works on recorded traffic; False where there is none of that name."""
    return _has_field(name, "traffic")


def _has_field(name: str, field: str) -> bool:
    kind = evaluate.experiments().get(name)
    return kind is not None and any(one.name == field for one in fields(kind))


def choose(
    name: str, *, quick: bool, trials: int | None, video: RecordedVideo | None,
    reports: Callable[[], RecordedReports], traffic: Callable[[], tuple[RecordedTraffic, ...]],
) -> Chosen:  # fmt: skip
    """The experiment called `name`, or all of them, short when `quick`, each with so many trials if given.

    video, reports, traffic: handed to experiments that work on a recording of them. Raises UnknownExperiment.
    """
    known = evaluate.experiments()
    asked = [one for one in known if name in (one, ALL)]
    given: dict[str, dict[str, Any]] = {one: {"reports": reports()} for one in asked if needs_reports(one)}
    given |= {one: {"traffic": traffic()} for one in asked if needs_traffic(one)}
    if name == ALL:
        if not known:
            raise UnknownExperiment("there are no experiments")
        names = [one for one, kind in known.items() if video is not None or not needs_video(kind)]
        left = tuple(f"{one} is left out: it needs a recording (--file)" for one in known if one not in names)
        return Chosen({one: _made(known[one], quick, trials, video, given.get(one, {})) for one in names}, left)
    if name not in known:
        raise UnknownExperiment(f"no experiment is called {name!r}{nearest(name, [*known, ALL])}")
    if video is None and needs_video(known[name]):
        raise UnknownExperiment(f"{name} works on a recording: name one with --file")
    if video is not None and not needs_video(known[name]):
        raise UnknownExperiment(f"{name} does not work on a recording: leave out --file")
    return Chosen({name: _made(known[name], quick, trials, video, given.get(name, {}))})


def nearest(word: str, among: list[str]) -> str:
    """What to say after a word that is not known: the one that was meant, or all there are."""
    close = difflib.get_close_matches(word, among, n=1, cutoff=0.4)
    return f"; did you mean {close[0]!r}?" if close else f"; there are: {', '.join(sorted(among))}"


def _made(
    kind: type[Any], quick: bool, trials: int | None, video: RecordedVideo | None, given: dict[str, Any]
) -> Experiment:
    made = kind(video=video, **given) if needs_video(kind) else kind(**given)
    if quick:
        made = made.quick()
    if trials is not None:
        made = replace(made, trials=trials)
    experiment: Experiment = made
    return experiment

"""One conflict is one alert: what the rules say in one look about one intruder on one runway, put together.

The gravest leads: alarm before information, several targets before one, then the rules in the order in which they run,
then what is nearest in time. It gives rule, text and figures; the other targets are named after its own.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

from pipeline.alert.conflict import label_of
from pipeline.alert.life import Case, intruder_of
from pipeline.contracts.alert import Conflict, Situation


def merge(situation: Situation, found: Sequence[Conflict]) -> list[Conflict]:
    """One conflict an intruder and runway, from those that the rules report in their order.

    Conflicts of the same targets are one: also without an intruder, and on two runways whose crossing they approach.
    """
    order = {rule: i for i, rule in enumerate(dict.fromkeys(one.rule for one in found))}
    groups: list[list[Conflict]] = []
    for one in sorted(found, key=lambda one: one.intruder is None):
        group = next((group for group in groups if any(_same(one, other) for other in group)), None)
        if group is None:
            groups.append([one])
        else:
            group.append(one)
    return [_lead(situation, sorted(group, key=lambda one: _rank(one, order))) for group in groups]


def find_case(
    cases: Sequence[Case], conflict: Conflict, addresses: tuple[str, ...], taken: Sequence[Case]
) -> Case | None:
    """The case that a conflict goes on with: of its intruder, else of its targets, else of those with their addresses.

    taken: cases that have met their conflict in this look.
    """
    track, address = intruder_of(conflict, addresses)
    free = [one for one in cases if not any(one is t for t in taken)]
    here = [one for one in free if one.conflict.runway == conflict.runway]
    ways: tuple[tuple[list[Case], Callable[[Case], bool]], ...] = (
        (here, lambda case: track is not None and case.intruder[0] == track),
        (here, lambda case: frozenset(case.conflict.tracks) == frozenset(conflict.tracks)),
        (free, lambda case: _same_targets(case.conflict, conflict)),
        (here, lambda case: bool(address) and case.intruder[1] == address),
        (here, lambda case: case.renamed(conflict, addresses)),
    )
    return next((case for among, way in ways for case in among if way(case)), None)


def _same(one: Conflict, other: Conflict) -> bool:
    if one.runway != other.runway:
        return _same_targets(one, other)
    if one.intruder is not None and one.intruder == other.intruder:
        return True
    return frozenset(one.tracks) == frozenset(other.tracks)


def _same_targets(one: Conflict, other: Conflict) -> bool:
    """Whether both are between the same targets, two at least."""
    return len(frozenset(one.tracks)) > 1 and frozenset(one.tracks) == frozenset(other.tracks)


def _rank(one: Conflict, order: dict[str, int]) -> tuple[bool, bool, int, float]:
    time = one.time_to_threshold if one.time_to_conflict is None else one.time_to_conflict
    return one.stage != "alarm", len(one.tracks) < 2, order[one.rule], float("inf") if time is None else time


def _lead(situation: Situation, group: list[Conflict]) -> Conflict:
    first = group[0]
    others = list(dict.fromkeys(track for one in group for track in one.tracks if track not in first.tracks))
    also = f"; also {', '.join(label_of(situation, track) for track in others)}" if others else ""
    return replace(
        first,
        tracks=(*first.tracks, *others),
        text=first.text + also,
        certain=any(one.certain for one in group),
        holding_point=next((one.holding_point for one in group if one.holding_point), None),
    )

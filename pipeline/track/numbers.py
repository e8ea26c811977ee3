"""What a track is called: its id, never given twice in a run, and the short number that ASTERIX has room for."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from pipeline.tables.arrays import Array
from pipeline.track.store import NEVER

LAST_ASTERIX_NUMBER = 4095
"""The greatest track number of ASTERIX CAT010: I010/161 has 12 bits for it."""

LARGEST_NUMBER = 65535
"""The greatest number that the column `number` of `Tracks` holds, 16 bits, as those of CAT062 I062/040."""

REST_S = 120.0
"""s for which a number stays unused after its track ended, lest a controller take one target for another."""


@dataclass(slots=True, eq=False)
class TrackNumbers:
    """Ids 1, 2, 3, ... that are never given again, and numbers 1 .. `last` that are given in turn.

    last: the greatest number; 0: no numbers are given. rest: s for which a number stays unused after its track ended.
    next: the number whose turn it is. last_id: the newest id. free_at: (last + 1,) UTC s from which each number may be
    given again; infinite while a track bears it; entry 0 is not used.
    Raises ValueError for a `last` that the column of `Tracks` cannot hold.
    """

    last: int = LAST_ASTERIX_NUMBER
    rest: float = REST_S
    next: int = 1
    last_id: int = 0
    free_at: Array = field(init=False)

    def __post_init__(self) -> None:
        if not 0 <= self.last <= LARGEST_NUMBER:
            raise ValueError(f"the greatest track number must lie between 0 and {LARGEST_NUMBER}")
        self.free_at = np.full(self.last + 1, NEVER)

    def new_ids(self, count: int) -> Array:
        """The next `count` ids, (count,) int64."""
        made = np.arange(self.last_id + 1, self.last_id + 1 + count)
        self.last_id += count
        return made

    def take(self, count: int, time: float) -> Array:
        """The next free numbers at UTC s `time`, (count,) uint16; 0 where none is left.

        Those that have rested come first, in turn; then those that still rest, the longest rested first.
        """
        given = np.zeros(count, np.uint16)
        turn = np.r_[self.next : self.last + 1, 1 : self.next]
        free_at = self.free_at[turn]
        resting = np.flatnonzero((free_at > time) & np.isfinite(free_at))
        resting = resting[np.argsort(free_at[resting], kind="stable")]
        free = turn[np.r_[np.flatnonzero(free_at <= time), resting][:count]]
        given[: len(free)] = free
        self.free_at[free] = np.inf
        if len(free):
            self.next = int(free[-1]) % self.last + 1
        return given

    def give_back(self, numbers: Array, time: float) -> None:
        """These numbers, of tracks that ended at UTC s `time`, are free after their rest. Zeros do no harm."""
        self.free_at[numbers] = time + self.rest

"""Fixed places for things that come and go."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable


class Slots:
    """Gives each id a place in 0 .. capacity-1 and keeps it there; places are reused as late as possible.

    So a click on an instance that just left still names the track that was there. refused: ids without a place in the
    newest call of `assign`.
    """

    def __init__(self, capacity: int) -> None:
        self.capacity = capacity
        self.refused = 0
        self._place: dict[int, int] = {}
        self._bearer: list[int | None] = [None] * capacity
        self._free = deque(range(capacity))

    def assign(self, ids: Iterable[int]) -> tuple[dict[int, int], list[int]]:
        """Places of these ids, and the places given to a new id in this call; ids not named lose theirs.

        When places run out the last ids are left out.
        """
        wanted = dict.fromkeys(ids)
        for gone in [one for one in self._place if one not in wanted]:
            self._free.append(self._place.pop(gone))
        fresh: list[int] = []
        for one in wanted:
            if one not in self._place and self._free:
                place = self._free.popleft()
                self._place[one] = place
                self._bearer[place] = one
                fresh.append(place)
        self.refused = len(wanted) - len(self._place)
        return self._place, fresh

    def bearer(self, place: int | None) -> int | None:
        """The id that has this place, or had it last."""
        return self._bearer[place] if place is not None and 0 <= place < self.capacity else None

"""Those who hear of every picture."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable

from app.contract import PictureListener
from pipeline.picture import AlertChange, Picture

log = logging.getLogger(__name__)


class Listeners:
    """Any thread may add and remove; one that fails does not keep the others from hearing."""

    def __init__(self) -> None:
        self._all: list[PictureListener] = []
        self._lock = threading.Lock()

    def add(self, listener: PictureListener) -> Callable[[], None]:
        """Call `listener` with every picture; returns the function that ends it."""
        with self._lock:
            self._all.append(listener)

        def end() -> None:
            with self._lock:
                if listener in self._all:
                    self._all.remove(listener)

        return end

    def tell(self, picture: Picture, changes: tuple[AlertChange, ...]) -> int:
        """Call all; how many failed (logged)."""
        with self._lock:
            listeners = tuple(self._all)
        failures = 0
        for listener in listeners:
            try:
                listener(picture, changes)
            except Exception:
                failures += 1
                log.exception("a listener failed")
        return failures

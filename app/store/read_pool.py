"""Threads of their own for questions to the database, so that a database that hangs holds up nothing else."""

from __future__ import annotations

import asyncio
import contextlib
import queue
import threading
from collections.abc import Callable
from concurrent.futures import Future
from typing import Any, TypeVar

Answer = TypeVar("Answer")

THREADS = 4
"""Questions that are asked at once: more than a database on the same machine answers sooner together."""

WAITING = 16
"""Questions that may wait for a thread; with answers in some ten ms none of them waits for a second."""

ANSWER_S = 5.0
"""Whoever asks is told after this long that there is no answer."""

RETRY_FULL_S, RETRY_LATE_S = 2, 5
"""When to ask again: soon where others were first, later where the database itself is slow."""


class NoAnswer(Exception):
    """The question was not answered; the message says why. retry_after_s: when to ask again."""

    def __init__(self, message: str, retry_after_s: int) -> None:
        super().__init__(message)
        self.retry_after_s = retry_after_s


class ReadPool:
    """Bounded in threads, in questions that wait, and in the time until whoever asks is answered.

    A thread whose question hangs is lost until the database answers or its own limit ends the question
    (`app.store.database`); threads do not hold up the end of the process.
    """

    def __init__(self, threads: int = THREADS, waiting: int = WAITING, answer_s: float = ANSWER_S) -> None:
        self.answer_s = answer_s
        self._questions: queue.Queue[tuple[Callable[[], Any], Future[Any]] | None] = queue.Queue(waiting)
        self._threads = [
            threading.Thread(target=self._run, name=f"database-read-{i}", daemon=True) for i in range(threads)
        ]
        self._begun = False

    async def ask(self, question: Callable[[], Answer]) -> Answer:
        """The answer, or what `question` raises. For the event loop. Raises NoAnswer when full, or after `answer_s`."""
        if not self._begun:
            self._begun = True
            for one in self._threads:
                one.start()
        answer: Future[Answer] = Future()
        try:
            self._questions.put_nowait((question, answer))
        except queue.Full:
            raise NoAnswer(
                "too many questions to the database wait for their answers; ask again later", RETRY_FULL_S
            ) from None
        try:
            return await asyncio.wait_for(asyncio.wrap_future(answer), self.answer_s)
        except TimeoutError:
            raise NoAnswer(f"the database has not answered within {self.answer_s:g} s", RETRY_LATE_S) from None

    def close(self) -> None:
        """End the threads that do not hang."""
        for _ in self._threads:
            with contextlib.suppress(queue.Full):
                self._questions.put_nowait(None)

    def _run(self) -> None:
        while (asked := self._questions.get()) is not None:
            question, answer = asked
            if not answer.set_running_or_notify_cancel():
                continue  # nobody waits for it any more
            try:
                answer.set_result(question())
            except BaseException as error:
                answer.set_exception(error)

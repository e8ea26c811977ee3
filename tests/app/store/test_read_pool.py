"""Questions to a database that hangs: bounded in number and in time."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Iterator

import pytest

from app.store.read_pool import NoAnswer, ReadPool


@pytest.fixture
def hanging() -> Iterator[threading.Event]:
    """Questions wait for this event."""
    event = threading.Event()
    yield event
    event.set()


async def test_answers_and_errors_come_back() -> None:
    pool = ReadPool(2, 4, 30.0)
    assert await asyncio.gather(*(pool.ask(lambda i=i: i) for i in range(4))) == [0, 1, 2, 3]
    with pytest.raises(ZeroDivisionError):
        await pool.ask(lambda: 1 // 0)
    assert await pool.ask(lambda: 5) == 5
    pool.close()


async def test_what_finds_no_room_is_refused_at_once(hanging: threading.Event) -> None:
    pool, begun = ReadPool(2, 3, 600.0), threading.Semaphore(0)

    def hang() -> str:
        begun.release()
        hanging.wait(60.0)
        return "late"

    asked = [asyncio.create_task(pool.ask(hang)) for _ in range(2)]
    for _ in asked:
        await asyncio.to_thread(begun.acquire)
    asked += [asyncio.create_task(pool.ask(hang)) for _ in range(3)]
    await asyncio.sleep(0)
    with pytest.raises(NoAnswer, match="too many questions") as refused:
        await pool.ask(hang)
    assert refused.value.retry_after_s == 2
    hanging.set()
    assert await asyncio.gather(*asked) == ["late"] * 5
    assert await pool.ask(lambda: 5) == 5


async def test_an_answer_is_not_awaited_for_ever_and_the_question_is_dropped(hanging: threading.Event) -> None:
    pool, asked = ReadPool(1, 3, 0.05), []
    with pytest.raises(NoAnswer, match=r"not answered within 0\.05 s") as late:
        await pool.ask(lambda: hanging.wait(60.0))
    assert late.value.retry_after_s == 5
    with pytest.raises(NoAnswer):
        await pool.ask(lambda: asked.append("nobody waits for this"))
    pool.answer_s = 60.0
    hanging.set()
    assert await pool.ask(lambda: 5) == 5
    assert asked == []

"""What the routes share, and how they answer."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from datetime import UTC, datetime
from http import HTTPStatus
from typing import TYPE_CHECKING, Annotated, Any, TypeVar

from anyio import CapacityLimiter, to_thread
from fastapi import Depends, Query
from pydantic import BeforeValidator, WithJsonSchema
from starlette.responses import Response

from app.api.models import Problem
from app.api.openapi import reference
from app.api.problems import PROBLEM, ApiProblem
from app.contract import Refused, Service
from app.live.hub import Hub
from app.settings import Settings
from app.store.read_pool import ReadPool
from app.wire import Row, Wire, encode

if TYPE_CHECKING:
    from app.store.store import Store


Made = TypeVar("Made")

INTAKE_THREADS = 16
"""Requests with measurements that are read at once; more would only take the processor from one another."""

ORDER_THREADS = 8
"""Orders of operators that are carried out at once: several times what the operators of one airport give."""


@dataclass(frozen=True)
class Context:
    """The service and what stands around it. store: None when nothing is kept.

    refused: how many requests and connections the web server refused or cut, by reason.
    reads: where the store is asked. intake, orders: what measurements and operators' orders wait for is theirs alone,
    so that no other request, however slow, keeps them waiting.
    """

    service: Service
    hub: Hub
    store: Store | None
    settings: Settings
    wire: Wire
    refused: Counter[str] = field(default_factory=Counter)
    reads: ReadPool = field(default_factory=ReadPool)
    intake: CapacityLimiter = field(default_factory=lambda: CapacityLimiter(INTAKE_THREADS))
    orders: CapacityLimiter = field(default_factory=lambda: CapacityLimiter(ORDER_THREADS))

    async def take_in(self, work: Callable[[], Made]) -> Made:
        """Do work on measurements in a thread."""
        return await to_thread.run_sync(work, limiter=self.intake)

    async def order(self, work: Callable[[], Made]) -> Made:
        """Carry out an operator's order in a thread."""
        return await to_thread.run_sync(work, limiter=self.orders)

    def stamp(self) -> Row:
        """epoch, seq, time and mode of the newest picture. Raises ApiProblem before the first."""
        picture = self.hub.picture
        if picture is None:
            raise ApiProblem(503, "there is no picture yet", headers={"Retry-After": "1"})
        return {
            "epoch": self.hub.epoch,
            "seq": self.hub.picture_seq,
            "time": picture.time,
            "mode": self.settings.mode,
        }

    def ask(self, work: Callable[[], Any], refusal: int = 409) -> Any:
        """Do `work`; what the service refuses becomes `refusal`, or 503 while it is not ready."""
        try:
            return work()
        except Refused as error:
            if not self.service.readiness().ready:
                raise ApiProblem(503, str(error), headers={"Retry-After": "1"}) from error
            raise ApiProblem(refusal, str(error)) from error


def answer(value: Any, status: int = 200) -> Response:
    """JSON; the only way answers are made."""
    return Response(encode(value), status, media_type="application/json")


def problems(*statuses: int) -> dict[int | str, dict[str, Any]]:
    """The declarations of these errors for OpenAPI."""
    content = {PROBLEM: {"schema": reference(Problem.__name__)}}
    return {status: {"description": HTTPStatus(status).phrase, "content": content} for status in statuses}


def instant(value: Any) -> float:
    """Unix seconds of a number or an ISO 8601 time (UTC when no zone is given). Raises ValueError."""
    if isinstance(value, str):
        try:
            number = float(value)
        except ValueError:
            text = value.strip().replace(" ", "+")
            moment = datetime.fromisoformat(text)
            return (moment if moment.tzinfo else moment.replace(tzinfo=UTC)).timestamp()
    else:
        number = float(value)
    if not -1e12 < number < 1e12:
        raise ValueError("seconds out of bounds")
    return number


_TIME_SCHEMA = {
    "anyOf": [{"type": "number", "minimum": -1e11, "maximum": 1e11}, {"type": "string", "format": "date-time"}],
    "description": "Unix seconds or ISO 8601",
}
Instant = Annotated[float, BeforeValidator(instant), WithJsonSchema(_TIME_SCHEMA)]
From = Annotated[Instant | None, Query(alias="from", description="not before: Unix seconds or ISO 8601")]
To = Annotated[Instant | None, Query(alias="to", description="not after: Unix seconds or ISO 8601")]


def _span(first: From = None, last: To = None) -> tuple[float | None, float | None]:
    if first is not None and last is not None and first > last:
        raise ApiProblem(422, f"from ({first:.3f}) is later than to ({last:.3f})")
    return first, last


Span = Annotated[tuple[float | None, float | None], Depends(_span)]
"""The times from and to of a question; 422 when they are the wrong way round."""

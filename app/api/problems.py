"""Errors as RFC 9457 problem details, everywhere the same."""

from __future__ import annotations

import logging
from http import HTTPStatus
from typing import Any

from fastapi import FastAPI
from fastapi.exceptions import RequestValidationError
from sqlalchemy.exc import SQLAlchemyError
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import Response

from app.contract import Refused, UnknownId
from app.store.read_pool import NoAnswer
from app.wire import encode

log = logging.getLogger(__name__)

PROBLEM = "application/problem+json"


class ApiProblem(HTTPException):
    """An error with words for the person at the other end. errors: single faults, with their place."""

    def __init__(
        self,
        status: int,
        detail: str,
        *,
        errors: list[dict[str, Any]] | None = None,
        headers: dict[str, str] | None = None,
    ) -> None:
        super().__init__(status, detail, headers)
        self.errors = errors


def problem(
    status: int, detail: str, *, errors: list[dict[str, Any]] | None = None, headers: dict[str, str] | None = None
) -> Response:
    """The answer that tells of an error."""
    body: dict[str, Any] = {
        "type": "about:blank",
        "title": HTTPStatus(status).phrase,
        "status": status,
        "detail": detail,
    }
    if errors:
        body["errors"] = errors
    return Response(encode(body), status, headers, PROBLEM)


def install(app: FastAPI) -> None:
    """Answer every error of this application as a problem."""

    @app.exception_handler(HTTPException)
    async def http(_request: Request, error: HTTPException) -> Response:
        errors = getattr(error, "errors", None)
        headers = dict(error.headers) if error.headers else None
        return problem(error.status_code, str(error.detail), errors=errors, headers=headers)

    @app.exception_handler(RequestValidationError)
    async def invalid(_request: Request, error: RequestValidationError) -> Response:
        faults = [{"place": ".".join(map(str, one["loc"])), "message": one["msg"]} for one in error.errors()]
        return problem(422, "; ".join(f"{one['place']}: {one['message']}" for one in faults), errors=faults)

    @app.exception_handler(UnknownId)
    async def unknown(_request: Request, error: UnknownId) -> Response:
        return problem(404, f"nothing is called {error.args[0] if error.args else ''!s}")

    @app.exception_handler(Refused)
    async def refused(_request: Request, error: Refused) -> Response:
        return problem(409, str(error))

    @app.exception_handler(SQLAlchemyError)
    async def database(_request: Request, error: SQLAlchemyError) -> Response:
        log.error("the database does not answer", exc_info=error)
        return problem(503, "the database does not answer", headers={"Retry-After": "5"})

    @app.exception_handler(NoAnswer)
    async def unanswered(_request: Request, error: NoAnswer) -> Response:
        log.warning("%s", error)
        return problem(503, str(error), headers={"Retry-After": str(error.retry_after_s)})

    @app.exception_handler(Exception)
    async def unforeseen(_request: Request, error: Exception) -> Response:
        return problem(500, "internal error; it has been logged")

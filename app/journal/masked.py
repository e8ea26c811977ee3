"""The settings as they may be handed on with a recording: without passwords."""

from __future__ import annotations

import re
from typing import Any

from app.secret_urls import MASK, masked_text
from app.settings import Settings

_SECRET_NAME = re.compile(r"(?i)password|passwd|secret|token|credential")


def masked(settings: Settings) -> dict[str, Any]:
    """All settings as plain JSON values; user, password and secret parameters of every URL are replaced by "***".

    A setting whose own name speaks of a secret (password, token, ...) is replaced as a whole.
    """
    plain: dict[str, Any] = settings.model_dump(mode="json")
    return {key: _masked(key, value) for key, value in plain.items()}


def _masked(key: str, value: Any) -> Any:
    if isinstance(value, dict):
        return {inner: _masked(inner, one) for inner, one in value.items()}
    if isinstance(value, list):
        return [_masked(key, one) for one in value]
    if isinstance(value, str):
        return MASK if value and _SECRET_NAME.search(key) else masked_text(value)
    return value

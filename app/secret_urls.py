"""URLs with a user name, password or token in them: kept whole, shown without it, also in logs and messages."""

from __future__ import annotations

import logging
import re
from urllib.parse import urlsplit

from pydantic import Secret

MASK = "***"
"""What stands in place of a secret."""

_USER_INFO = re.compile(
    r"(?P<scheme>[A-Za-z][A-Za-z0-9+.-]*://)(?!/)(?:(?!,[A-Za-z][A-Za-z0-9+.-]*://)[^\s'\"])*@", re.ASCII
)
"""Up to the last "@": a password that was not written in percent form may hold any other sign."""

_SECRET_QUERY = re.compile(r"(?i)(?P<key>[?&][^=&#\s]*(?:password|passwd|secret|token|key|auth)[^=&#\s]*=)[^&#\s'\"]*")


def masked_text(text: str) -> str:
    """A text in which the user info and the secret parameters of every URL are replaced by "***"."""
    return _USER_INFO.sub(rf"\g<scheme>{MASK}@", _SECRET_QUERY.sub(rf"\g<key>{MASK}", text))


class SecretUrl(Secret[str]):
    """A URL that shows itself, in words, `repr` and JSON, without what is secret in it."""

    def _display(self) -> str:
        return masked_text(self.get_secret_value())


def check_url(url: str) -> None:
    """Raises ValueError, in words without the URL, when a URL (or one of several after commas) cannot be read."""
    try:
        for one in url.split(","):
            _ = urlsplit(one).port
    except ValueError:
        raise ValueError(
            "cannot be read as a URL; in a user name or password write / ? # @ , and % as %2F %3F %23 %40 %2C %25"
        ) from None


class MaskedFormatter(logging.Formatter):
    """Formats log records, with their tracebacks, without the secrets of URLs: libraries print theirs in errors."""

    def format(self, record: logging.LogRecord) -> str:
        """The record in words."""
        return masked_text(super().format(record))

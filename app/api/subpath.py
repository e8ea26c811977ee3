"""Where the service is reached: at the root of its host, or below a path that a proxy gives it."""

from __future__ import annotations

from starlette.datastructures import Headers
from starlette.types import Scope

from app.settings import PLAIN_PATH

LONGEST = 200
"""Characters of a prefix."""


def root_of(headers: Headers, root_path: str) -> str:
    """The path below which this request sees the service; "" for none.

    root_path: of the settings; without one, what the proxy says in X-Forwarded-Prefix, if it is a plain path.
    """
    if root_path:
        return root_path
    given = headers.get("x-forwarded-prefix", "").split(",")[0].strip().rstrip("/")
    return given if len(given) <= LONGEST and PLAIN_PATH.fullmatch(given) else ""


def below(scope: Scope, root: str) -> Scope:
    """The scope as it is for a service below `root`, whether or not the proxy has taken the root off the path."""
    path = scope["path"]
    if root and path != root and not path.startswith(f"{root}/"):
        path = root + path
    return {**scope, "root_path": root, "path": path}


def path_below(scope: Scope) -> str:
    """The path without the root; "" for the root itself without its slash."""
    return str(scope["path"][len(scope["root_path"]) :])

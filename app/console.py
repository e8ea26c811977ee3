"""What the commands say to a person: one way to fail, one look for progress."""

from __future__ import annotations

import sys

import typer


def fail(message: str, code: int = 2) -> typer.Exit:
    """Say what is wrong on standard error; use as `raise fail(...)`."""
    print(f"airside: {message}", file=sys.stderr)
    return typer.Exit(code)

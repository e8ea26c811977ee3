"""What the commands say to a person: one way to fail, one look for progress."""

from __future__ import annotations

import sys

import typer

from app.secret_urls import masked_text


def fail(message: str, code: int = 2) -> typer.Exit:
    """Say what is wrong on standard error; use as `raise fail(...)`."""
    print(f"airside: {masked_text(message)}", file=sys.stderr)
    return typer.Exit(code)

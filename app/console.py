"""What the commands say to a person: one way to fail, one look for progress."""

from __future__ import annotations

import io
import sys

import typer

from app.secret_urls import masked_text


def fail(message: str, code: int = 2) -> typer.Exit:
    """Say what is wrong on standard error; use as `raise fail(...)`."""
    print(f"airside: {masked_text(message)}", file=sys.stderr)
    return typer.Exit(code)


def one_line(error: BaseException) -> str:
    """An error in one line: what the library says at the root of it, without hints that follow in further lines."""
    words = " ".join(str(getattr(error, "orig", None) or error).split())
    return words or type(error).__name__


def any_terminal() -> None:
    """Let signs that the terminal has no code for be shown as "?" instead of ending the command."""
    for stream in (sys.stdout, sys.stderr):
        accept_any_sign(stream)


def accept_any_sign(stream: object) -> None:
    """Have a text stream write "?" for signs that its encoding lacks; other kinds of streams stay as they are."""
    if isinstance(stream, io.TextIOWrapper):
        stream.reconfigure(errors="replace")

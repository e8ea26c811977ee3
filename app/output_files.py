"""Files that commands write what they found into."""

from __future__ import annotations

import json
import os
import tempfile
from pathlib import Path
from typing import Any


def check_writable(path: Path) -> None:
    """Before work that takes long. Raises ValueError when no file can be written there."""
    if path.is_dir():
        raise ValueError(f"{path} is a folder; a file is wanted")
    if not path.absolute().parent.is_dir():
        raise ValueError(f"{path}: its folder does not exist")
    if not os.access(path.absolute().parent, os.W_OK):
        raise ValueError(f"{path}: its folder cannot be written to")


def json_text(found: dict[str, Any] | list[dict[str, Any]]) -> str:
    """Strict JSON, one value a line."""
    return json.dumps(found, indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def write_whole(path: Path, text: str) -> None:
    """Write a file so that it is there whole or not at all. Raises OSError."""
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    try:
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.write(text)
        umask = os.umask(0)
        os.umask(umask)
        Path(name).chmod(0o666 & ~umask)
        Path(name).replace(path)
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise

"""Folders and files that only the user of the service may read: positions, alerts, and who acknowledged them."""

from __future__ import annotations

import logging
import os
import stat
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import BinaryIO

from app.settings import SettingsError

log = logging.getLogger(__name__)

FOLDER_MODE = 0o700
FILE_MODE = 0o600
OTHERS = 0o077
"""The rights of anybody but the user."""


def make_private_folder(path: Path, setting: str) -> None:
    """Make a folder for this user alone; one that is there keeps its mode, and must be one that can be written.

    One that others may enter is warned of. setting: that names it. Raises SettingsError.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.mkdir(mode=FOLDER_MODE, exist_ok=True)
        with tempfile.TemporaryFile(dir=path):
            pass
    except OSError as error:
        raise SettingsError(f"{setting}: {path}: cannot be written: {error.strerror}") from error
    mode = stat.S_IMODE(path.stat().st_mode)
    if mode & OTHERS:
        log.warning(
            "%s: other users of this machine may enter %s (mode %04o), where positions and alerts are kept; "
            "chmod 700 %s keeps them out",
            setting, path, mode, path,
        )  # fmt: skip


def make_private_file(path: Path) -> None:
    """Make an empty file for this user alone, or take the reading of others away from one of this user's.

    Raises OSError when it cannot be made.
    """
    os.close(os.open(path, os.O_CREAT | os.O_RDWR | os.O_CLOEXEC, FILE_MODE))
    if path.stat().st_uid == os.geteuid():
        path.chmod(FILE_MODE)


def write_private_file(path: Path, write: Callable[[BinaryIO], None]) -> None:
    """Put what `write` writes into a file in one step: a crash leaves the old one whole. Raises OSError."""
    path.parent.mkdir(mode=FOLDER_MODE, parents=True, exist_ok=True)
    beside = path.with_name(f".{path.name}.new")
    try:
        make_private_file(beside)
        with beside.open("wb") as file:
            write(file)
            file.flush()
            os.fsync(file.fileno())
        os.replace(beside, path)
    except BaseException:
        beside.unlink(missing_ok=True)  # on a full disk the half of it takes the room of the next
        raise
    folder = os.open(path.parent, os.O_RDONLY)
    try:
        os.fsync(folder)
    finally:
        os.close(folder)

"""What a radar's detector has learned, in a file: written so that a crash leaves the old one whole, read with mistrust.

The file is a `.npz` without pickled objects. It is read only as far as its own directory says that it is small enough.
"""

from __future__ import annotations

import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from app.private_files import write_private_file
from pipeline.state import StateError

SAVED_AT = "file.saved_at"
SCENE = "file.scene"
MOST_ARRAYS = 256


def write_state(path: Path, arrays: Mapping[str, NDArray[Any]], saved_at: float, scene: str) -> None:
    """Put the arrays into the file in one step. saved_at: UTC s. scene: what else they belong to. Raises OSError."""
    kept = {**arrays, SAVED_AT: np.array(saved_at), SCENE: np.array(scene)}
    write_private_file(path, lambda file: np.savez(file, allow_pickle=False, **kept))


def read_state(path: Path, now: float, max_age_s: float, scene: str, most_bytes: int) -> dict[str, NDArray[Any]]:
    """The arrays of a file that is neither too old nor of another scene. now: UTC s. most_bytes: more is not read.

    Raises StateError for everything that is not as it should be, and FileNotFoundError.
    """
    try:
        with path.open("rb") as file:
            arrays = _arrays(file, most_bytes)
    except FileNotFoundError:
        raise
    except (
        Exception
    ) as error:  # whatever the readers of archives and arrays make of octets that anybody may have written
        raise StateError(f"the file cannot be read ({error})") from error
    saved_at, given = arrays.pop(SAVED_AT, None), arrays.pop(SCENE, None)
    if saved_at is None or saved_at.shape != () or saved_at.dtype != np.float64 or given is None:
        raise StateError("the file does not say when it was saved, and of what")
    age = now - float(saved_at)
    if not -max_age_s <= age <= max_age_s:
        raise StateError(f"it is {age:.0f} s old; up to {max_age_s:g} s are taken up")
    if str(given) != scene:
        raise StateError(f"it belongs to another scene: {str(given)[:200]}, not {scene}")
    return arrays


def _arrays(file: BinaryIO, most_bytes: int) -> dict[str, NDArray[Any]]:
    with zipfile.ZipFile(file) as directory:
        members = directory.infolist()
        total = sum(one.file_size for one in members)
        if len(members) > MOST_ARRAYS or total > most_bytes:
            raise ValueError(f"{len(members)} arrays with {total} octets are too many")
        if any(one.compress_type != zipfile.ZIP_STORED for one in members):
            raise ValueError("it is compressed")
        return {one.filename.removesuffix(".npy"): _array(directory, one) for one in members}


def _array(directory: zipfile.ZipFile, member: zipfile.ZipInfo) -> NDArray[Any]:
    """One array. What its head promises must be what is there, before any room is made for it."""
    with directory.open(member) as stream:
        version = np.lib.format.read_magic(stream)
        if version != (1, 0):
            raise ValueError(f"version {version} of the array format")
        shape, _, dtype = np.lib.format.read_array_header_1_0(stream)
        count = 1
        for side in shape:
            if side < 0:
                raise ValueError("a shape below 0")
            count *= side
        if dtype.hasobject or count * dtype.itemsize + stream.tell() != member.file_size:
            raise ValueError(f"{member.filename} is not what its head says")
    with directory.open(member) as stream:
        array: NDArray[Any] = np.lib.format.read_array(stream, allow_pickle=False)
        stream.read(1)  # the sum of the member is checked at its end
    return array

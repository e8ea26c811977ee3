"""Where compiled kernels are kept.

numba's own cache looks only at the file a kernel stands in, not at the kernels of other files that were compiled into
it, so an update of one file could leave old code at work. Here the folder is named after all files that hold kernels:
one changed, all are compiled anew, once.
"""

from __future__ import annotations

import hashlib
import os
import re
import shutil
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
KEPT = 3
"""Folders of older sources that stay, so that going back to them compiles nothing."""

SHIPPED = "AIRSIDE_SHIPPED_KERNELS"
"""The variable that names a folder of compiled kernels that came with the program, as in a Docker image."""

TAKEN = ".shipped"
"""In a folder: which shipped kernels were copied into it."""

KERNEL = re.compile(rb"^\s*(?:from|import) (?:pipeline\.kernels\.compiled|numba)\b", re.MULTILINE)
"""What a file that holds kernels imports."""

CONSTANTS = re.compile(rb"^from (pipeline[\w.]*) import (?:\([^)]*?|[^(\n]*?)\b[A-Z][A-Z0-9_]+\b", re.MULTILINE)
"""An import of at least one constant, a name in capitals, from a module of the core."""


def use_kernel_cache() -> None:
    """Point numba to the folder of exactly these sources; of older ones the newest few are kept.

    NUMBA_CACHE_DIR, where it is set, is the folder above it; otherwise `.airside/kernels` beside the sources. Kernels
    that came with the program are copied there once.
    """
    if "numba" in sys.modules:
        return
    above, digest = Path(os.environ.get("NUMBA_CACHE_DIR") or ROOT / ".airside" / "kernels"), _digest()
    folder = above if above.name == digest else above / digest  # a child process finds it set already
    os.environ["NUMBA_CACHE_DIR"] = str(folder)
    if not folder.is_dir():
        _make(folder)
    if SHIPPED in os.environ:
        _take_shipped(Path(os.environ[SHIPPED]) / digest, folder)


def kernel_sources(root: Path = ROOT) -> list[Path]:
    """All files that hold kernels or say how kernels are compiled, and those they take constants from.

    A kernel is decorated by `pipeline.kernels.compiled`; an intrinsic, and that file itself, import numba. A constant
    of another file is compiled into the kernel as a number.
    """
    every = (*(root / "pipeline").rglob("*.py"), root / "app" / "ingest" / "socket_kernel.py")
    kernels = {path: source for path in every if KERNEL.search(source := path.read_bytes())}
    modules = {module for source in kernels.values() for module in CONSTANTS.findall(source)}
    named = {
        root / f"{module.decode().replace('.', '/')}{end}" for module in modules for end in (".py", "/__init__.py")
    }
    return sorted(kernels.keys() | {path for path in named if path.is_file()})


def _digest(root: Path = ROOT) -> str:
    found = hashlib.sha256(sys.version.encode())
    for path in kernel_sources(root):
        found.update(path.name.encode() + path.read_bytes())
    return found.hexdigest()[:16]


def _make(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
        now = time.time()
        others = [(one.stat().st_mtime, one) for one in folder.parent.iterdir() if one != folder]
        # a time beyond the host's says nothing about the age: such a folder goes first
        older = [one for _, one in sorted((made if made <= now else 0.0, one) for made, one in others)]
        for one in older[: max(0, len(older) - KEPT)]:
            shutil.rmtree(one, ignore_errors=True)
    except OSError:
        pass  # numba says itself when it cannot write there


def _take_shipped(shipped: Path, folder: Path) -> None:
    """Copy kernels that came with the program over what is kept, unless these very ones were copied before.

    What is kept may be of an older image with the same sources, whose kernels numba no longer takes: it goes by the
    times of the source files.
    """
    try:
        files = sorted(one for one in shipped.rglob("*") if one.is_file())
        found = hashlib.sha256(repr([(str(one), one.stat().st_size, one.stat().st_mtime_ns) for one in files]).encode())
        mark, told = folder / TAKEN, found.hexdigest()
        if not files or (mark.is_file() and mark.read_text() == told):
            return
        shutil.copytree(shipped, folder, dirs_exist_ok=True)
        mark.write_text(told)
    except OSError:
        pass  # then they are compiled

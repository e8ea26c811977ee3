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

KERNEL = re.compile(rb"^\s*(?:from|import) (?:pipeline\.kernels\.compiled|numba)\b", re.MULTILINE)
"""What a file that holds kernels imports."""

CONSTANTS = re.compile(rb"^from (pipeline[\w.]*) import (?:\([^)]*?|[^(\n]*?)\b[A-Z][A-Z0-9_]+\b", re.MULTILINE)
"""An import of at least one constant, a name in capitals, from a module of the core."""


def use_kernel_cache() -> None:
    """Point numba to the folder of exactly these sources; of older ones the newest few are kept.

    NUMBA_CACHE_DIR, where it is set, is the folder above it; otherwise `.airside/kernels` beside the sources.
    """
    if "numba" in sys.modules:
        return
    above, digest = Path(os.environ.get("NUMBA_CACHE_DIR") or ROOT / ".airside" / "kernels"), _digest()
    folder = above if above.name == digest else above / digest  # a child process finds it set already
    os.environ["NUMBA_CACHE_DIR"] = str(folder)
    if not folder.is_dir():
        _make(folder)


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

"""Where compiled kernels are kept.

numba's own cache looks only at the file a kernel stands in, not at the kernels of other files that were compiled into
it, so an update of one file could leave old code at work. Here the folder is named after all files that hold kernels:
one changed, all are compiled anew, once.
"""

from __future__ import annotations

import hashlib
import os
import shutil
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
KEPT = 3


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


def _digest() -> str:
    found = hashlib.sha256(sys.version.encode())
    for path in sorted((*(ROOT / "pipeline").rglob("*.py"), ROOT / "app" / "ingest" / "socket_kernel.py")):
        source = path.read_bytes()
        if b"njit" in source or b"intrinsic" in source:
            found.update(path.name.encode() + source)
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

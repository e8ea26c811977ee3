"""When, where and with what an evaluation was run."""

from __future__ import annotations

import os
import platform
import subprocess
from collections.abc import Iterable
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path

from app.kernel_cache import ROOT

PACKAGES = ("numpy", "scipy", "numba", "joblib", "matplotlib")


@dataclass(frozen=True)
class Circumstances:
    """command: what to type to run it again. date: when it began, UTC. The rest in words."""

    command: str
    date: datetime
    machine: str
    versions: str

    def lines(self) -> Iterable[tuple[str, str]]:
        """(what, in words) of all but the command."""
        yield "Date", f"{self.date:%Y-%m-%d %H:%M} UTC"
        yield "Machine", self.machine
        yield "Versions", self.versions


def circumstances(command: str) -> Circumstances:
    """Of this process, now."""
    return Circumstances(command, datetime.now(UTC), _machine(), _versions())


def _machine() -> str:
    cores, memory = os.cpu_count() or 1, os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 2**30
    system = f"{platform.system()} {platform.release()}"
    return f"{_processor()}, {cores} core{'s' if cores > 1 else ''}, {memory:.0f} GiB, {system}"


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        lines = []
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return f"{names[0]} ({platform.machine()})" if names and names[0] != "unknown" else platform.machine()


def _versions() -> str:
    packages = ", ".join(f"{name} {version(name)}" for name in PACKAGES)
    return f"airside {version('airside')}{_commit()}, Python {platform.python_version()}, {packages}"


def _commit() -> str:
    """The commit of the sources, where they are a git checkout."""
    if not (ROOT / ".git").exists():
        return ""
    try:
        commit = _git("rev-parse", "--short=10", "HEAD")
        changed = _git("status", "--porcelain", "--", "app", "pipeline")
    except (OSError, subprocess.SubprocessError):
        return ""
    return f" ({commit}{' with changes' if changed else ''})"


def _git(*words: str) -> str:
    made = subprocess.run(["git", "-C", str(ROOT), *words], capture_output=True, text=True, check=True, timeout=10)
    return made.stdout.strip()

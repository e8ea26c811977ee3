"""The service under measurement: the demonstration in a process of its own, with its own ports and data."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgspec

from app.settings import ROOT


@dataclass(frozen=True, slots=True)
class Subject:
    """A running service."""

    process: subprocess.Popen[bytes]
    port: int

    @property
    def feed(self) -> str:
        """The address of the live feed."""
        return f"ws://127.0.0.1:{self.port}/api/v1/live"

    def get(self, path: str) -> Any:
        """A JSON document of the service."""
        with urllib.request.urlopen(f"http://127.0.0.1:{self.port}{path}", timeout=10) as answer:
            return msgspec.json.decode(answer.read())

    def counters(self, kind: str = "radar") -> dict[str, int]:
        """The counters of the first sensor of a kind."""
        sensors = self.get("/api/v1/sensors")["sensors"]
        return dict(next(one for one in sensors if one["kind"] == kind)["counters"])

    def cpu_seconds(self) -> float:
        """Processor time used so far."""
        fields = Path(f"/proc/{self.process.pid}/stat").read_text().rsplit(")", 1)[1].split()
        return (int(fields[11]) + int(fields[12])) / float(os.sysconf("SC_CLK_TCK"))

    def resident_mib(self) -> float:
        """Memory held now."""
        pages = int(Path(f"/proc/{self.process.pid}/statm").read_text().split()[1])
        return pages * os.sysconf("SC_PAGE_SIZE") / 2**20


@contextmanager
def running_demo(within: float = 300.0, **environment: str) -> Iterator[Subject]:
    """Run `airside demo` until the block ends. Raises RuntimeError with its output when it does not come up."""
    with tempfile.TemporaryDirectory(prefix="airside-bench-") as folder:
        output = Path(folder) / "output.txt"
        port, udp_port = _free_port(socket.SOCK_STREAM), _free_port(socket.SOCK_DGRAM)
        inherited = {key: value for key, value in os.environ.items() if not key.startswith("AIRSIDE_")}
        own = {"PORT": port, "DATA_DIR": folder, "DEMO__UDP_PORT": udp_port, "VIEW3D": "false", **environment}
        with output.open("wb") as sink:
            process = subprocess.Popen(
                [sys.executable, "-m", "app", "demo"],
                cwd=ROOT,
                stdout=sink,
                stderr=subprocess.STDOUT,
                env={**inherited, **{f"AIRSIDE_{key}": str(value) for key, value in own.items()}},
            )
        subject = Subject(process, port)
        try:
            _await_ready(subject, time.monotonic() + within, output)
            yield subject
        finally:
            process.send_signal(signal.SIGTERM)
            try:
                process.wait(20)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


def _await_ready(subject: Subject, until: float, output: Path) -> None:
    while time.monotonic() < until:
        if subject.process.poll() is not None:
            break
        try:
            subject.get("/health/ready")
            return
        except (urllib.error.URLError, OSError):
            time.sleep(0.2)
    raise RuntimeError(f"the service did not come up:\n{output.read_text()}")


def _free_port(kind: socket.SocketKind) -> int:
    with socket.socket(socket.AF_INET, kind) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])

"""The whole service in a process of its own, as a user starts it."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import httpx
import pytest

ROOT = Path(__file__).resolve().parent.parent.parent


def free_port(kind: socket.SocketKind = socket.SOCK_STREAM) -> int:
    with socket.socket(socket.AF_INET, kind) as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


@dataclass
class Airside:
    """A running service: its address, its process, where it keeps its data."""

    process: subprocess.Popen[bytes]
    port: int
    udp_port: int
    data: Path
    output: Path

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.port}"

    def get(self, path: str) -> httpx.Response:
        return httpx.get(self.url + path, timeout=10)

    def wait_ready(self, within: float = 180.0) -> None:
        until = time.monotonic() + within
        while time.monotonic() < until:
            if self.process.poll() is not None:
                raise AssertionError(f"the service ended:\n{self.output.read_text()}")
            try:
                if self.get("/health/ready").status_code == 200:
                    return
            except httpx.TransportError:
                pass
            time.sleep(0.2)
        raise AssertionError(f"not ready within {within} s:\n{self.output.read_text()}")

    def end(self, how: signal.Signals = signal.SIGTERM, within: float = 30.0) -> int:
        if self.process.poll() is None:
            self.process.send_signal(how)
        return self.process.wait(within)


def launch(mode: str, data: Path, *words: str, **environment: str) -> Airside:
    """Start `airside MODE` with its own ports and data folder."""
    port, udp_port = free_port(), free_port(socket.SOCK_DGRAM)
    output = data / "output.txt"
    data.mkdir(parents=True, exist_ok=True)
    clean = {key: value for key, value in os.environ.items() if not key.startswith("AIRSIDE_")}
    process = subprocess.Popen(
        [sys.executable, "-m", "app", mode, *words],
        cwd=ROOT,
        stdout=output.open("wb"),
        stderr=subprocess.STDOUT,
        env={
            **clean,
            "AIRSIDE_PORT": str(port),
            "AIRSIDE_DATA_DIR": str(data),
            "AIRSIDE_DEMO__UDP_PORT": str(udp_port),
            "AIRSIDE_DEMO__FIRST_INCIDENT_S": "20",
            "AIRSIDE_VIEW3D": "false",
            **environment,
        },
    )
    return Airside(process, port, udp_port, data, output)


@pytest.fixture(scope="session")
def demo(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Airside]:
    """One demonstration for all tests that only look at it."""
    running = launch("demo", tmp_path_factory.mktemp("demo"))
    try:
        running.wait_ready()
        yield running
    finally:
        running.end()

from __future__ import annotations

import csv
import gzip
import json
import socket
import struct
import threading
import time
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from app.airports import load_airport
from app.assembly import node_site, radar_site
from app.cli import app as command_line
from app.contract import Refused
from app.demo import DemoFeed, demo_settings
from app.demo.feed import VideoChannel
from app.demo.pcap import PcapWriter
from app.demo.scene import demo_world
from app.demo.sender import DatagramSender
from app.demo.traffic import SHIPPED, load_recording, prepare
from app.ingest.recordings import open_recording
from app.settings import Settings, SettingsError, load
from pipeline.airport.model import Airport
from pipeline.asterix.cat240 import VideoMessage, decode
from pipeline.lab.simulate.recording import RecordingError
from pipeline.lab.simulate.video import VideoSimulator
from pipeline.sites import NodeSite, RadarSite
from pipeline.tables import NodeEvents, TargetReports
from tests.pipeline.lab.simulate.test_traffic import row


@cache
def scene() -> tuple[Settings, Airport, RadarSite]:
    settings = demo_settings(load())
    airport, _ = load_airport("LFPO")
    return settings, airport, radar_site(settings.radars[0], airport)


class Listener:
    """Stands in for the service: keeps what it is given."""

    def __init__(self, refuse: bool = False) -> None:
        settings, self.airport, site = scene()
        self.radars: tuple[RadarSite, ...] = (site,)
        self.nodes: tuple[NodeSite, ...] = tuple(node_site(one, self.airport) for one in settings.nodes)
        self.events: list[NodeEvents] = []
        self.reports: list[tuple[float, TargetReports]] = []
        self.refuse = refuse
        self.enough = threading.Event()

    def submit_node_events(self, events: NodeEvents) -> None:
        self.events.append(events)

    def submit_target_reports(self, reports: TargetReports) -> None:
        if self.refuse:
            self.enough.set()
            raise Refused("full")
        self.reports.append((time.time(), reports))
        if sum(len(one) for _, one in self.reports) > 30:
            self.enough.set()


def test_the_settings_name_everything_as_simulated_and_fit_the_airport() -> None:
    settings, airport, site = scene()
    assert settings.mode == "demo"
    assert settings.radars[0].simulated
    assert len(settings.nodes) >= len(airport.holding_positions)
    assert all(one.simulated for one in settings.nodes)
    assert {one.id: one.in_use for one in settings.runways} == {"06/24": "06", "07/25": "07"}
    reach = site.video.first_range_m + site.video.ranges * site.video.range_step_m
    for runway in airport.runways:
        for end in runway.ends:
            assert np.hypot(end.threshold.x - site.east, end.threshold.y - site.north) < reach


def test_an_airport_without_traffic_is_refused_with_words() -> None:
    with pytest.raises(SettingsError, match="LFPO"):
        demo_settings(load().model_copy(update={"airport": "LSZH"}))


def test_every_sweep_becomes_one_datagram_that_fits_and_says_what_it_is() -> None:
    settings, airport, site = scene()
    world = demo_world(settings, 1_700_000_000.0)
    channel = VideoChannel(VideoSimulator(airport, site, 1, start=world.start), world)
    datagrams, lengths = channel.sector(3)
    assert len(lengths) == 64
    assert lengths.max() <= 1472
    (message,) = decode(datagrams[5, : lengths[5]].tobytes())
    assert isinstance(message, VideoMessage)
    amplitude = channel.video.sweeps(0, 192, 256, world.truth)
    assert bytes(message.cells[: site.video.ranges]) == amplitude[5].tobytes()
    _, more = channel.sector(4)
    assert channel.next_message == 128 == len(lengths) + len(more)


def test_the_feed_sends_video_and_hands_out_events_and_reports_in_time() -> None:
    settings, _, site = scene()
    listener = Listener()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as heard:
        heard.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 8 * 1024 * 1024)
        heard.bind(("127.0.0.1", 0))
        heard.settimeout(20.0)
        world = demo_world(settings, time.time())
        feed = DemoFeed(listener, world, port=heard.getsockname()[1])
        feed.start()
        try:
            first = [heard.recv(2048) for _ in range(200)]
            assert listener.enough.wait(30.0)
        finally:
            feed.stop()
    numbers = [struct.unpack(">I", one[one.index(b"\x02", 5) + 1 :][:4])[0] for one in first]
    assert numbers == list(range(numbers[0], numbers[0] + 200))
    counters = feed.counters()
    assert counters["sectors_sent"] > 10
    assert "died" not in counters
    for at, reports in listener.reports:
        assert reports.time.max() <= at + 0.001
    assert counters["target_reports"] == sum(len(one) for _, one in listener.reports)
    assert site.simulated


def test_a_feed_that_falls_behind_leaves_video_out_and_not_reports() -> None:
    settings, _, _ = scene()
    listener = Listener()
    world = demo_world(settings, 1_700_000_000.0)
    feed = DemoFeed(listener, world, port=9, speed=200.0)
    feed.start()
    assert listener.enough.wait(30.0)
    feed.stop()
    counters = feed.counters()
    assert counters["sectors_skipped"] > 0
    times = np.sort(np.concatenate([one.time for _, one in listener.reports]))
    assert np.diff(times).max() <= 1.0


def test_what_the_service_refuses_is_counted() -> None:
    settings, _, _ = scene()
    listener = Listener(refuse=True)
    feed = DemoFeed(listener, demo_world(settings, time.time()), port=9)
    feed.start()
    assert listener.enough.wait(30.0)
    feed.stop()
    assert feed.counters()["refused"] > 0


@pytest.mark.parametrize("portable", [False, True])
def test_the_sender_sends_all_in_order_and_survives_a_closed_port(portable: bool) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as heard:
        heard.bind(("127.0.0.1", 0))
        heard.settimeout(5.0)
        sender = DatagramSender("127.0.0.1", heard.getsockname()[1])
        if portable:
            sender._many = None
        block = np.zeros((50, 1472), np.uint8)
        block[:, 0] = np.arange(50)
        lengths = np.arange(1, 51, dtype=np.int32)
        sender.send(block, lengths)
        got = [heard.recv(2048) for _ in range(50)]
    assert [one[0] for one in got] == list(range(50))
    assert [len(one) for one in got] == lengths.tolist()
    for _ in range(3):
        sender.send(block, lengths)
    assert sender.sent + sender.lost == 200
    assert sender.lost > 0
    sender.close()


def test_the_shipped_record_is_small_attributed_and_says_what_was_left_out() -> None:
    path = SHIPPED / "LFPO.json.gz"
    assert path.stat().st_size < 1_000_000
    document = json.loads(gzip.decompress(path.read_bytes()))
    assert "MIT" in document["attribution"]
    account = document["cleaning"]
    assert account["rows"] == account["kept"] + sum(account["left_out"].values())
    assert (SHIPPED / "ATTRIBUTION.md").is_file()


def test_traffic_command_cleans_and_says_so(tmp_path: Path) -> None:
    source = tmp_path / "rows.json.gz"
    rows = [row(t, 10.0 * t, 50.0) for t in range(120)] + [{"timestamp": 5}]
    for one in rows[:-1]:
        one["latitude"] += 0.02
        one["longitude"] -= 0.04
    source.write_bytes(gzip.compress(json.dumps(rows).encode()))
    output = tmp_path / "out.json.gz"
    arguments = ["simulate", "traffic", str(source), "--icao", "LFPO", "--output", str(output), "--minutes", "2"]
    result = CliRunner().invoke(command_line, arguments)
    assert result.exit_code == 0, result.output
    assert "invalid" in result.output
    airport, _ = load_airport("LFPO")
    assert len(load_recording(str(output), airport).trajectories) == 1


@pytest.mark.parametrize("content", [b"", b"{}", b"[1]", b"[]", b"\x1f\x8bxx", b'[{"timestamp": 1}]'])
def test_files_that_are_no_traffic_are_refused_by_name(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "bad.json.gz"
    path.write_bytes(content)
    airport, _ = load_airport("LFPO")
    with pytest.raises(RecordingError, match=r"bad\.json\.gz"):
        prepare(path, airport, 3600.0, "")
    with pytest.raises(RecordingError):
        load_recording(str(path), airport)


def test_video_command_records_scans_with_the_truth(tmp_path: Path) -> None:
    output = tmp_path / "video.npz"
    result = CliRunner().invoke(command_line, ["simulate", "video", "--seconds", "1", "--output", str(output)])
    assert result.exit_code == 0, result.output
    assert "the detector learns for 12 turns" in " ".join(result.output.split())
    made = np.load(output)
    assert made["scans"].shape == (1, 4096, 1024)
    assert made["t"].tolist() == [1_700_000_000.0]
    # what is read back has the cells of the radar that was simulated, not of a usual one
    assert open_recording(output).site.video.range_step_m == pytest.approx(float(made["range_step_m"]))
    assert float(made["range_step_m"]) == pytest.approx(3.3)
    truth = list(csv.DictReader((tmp_path / "video.truth.csv").open()))
    assert len(truth) > 20
    bad = CliRunner().invoke(command_line, ["simulate", "video", "--output", str(tmp_path / "x.mp4")])
    assert bad.exit_code == 2


def test_video_command_writes_a_capture(tmp_path: Path) -> None:
    output = tmp_path / "video.pcap"
    result = CliRunner().invoke(command_line, ["simulate", "video", "--seconds", "1", "--output", str(output)])
    assert result.exit_code == 0, result.output
    data = output.read_bytes()
    at, count = 24, 0
    while at < len(data):
        _, _, kept, whole = struct.unpack_from("<IIII", data, at)
        assert kept == whole
        packet = data[at + 16 : at + 16 + kept]
        assert packet[12:14] == b"\x08\x00"
        assert packet[23] == 17
        assert packet[42] == 240
        count += 1
        at += 16 + kept
    assert count == 4096


def test_the_capture_has_correct_lengths_and_checksum(tmp_path: Path) -> None:
    path = tmp_path / "one.pcap"
    with PcapWriter(path.open("wb"), 8600) as pcap:
        pcap.write(1.5, b"abc")
    packet = path.read_bytes()[24 + 16 :]
    total = sum(struct.unpack(">10H", packet[14:34]))
    assert (total & 0xFFFF) + (total >> 16) == 0xFFFF
    assert struct.unpack(">HHH", packet[34:40]) == (50000, 8600, 11)
    assert packet[42:] == b"abc"

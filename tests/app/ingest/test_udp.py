"""The receiver on real sockets: unicast, multicast, bad datagrams, a full second of a fast radar, and its end."""

import socket
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager

import numpy as np
import pytest

from app.ingest import socket_kernel
from app.ingest.udp import VideoReceiver, warm
from app.settings import RadarSettings
from app.settings_sources import UdpSettings
from pipeline.asterix.cat240 import encode_message, encode_summary, encode_sweeps
from pipeline.sites import RadarSite
from pipeline.tables import Sweeps, VideoFormat

LIGHT = 299_792_458.0
T0 = 1.7e9


@pytest.fixture(params=["recvmmsg", "recv_into"])
def receiving(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    """Both ways of receiving, where the system has both."""
    if request.param == "recvmmsg" and not socket_kernel.AVAILABLE:
        pytest.skip("no recvmmsg with a known layout on this system")
    if request.param == "recv_into":
        monkeypatch.setattr(socket_kernel, "AVAILABLE", False)
    return str(request.param)


def datagrams(azimuths: int, ranges: int, turns: int, first: int = 0) -> tuple[np.ndarray, list[bytes]]:
    n = azimuths * turns
    amplitude = np.random.default_rng(5).integers(0, 256, (n, ranges), dtype=np.uint8)
    start = np.arange(n) * 2 * np.pi / azimuths
    made, lengths = encode_sweeps(
        amplitude, start, start + 2 * np.pi / azimuths, (time.time() + np.arange(n) / azimuths) % 86400, first,
        sac=0, sic=1, cell_duration_s=6.0 / LIGHT,
    )  # fmt: skip
    return amplitude, [row[:size].tobytes() for row, size in zip(made, lengths, strict=True)]


@contextmanager
def listening(
    azimuths: int, ranges: int, deliver: Callable[[Sweeps], None], **udp: object
) -> Iterator[tuple[VideoReceiver, tuple[str, int]]]:
    settings = RadarSettings(
        id="smr", latitude=0, longitude=0, azimuths=azimuths, ranges=ranges, blocks_per_scan=8,
        udp=UdpSettings(**{"address": "127.0.0.1", "port": 0, **udp}),  # type: ignore[arg-type]
    )  # fmt: skip
    site = RadarSite("smr", 0, 0, 0, VideoFormat(azimuths=azimuths, ranges=ranges))
    receiver = VideoReceiver(site, 2, settings, deliver)
    receiver.start()
    try:
        yield receiver, ("127.0.0.1", receiver.port)
    finally:
        receiver.stop()


def until(reached: Callable[[], bool], limit: float = 10.0) -> None:
    end = time.monotonic() + limit
    while not reached():
        assert time.monotonic() < end, "the receiver did not get there"
        time.sleep(0.005)


def test_sweeps_arrive_as_they_were_sent(receiving: str) -> None:
    amplitude, sent = datagrams(64, 100, 2)
    got: list[Sweeps] = []
    with listening(64, 100, got.append) as (receiver, address), socket.socket(type=socket.SOCK_DGRAM) as out:
        assert receiver.last_heard is None
        for one in sent:
            out.sendto(one, address)
        until(lambda: receiver.counters()["sweeps"] == 128)
        assert receiver.last_heard is not None
        counters = receiver.counters()
    assert np.array_equal(np.concatenate([block.amplitude for block in got]), amplitude)
    assert {block.radar for block in got} == {2}
    assert counters["datagrams"] == 128
    assert counters["octets"] == sum(len(one) for one in sent)
    assert {counters[name] for name in ("lost", "truncated", "malformed", "socket_errors", "deliver_failed")} == {0}


def test_bad_datagrams_are_counted_and_the_rest_goes_on(receiving: str) -> None:
    amplitude, sent = datagrams(64, 16, 1)
    got: list[Sweeps] = []
    bad = [b"", b"\xf0", b"junk", bytes(1000), bytes(60_000), b"\x30" + sent[0][1:], sent[3][:-1]]
    with listening(64, 16, got.append) as (receiver, address), socket.socket(type=socket.SOCK_DGRAM) as out:
        for i, one in enumerate(sent):
            if i % 8 == 4:
                out.sendto(bad[i // 8 % len(bad)], address)
            out.sendto(one, address)
        out.sendto(encode_summary("a radar"), address)
        until(lambda: receiver.counters()["summary"] == 1 and receiver.counters()["sweeps"] == 64)
        counters = receiver.counters()
    assert counters["truncated"] == 0
    assert counters["malformed"] == 4
    assert counters["wrong_category"] == 4
    assert np.array_equal(np.concatenate([block.amplitude for block in got]), amplitude)


def test_the_longest_datagrams_are_taken_whole(receiving: str) -> None:
    """32-bit cells, and padding, make datagrams far longer than the cells of the grid ask for."""
    cells = np.random.default_rng(3).integers(0, 256, (16, 16_000), dtype=np.uint8)
    wide = cells.repeat(4, axis=1)
    wide[:, 1::4] = wide[:, 2::4] = wide[:, 3::4] = 7
    sent = [
        encode_message(one.tobytes(), 16_000, message=i, start=4096 * i, end=(4096 * (i + 1)) % 65536, bits=32,
                       cell_duration=20_013_846)
        for i, one in enumerate(wide)
    ]  # fmt: skip
    sent = [one + bytes(65_507 - len(one)) for one in sent]
    got: list[Sweeps] = []
    with listening(16, 16_000, got.append) as (receiver, address), socket.socket(type=socket.SOCK_DGRAM) as out:
        for i, one in enumerate(sent):
            out.sendto(one, address)
            until(lambda i=i: receiver.counters()["datagrams"] == i + 1)
        until(lambda: receiver.counters()["sweeps"] == 16)
        counters = receiver.counters()
    assert (counters["truncated"], counters["trailing"]) == (0, 16)
    assert np.array_equal(np.concatenate([block.amplitude for block in got]), cells)


def test_what_does_not_fit_is_told(receiving: str, caplog: pytest.LogCaptureFixture) -> None:
    _, sent = datagrams(64, 90, 1)
    with listening(64, 102, print) as (receiver, address), socket.socket(type=socket.SOCK_DGRAM) as out:
        assert receiver.refused.words() == ""
        for one in sent:
            out.sendto(one, address)
        until(lambda: receiver.counters()["datagrams"] == 64 and receiver.refused.words() != "")
    assert receiver.refused.words() == "refused: cells 90, settings say 102"
    (record,) = [one for one in caplog.records if "refused" in one.getMessage()]
    assert "radar smr" in record.getMessage()
    assert "refused: cells 90, settings say 102" in record.getMessage()


def test_only_sources_that_are_named_are_taken_and_others_are_counted_and_told(
    receiving: str, caplog: pytest.LogCaptureFixture
) -> None:
    amplitude, sent = datagrams(64, 16, 1)
    got: list[Sweeps] = []
    named, in_network, stranger = "127.0.0.2", "127.0.1.9", "127.0.0.3"
    with listening(64, 16, got.append, sources=(named, "127.0.1.0/24")) as (receiver, address), ExitStack() as opened:
        out = {}
        for one in (named, in_network, stranger):
            out[one] = opened.enter_context(socket.socket(type=socket.SOCK_DGRAM))
            out[one].bind((one, 0))
        for one in sent:
            out[stranger].sendto(one, address)
        until(lambda: receiver.counters()["refused_source"] == 64 and receiver.refused.words() != "")
        assert receiver.last_heard is None
        assert receiver.refused.words() == "refused: datagrams from 127.0.0.3, which is not among sources"
        for i, one in enumerate(sent):
            out[(named, in_network)[i % 2]].sendto(one, address)
            out[stranger].sendto(one, address)
        until(lambda: receiver.counters()["refused_source"] == 128 and receiver.counters()["sweeps"] == 64)
        until(lambda: receiver.refused.words() == "")
    assert np.array_equal(np.concatenate([block.amplitude for block in got]), amplitude)
    assert receiver.refused.left_out() == "datagrams from 127.0.0.3 are left out: not among sources"
    assert "127.0.0.3" in caplog.text


def test_a_delivery_that_fails_does_not_end_the_feed() -> None:
    _, sent = datagrams(64, 16, 2)
    calls: list[int] = []

    def deliver(block: Sweeps) -> None:
        calls.append(block.scan)
        if len(calls) == 1:
            raise RuntimeError("the first block is not wanted")

    with listening(64, 16, deliver) as (receiver, address), socket.socket(type=socket.SOCK_DGRAM) as out:
        for one in sent[:64]:
            out.sendto(one, address)
        until(lambda: receiver.counters()["datagrams"] == 64)
        for one in sent[64:]:
            out.sendto(one, address)
        until(lambda: 1 in calls)
        assert receiver.counters()["deliver_failed"] == 1


@pytest.mark.skipif(sys.platform != "linux", reason="multicast over loopback as Linux does it")
def test_a_multicast_group_is_joined(receiving: str) -> None:
    amplitude, sent = datagrams(64, 16, 1)
    got: list[Sweeps] = []
    group = "239.255.82.40"
    words = {"address": "0.0.0.0", "group": group, "interface": "127.0.0.1"}
    with listening(64, 16, got.append, **words) as (receiver, _), socket.socket(type=socket.SOCK_DGRAM) as out:
        out.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, socket.inet_aton("127.0.0.1"))
        for one in sent:
            out.sendto(one, (group, receiver.port))
        until(lambda: receiver.counters()["sweeps"] == 64)
    assert np.array_equal(np.concatenate([block.amplitude for block in got]), amplitude)


def test_two_radars_may_share_a_group_but_not_a_port() -> None:
    with listening(64, 16, print) as (first, _):
        with (
            pytest.raises(OSError, match=str(first.port)),
            listening(64, 16, print, port=first.port),
        ):
            pass
        assert first.counters()["socket_errors"] == 0


def test_a_second_of_a_fast_radar_is_taken_without_loss_while_the_interpreter_is_busy() -> None:
    warm()
    _, sent = datagrams(4096, 1024, 2)
    rows: list[int] = []
    done = threading.Event()

    def toil() -> None:
        while not done.is_set():
            sum(range(20_000))

    busy = threading.Thread(target=toil)
    with listening(4096, 1024, lambda block: rows.append(len(block))) as (receiver, address):
        assert receiver._socket is not None
        room = max(33, receiver._socket.getsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF) // 4096)
        busy.start()
        try:
            with socket.socket(type=socket.SOCK_DGRAM) as out:
                for i, one in enumerate(sent):
                    if i % 32 == 0:
                        # no more under way than the buffer that this system grants can hold
                        until(lambda i=i: receiver.counters()["datagrams"] + room > i)
                    out.sendto(one, address)
            until(lambda: receiver.counters()["datagrams"] >= 8192)
        finally:
            done.set()
            busy.join()
        counters = receiver.counters()
    assert counters["socket_overflow"] == counters["lost"] == 0
    assert sum(rows) == 8192


def test_stop_comes_back_in_silence_and_under_fire() -> None:
    _, sent = datagrams(64, 16, 1)
    for loud in (False, True):
        with listening(64, 16, lambda _: None) as (receiver, address), socket.socket(type=socket.SOCK_DGRAM) as out:
            ended = threading.Event()

            def fire(out: socket.socket = out, address: tuple[str, int] = address, e: threading.Event = ended) -> None:
                while not e.is_set():
                    for one in sent:
                        out.sendto(one, address)

            thread = threading.Thread(target=fire)
            if loud:
                thread.start()
                until(lambda r=receiver: r.last_heard is not None)
            receiver.stop()
            assert not any(one.name == "video-smr" for one in threading.enumerate())
            receiver.stop()
            ended.set()
            if loud:
                thread.join()


def test_a_radar_without_udp_has_no_receiver() -> None:
    with pytest.raises(ValueError, match="no udp"):
        VideoReceiver(
            RadarSite("x", 0, 0, 0, VideoFormat()), 0, RadarSettings(id="x", latitude=0, longitude=0, udp=None), print
        )

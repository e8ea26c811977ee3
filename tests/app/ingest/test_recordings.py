"""Recordings: what was recorded comes back, and damaged files end in one clear error."""

import gzip
import socket
import struct
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest
import yaml
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from PIL import Image
from typer.testing import CliRunner

from app.cli import app
from app.ingest.containers.packets import CaptureError
from app.ingest.recordings import Recording, RecordingError, open_recording
from app.ingest.replay import Replayer, datagrams_of
from app.ingest.udp import VideoReceiver
from app.settings import RadarSettings
from app.settings_sources import UdpSettings
from pipeline.asterix.cat240 import encode_sweeps
from pipeline.sites import RadarSite
from pipeline.tables import Sweeps, VideoFormat
from tests.app.ingest.test_udp import until
from tests.support.capture_files import ETHERNET, block, ipv4, ipv6, pcap, pcapng

TURNS, AZIMUTHS, RANGES = 3, 64, 40
T0 = 1_700_000_000.0
VIDEO = np.random.default_rng(11).integers(0, 256, (TURNS, AZIMUTHS, RANGES), dtype=np.uint8)
STEP = 2 * np.pi / AZIMUTHS


def video_of(recording: Recording) -> tuple[np.ndarray, np.ndarray]:
    """(cells of all turns, times of all sweeps)"""
    blocks = list(recording.blocks())
    assert all(isinstance(one, Sweeps) for one in blocks)
    cells = np.concatenate([one.amplitude for one in blocks]).reshape(-1, AZIMUTHS, recording.site.video.ranges)
    assert [one.scan for one in blocks if one.last] == list(range(len(cells)))
    return cells, np.concatenate([one.time for one in blocks])


def cat240() -> list[tuple[float, bytes]]:
    """(capture time, datagram) of VIDEO."""
    n = TURNS * AZIMUTHS
    start = np.arange(n) * STEP
    times = T0 + np.arange(n) / AZIMUTHS
    made, lengths = encode_sweeps(
        VIDEO.reshape(n, RANGES), start, start + STEP, times % 86400, 1, sac=0, sic=1,
        cell_duration_s=6.0 / 299_792_458, start_cell=5,
    )  # fmt: skip
    return [(float(t) + 0.001, row[:size].tobytes()) for t, row, size in zip(times, made, lengths, strict=True)]


CAPTURE = pcap([(t, ETHERNET + ipv4(one)[0]) for t, one in cat240()])


def written(path: Path, octets: bytes) -> Path:
    path.write_bytes(octets)
    return path


def test_an_npz_comes_back(tmp_path: Path) -> None:
    path = tmp_path / "turns.npz"
    np.savez_compressed(path, scans=VIDEO, t=T0 + np.array([0.0, 2.0, 4.1]), range_step_m=6.0)
    recording = open_recording(path, blocks_per_scan=8)
    assert recording.scans == TURNS
    assert (recording.site.video.range_step_m, recording.site.video.period_s) == (6.0, pytest.approx(2.05))
    cells, times = video_of(recording)
    assert np.array_equal(cells, VIDEO)
    assert times[0] == pytest.approx(T0 + 1 / AZIMUTHS)
    assert times[AZIMUTHS] == pytest.approx(T0 + 2 + 2.1 / 2 / AZIMUTHS)
    assert bool(np.all(np.diff(times) > 0))
    again, _ = video_of(recording)
    assert np.array_equal(again, VIDEO)


def test_a_gap_between_turns_does_not_slow_the_turn_before(tmp_path: Path) -> None:
    path = tmp_path / "turns.npz"
    np.savez(path, scans=np.repeat(VIDEO, 2, axis=0), t=T0 + np.array([0, 1, 2, 60, 61, 62]))
    _, times = video_of(open_recording(path))
    assert times[3 * AZIMUTHS - 1] < T0 + 3


def test_four_bit_values_are_stretched(tmp_path: Path) -> None:
    path = tmp_path / "turns.npz"
    np.savez(path, scans=VIDEO >> 4, t=T0 + np.arange(TURNS))
    assert np.array_equal(video_of(open_recording(path))[0], (VIDEO >> 4) * 17)
    mixed = VIDEO.copy()
    mixed[0] >>= 4
    np.savez(path, scans=mixed, t=T0 + np.arange(TURNS))
    with pytest.raises(RecordingError, match="bits: 8"):
        video_of(open_recording(path))
    np.savez(path, scans=mixed, t=T0 + np.arange(TURNS), bits=8)
    assert np.array_equal(video_of(open_recording(path))[0], mixed)


@pytest.mark.parametrize(
    ("columns", "says"),
    [
        ({"t": np.arange(3.0)}, "scans"),
        ({"scans": VIDEO}, "one time"),
        ({"scans": VIDEO, "t": np.arange(2.0)}, "one time"),
        ({"scans": VIDEO, "t": np.array([0.0, 2.0, 1.0])}, "steps back"),
        ({"scans": VIDEO, "t": np.array([0.0, np.nan, 1.0])}, "finite"),
        ({"scans": VIDEO.astype(complex), "t": np.arange(3.0)}, "uint8"),
        ({"scans": VIDEO[0], "t": np.arange(3.0)}, "dimensions"),
        ({"scans": VIDEO[:, :4], "t": np.arange(3.0)}, "4 azimuths"),
        ({"scans": VIDEO, "t": np.arange(3.0), "range_step_m": np.inf}, "range_step_m"),
        ({"scans": VIDEO, "t": np.arange(3.0), "bits": 9}, "bits"),
        ({"scans": VIDEO, "t": np.array(["a", "b", "c"])}, "numbers"),
    ],
)
def test_an_npz_that_does_not_fit_is_refused(tmp_path: Path, columns: dict[str, np.ndarray], says: str) -> None:
    path = tmp_path / "turns.npz"
    np.savez(path, **columns)
    with pytest.raises(RecordingError, match=says) as caught:
        video_of(open_recording(path))
    assert str(path) in str(caught.value)


def test_an_npz_that_claims_terabytes_is_not_believed(tmp_path: Path) -> None:
    path = tmp_path / "turns.npz"
    header = b"{'descr': '|u1', 'fortran_order': False, 'shape': (900000, 65536, 16384), }".ljust(117) + b"\n"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("scans.npy", b"\x93NUMPY\x01\x00" + struct.pack("<H", len(header)) + header)
        archive.writestr("t.npy", b"")
    with pytest.raises(RecordingError):
        open_recording(path)


def images(folder: Path, notes: object, turns: np.ndarray = VIDEO) -> Path:
    folder.mkdir(exist_ok=True)
    for i, turn in enumerate(turns):
        Image.fromarray(turn).save(folder / f"{i:04d}.png")
    (folder / "radar.yaml").write_text(notes if isinstance(notes, str) else yaml.safe_dump(notes))
    return folder


def test_polar_images_come_back(tmp_path: Path) -> None:
    turns = np.concatenate([np.zeros((TURNS, AZIMUTHS, 2), np.uint8), VIDEO], axis=2)
    folder = images(tmp_path / "a", "start: 2023-11-14T22:13:20Z\nperiod_s: 1.5\nskip_columns: 2\nid: smr\n", turns)
    recording = open_recording(folder)
    assert (recording.site.id, recording.scans, recording.site.video.period_s) == ("smr", TURNS, 1.5)
    cells, times = video_of(recording)
    assert np.array_equal(cells, VIDEO)
    assert times[0] == pytest.approx(T0 + 0.75 / AZIMUTHS)
    listed = images(tmp_path / "b", {"times": [T0, T0 + 1, T0 + 2.5]})
    assert video_of(open_recording(listed))[1][2 * AZIMUTHS] == pytest.approx(T0 + 2.5, abs=0.1)


def test_sixteen_bit_images_keep_their_high_bits(tmp_path: Path) -> None:
    folder = images(tmp_path / "a", {"start": T0, "period_s": 1}, VIDEO.astype(np.uint16) * 257)
    assert np.array_equal(video_of(open_recording(folder))[0], VIDEO)


@pytest.mark.parametrize(
    ("notes", "says"),
    [
        ("start: 5\nperiod_s: 1", "between the years"),
        ("start: x\nperiod_s: 1", "neither ISO"),
        ("start: 1700000000", "period_s"),
        ("start: 1700000000\nperiod_s: fast", "period_s"),
        ("start: 1700000000\nperiod_s: 0", "period_s"),
        ("start: 1700000000\nperiod_s: .nan", "period_s"),
        ("times: [1700000000]", "3 images"),
        ("times: [1700000000, 1700000001, 1700000001]", "steps back"),
        ("start: true\nperiod_s: 1", "not a time"),
        ("speriod: 1", "speriod"),
        ("- a", "names"),
        ("a: [", "not YAML"),
        ("!!python/object/apply:os.getcwd []", "not YAML"),
    ],
)
def test_notes_that_do_not_fit_are_refused(tmp_path: Path, notes: str, says: str) -> None:
    with pytest.raises(RecordingError, match=says):
        video_of(open_recording(images(tmp_path / "a", notes)))


def test_images_that_do_not_fit_are_refused(tmp_path: Path) -> None:
    folder = images(tmp_path / "a", {"start": T0, "period_s": 1})
    (folder / "0002.png").write_bytes((folder / "0002.png").read_bytes()[:-40])
    with pytest.raises(RecordingError, match=r"0002\.png"):
        video_of(open_recording(folder))
    Image.fromarray(VIDEO[0][:, :30]).save(folder / "0002.png")
    with pytest.raises(RecordingError, match="first image"):
        video_of(open_recording(folder))
    Image.new("RGB", (40, 64), "red").save(folder / "0002.png")
    with pytest.raises(RecordingError, match="RGB"):
        video_of(open_recording(folder))
    (folder / "more.yaml").write_text("")
    with pytest.raises(RecordingError, match="one YAML"):
        open_recording(folder)


def framed(link: int, payload: bytes) -> bytes:
    (packet,) = ipv4(payload)
    return {
        1: ETHERNET + packet,
        1001: bytes(12) + b"\x81\x00\x00\x05\x88\xa8\x00\x07\x08\x00" + packet,
        1006: bytes(12) + b"\x86\xdd" + ipv6(payload),
        0: b"\x02\0\0\0" + packet,
        101: packet,
        229: ipv6(payload),
        113: bytes(14) + b"\x08\x00" + packet,
        276: b"\x08\x00" + bytes(18) + packet,
    }[link]


@pytest.mark.parametrize("link", [0, 1, 1001, 1006, 101, 113, 229, 276])
@pytest.mark.parametrize("kind", ["pcap <", "pcap >", "pcap < nano", "pcapng <", "pcapng >"])
def test_a_capture_comes_back(tmp_path: Path, link: int, kind: str) -> None:
    number = link if link < 1000 else 1
    frames = [(t, framed(link, one) + b"padding" * (link == 1)) for t, one in cat240()]
    form, order = kind.split()[:2]
    octets = pcapng(frames, number, order) if form == "pcapng" else pcap(frames, number, order, "nano" in kind)
    recording = open_recording(written(tmp_path / "a.pcap", octets), blocks_per_scan=8)
    video = recording.site.video
    assert (video.azimuths, video.ranges) == (AZIMUTHS, RANGES)
    assert (video.range_step_m, video.first_range_m) == (pytest.approx(3, rel=1e-6), pytest.approx(15, rel=1e-6))
    assert video.period_s == pytest.approx(1.0, abs=0.02)
    cells, times = video_of(recording)
    assert np.array_equal(cells, VIDEO)
    assert np.allclose(times, T0 + np.arange(len(times)) / AZIMUTHS, atol=1 / 128)
    assert recording.counters["lost"] == 0


def test_what_is_not_video_is_counted(tmp_path: Path) -> None:
    noise = [
        ETHERNET + ipv4(b"x", proto=6)[0], ETHERNET[:12] + b"\x08\x06" + bytes(28), ETHERNET, b"", ETHERNET + b"\x45",
        ETHERNET + ipv4(b"x" * 50)[0][:-9], ETHERNET + ipv4(b"hello", port=53)[0],
    ]  # fmt: skip
    frames = [(t, ETHERNET + ipv4(one)[0]) for t, one in cat240()]
    octets = pcap([*[(T0, one) for one in noise], *frames])
    recording = open_recording(written(tmp_path / "a.pcap", octets), port=8600)
    assert np.array_equal(video_of(recording)[0], VIDEO)
    assert (recording.counters["other_port"], recording.counters["damaged"]) == (1, 2)
    assert recording.counters["not_udp"] == 4


def test_a_capture_that_was_killed_gives_what_is_there(tmp_path: Path) -> None:
    recording = open_recording(written(tmp_path / "a.pcap", CAPTURE[:-5]))
    blocks = list(recording.blocks())
    assert sum(len(one) for one in blocks) == TURNS * AZIMUTHS - 1
    assert recording.counters["cut_off"] == 1


@pytest.mark.parametrize(
    ("name", "octets", "says"),
    [
        ("a.pcap", b"", "empty"),
        ("a.pcap", b"hello, world", "neither .npz, pcap, pcapng .*68 65 6c 6c"),
        ("a.pcap", CAPTURE[:20], "header"),
        ("a.pcap", CAPTURE[:24], "no CAT240"),
        ("a.pcap", CAPTURE[:24] + b"\xff" * 40, "damaged"),
        ("a.pcap", pcap([(T0, ETHERNET + ipv4(b"hello")[0])]), "wrong_category 1"),
        ("a.pcapng", pcapng([])[:28] + b"\1\0\0\0\3\0\0\0", "damaged"),
        ("a.npz", b"junk", "npz"),
        ("a.txt", b"", "neither"),
    ],
)
def test_files_of_another_kind_are_refused_by_name(tmp_path: Path, name: str, octets: bytes, says: str) -> None:
    path = written(tmp_path / name, octets)
    with pytest.raises((RecordingError, CaptureError), match=says) as caught:
        list(open_recording(path).blocks())
    assert name in str(caught.value)


def test_a_file_that_is_no_recording_is_refused_though_its_radar_is_known(tmp_path: Path) -> None:
    site = RadarSite("smr", 0, 0, 0, VideoFormat(azimuths=64, ranges=40, range_step_m=3.0, first_range_m=0.0))
    with pytest.raises(RecordingError, match=r"a\.txt: neither"):
        list(open_recording(written(tmp_path / "a.txt", b"hello"), site=site).blocks())


def test_a_missing_file_is_refused_by_name(tmp_path: Path) -> None:
    for name in ("no.npz", "no.pcap", "no"):
        with pytest.raises(RecordingError, match=name):
            open_recording(tmp_path / name)


def npz_octets() -> bytes:
    import io

    out = io.BytesIO()
    np.savez_compressed(out, scans=VIDEO[:2], t=T0 + np.arange(2))
    return out.getvalue()


SEEDS = {
    "a.ast": b"".join(one for _, one in cat240()[:30]),
    "a.pcap.gz": gzip.compress(CAPTURE[:4000]),
    "simple.pcapng": pcapng([])
    + b"".join(block(3, struct.pack("<I", len(one) + 42) + ETHERNET + ipv4(one)[0]) for _, one in cat240()[:30]),
    "a.npz": npz_octets(),
    "a.pcap": CAPTURE[:4000],
    "a.pcapng": pcapng([(t, ETHERNET + ipv4(one, cut=64)[0]) for t, one in cat240()[:30]]),
}


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    name=st.sampled_from(sorted(SEEDS)), cut=st.integers(0, 4000),
    edits=st.lists(st.tuples(st.integers(0, 10_000), st.integers(0, 255)), max_size=12),
)  # fmt: skip
def test_damaged_files_give_blocks_or_one_clear_error(
    tmp_path: Path, name: str, cut: int, edits: list[tuple[int, int]]
) -> None:
    octets = bytearray(SEEDS[name])
    for at, value in edits:
        octets[at % len(octets)] = value
    path = written(tmp_path / name, bytes(octets[: len(octets) - cut] if cut % 3 == 0 else octets))
    try:
        rows = sum(len(one) for one in open_recording(path).blocks())
    except RecordingError as error:
        assert name in str(error)  # noqa: PT017
    else:
        assert rows > 0


class Once:
    """A receiver that keeps what it is given."""

    def __init__(self, video: VideoFormat, udp: UdpSettings | None = None) -> None:
        self.blocks: list[Sweeps] = []
        udp = udp or UdpSettings(address="127.0.0.1", port=0)
        radar = RadarSettings(id="smr", latitude=0, longitude=0, blocks_per_scan=8, udp=udp)
        self.receiver = VideoReceiver(RadarSite("smr", 0, 0, 0, video), 0, radar, self.blocks.append)


def test_a_recording_is_replayed_to_a_receiver(tmp_path: Path) -> None:
    path = tmp_path / "turns.npz"
    np.savez(path, scans=VIDEO, t=T0 + np.arange(TURNS) * 1.0, range_step_m=3.0, first_range_m=30.0)
    recording = open_recording(path)
    once = Once(recording.site.video)
    once.receiver.start()
    try:
        replayer = Replayer(recording, ("127.0.0.1", once.receiver.port), speed=20)
        replayer.run(lambda _: None)
        until(lambda: once.receiver.counters()["sweeps"] == TURNS * AZIMUTHS)
    finally:
        once.receiver.stop()
    assert replayer.sent == TURNS * AZIMUTHS
    assert np.array_equal(np.concatenate([one.amplitude for one in once.blocks]), VIDEO.reshape(-1, RANGES))
    times = np.concatenate([one.time for one in once.blocks])
    assert times[-1] - times[0] == pytest.approx(TURNS - 1 / AZIMUTHS, abs=0.02)


@pytest.mark.skipif(sys.platform != "linux", reason="multicast over loopback as Linux does it")
def test_a_recording_is_replayed_to_a_group_by_the_interface_of_the_radar(tmp_path: Path) -> None:
    path = tmp_path / "turns.npz"
    np.savez(path, scans=VIDEO, t=T0 + np.arange(TURNS) * 1.0, range_step_m=3.0, first_range_m=30.0)
    recording = open_recording(path)
    group = UdpSettings(address="0.0.0.0", port=0, group="239.255.82.41", interface="127.0.0.1")
    once = Once(recording.site.video, group)
    once.receiver.start()
    try:
        address = ("239.255.82.41", once.receiver.port)
        Replayer(recording, address, speed=20, interface="127.0.0.1").run(lambda _: None)
        until(lambda: once.receiver.counters()["sweeps"] == TURNS * AZIMUTHS)
    finally:
        once.receiver.stop()
    with pytest.raises(OSError):
        Replayer(recording, address, interface="nowhere")


def test_replayed_datagrams_fit_the_grid_they_come_from() -> None:
    video = VideoFormat(azimuths=AZIMUTHS, ranges=RANGES, range_step_m=3.3, first_range_m=0.0)
    row = np.arange(AZIMUTHS, dtype=np.int32)
    block = Sweeps(0, 0, row, (row + 0.5) * STEP, T0 + row / AZIMUTHS, VIDEO[0])
    made, lengths = datagrams_of(block, video, 5.0, 9)
    assert len(made) == len(lengths) == AZIMUTHS


def test_the_command_says_what_is_wrong(tmp_path: Path) -> None:
    run = CliRunner().invoke
    assert run(app, ["replay", "--help"]).exit_code == 0
    path = tmp_path / "turns.npz"
    np.savez(path, scans=VIDEO, t=T0 + np.arange(TURNS))
    config = tmp_path / "a.toml"
    config.write_text('[[radars]]\nid = "smr"\nlatitude = 48\nlongitude = 2\n')
    for words, says in [
        ([str(tmp_path / "no.npz")], "no such"),
        ([str(path), "--to", "tcp://x"], "must look like"),
        ([str(path), "--to", "udp://x:99999"], "must look like"),
        ([str(path), "--radar", "nope", "-s", str(config)], "no radar is called"),
        ([str(path), "-s", str(config)], "ranges = 40"),
    ]:
        result = run(app, ["replay", *words])
        assert result.exit_code == 2
        assert says in result.output


def test_the_command_sends(tmp_path: Path) -> None:
    path = written(tmp_path / "a.pcap", CAPTURE)
    with socket.socket(type=socket.SOCK_DGRAM) as listener:
        listener.bind(("127.0.0.1", 0))
        port = listener.getsockname()[1]
        result = CliRunner().invoke(app, ["replay", str(path), "--speed", "1000", "--to", f"udp://127.0.0.1:{port}"])
        assert result.exit_code == 0, result.output
        assert f"{TURNS * AZIMUTHS} datagrams sent" in result.output
        listener.settimeout(5)
        assert listener.recv(2048)[0] == 240

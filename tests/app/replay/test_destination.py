"""Where a recording is sent, and as whose: kept, filled in, or rewritten; never sent to be refused."""

import socket
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from app.cli import app
from app.ingest.recordings import open_recording
from app.replay.destination import Destination, find_destination, source_to_send
from app.settings import RadarSettings, Settings, SettingsError
from app.settings_sources import UdpSettings
from pipeline.asterix.cat240 import VideoMessage, decode
from tests.app.ingest.test_capture_sources import AZIMUTHS, RANGES, T0, VIDEO, capture, sent


def radar(sac: int | None = None, sic: int | None = None, **words: object) -> Destination:
    settings = RadarSettings(
        id="smr",
        latitude=48,
        longitude=2,
        udp=UdpSettings(sac=sac, sic=sic),
        **words,  # type: ignore[arg-type]
    )
    return find_destination(Settings(radars=(settings,)), None, None)


@pytest.fixture(scope="module")
def capture_3_4(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return capture(tmp_path_factory.mktemp("captures") / "a.pcap", sent())


@pytest.fixture(scope="module")
def npz(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("npz") / "a.npz"
    np.savez(path, scans=np.stack([VIDEO] * 2), t=T0 + np.arange(2))
    return path


@pytest.mark.parametrize(
    ("to", "source"),
    [(radar(), (3, 4)), (radar(3, 4), (3, 4)), (radar(sic=4), (3, 4)), (Destination(("127.0.0.1", 1), None), (3, 4))],
)
def test_a_capture_keeps_its_source(capture_3_4: Path, to: Destination, source: tuple[int, int]) -> None:
    assert source_to_send(open_recording(capture_3_4), to, (None, None), False, True) == source


@pytest.mark.parametrize(("sac", "sic"), [(5, 7), (3, 7), (5, None), (None, 0)])
def test_a_source_that_the_radar_would_refuse_is_not_sent_unless_rewritten(
    capture_3_4: Path, sac: int | None, sic: int | None
) -> None:
    recording, to = open_recording(capture_3_4), radar(sac, sic)
    with pytest.raises(SettingsError, match=r"takes only .* recording of SAC 3 SIC 4.*--rewrite-source"):
        source_to_send(recording, to, (None, None), False, True)
    rewritten = (3 if sac is None else sac, 4 if sic is None else sic)
    assert source_to_send(recording, to, (None, None), True, True) == rewritten
    assert source_to_send(recording, to, (None, None), False, False) == (3, 4), "elsewhere it may go as it is"


def test_what_has_no_source_is_sent_as_the_radar_wants_it(npz: Path) -> None:
    recording = open_recording(npz)
    assert recording.source is None
    assert source_to_send(recording, radar(5, 7), (None, None), False, True) == (5, 7)
    assert source_to_send(recording, radar(), (None, None), False, True) == (0, 1)
    assert source_to_send(recording, radar(), (8, None), False, True) == (8, 1)
    with pytest.raises(SettingsError, match="SAC 8"):
        source_to_send(recording, radar(5, 7), (8, None), False, True)


def test_there_must_be_something_to_rewrite_to(capture_3_4: Path) -> None:
    for to in (radar(), Destination(("127.0.0.1", 1), None)):
        with pytest.raises(SettingsError, match="--rewrite-source"):
            source_to_send(open_recording(capture_3_4), to, (None, None), True, True)


def test_a_radar_that_resamples_takes_other_cells(capture_3_4: Path) -> None:
    recording = open_recording(capture_3_4)
    words = {"azimuths": AZIMUTHS, "ranges": 2 * RANGES, "range_step_m": 1.5}
    with pytest.raises(SettingsError, match="would refuse"):
        radar(**words).must_fit(recording)  # type: ignore[arg-type]
    radar(**words, resample=True).must_fit(recording)  # type: ignore[arg-type]
    with pytest.raises(SettingsError, match="would refuse"):
        radar(**{**words, "azimuths": 4096}, resample=True).must_fit(recording)  # type: ignore[arg-type]


@pytest.mark.parametrize(("words", "source"), [((), (3, 4)), (("--rewrite-source",), (5, 7))])
def test_the_command_sends_what_it_says(
    tmp_path: Path, capture_3_4: Path, words: tuple[str, ...], source: tuple[int, int]
) -> None:
    with socket.socket(type=socket.SOCK_DGRAM) as listener:
        listener.bind(("127.0.0.1", 0))
        listener.settimeout(5)
        port = listener.getsockname()[1]
        config = tmp_path / "a.toml"
        config.write_text(
            f'[[radars]]\nid = "smr"\nlatitude = 48\nlongitude = 2\nazimuths = {AZIMUTHS}\nranges = {RANGES}\n'
            f"[radars.udp]\nport = {port}\nsac = 5\nsic = 7\n"
        )
        to = () if words else ("--to", f"udp://127.0.0.1:{port}")
        line = ["replay", str(capture_3_4), "--speed", "1000", "-s", str(config), *words, *to]
        done = CliRunner().invoke(app, line, env={"COLUMNS": "300"})
        assert done.exit_code == 0, done.output
        assert f"384 datagrams sent as SAC {source[0]} SIC {source[1]}" in done.output
        (message,) = decode(listener.recv(65536))
        assert isinstance(message, VideoMessage)
        assert (message.sac, message.sic) == source
        refused = CliRunner().invoke(app, ["replay", str(capture_3_4), "-s", str(config)], env={"COLUMNS": "300"})
        assert refused.exit_code == 2
        assert "takes only SAC 5 SIC 7" in refused.output

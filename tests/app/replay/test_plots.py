"""`airside replay --headless` on radar video: it says while the detector learns, and goes on with --loop."""

from pathlib import Path

import numpy as np
import pytest
from rich.console import Console
from typer.testing import CliRunner

from app.cli import app
from app.ingest.recordings import open_recording
from app.replay.plots import print_plots
from app.settings import PartSettings, PartsSettings, Settings

T0 = 1_700_000_000.0


@pytest.fixture(scope="module")
def video(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Five turns of noise with one steady target that moves a little."""
    scans = np.random.default_rng(5).integers(20, 60, (5, 64, 80), dtype=np.uint8)
    for i in range(5):
        scans[i, 20:23, 30 + 2 * i : 34 + 2 * i] = 250
    path = tmp_path_factory.mktemp("video") / "a.npz"
    np.savez(path, scans=scans, t=T0 + np.arange(5))
    return path


def settings(learn: int) -> Settings:
    return Settings(parts=PartsSettings(detect=PartSettings(name="adaptive", learn_scans=learn)))  # type: ignore[call-arg]


def printed(video: Path, learn: int, lines: int = 0) -> list[str]:
    """What is printed; at most so many lines, as when a user interrupts it."""
    console = Console(record=True, width=200, quiet=False, file=open("/dev/null", "w"))  # noqa: SIM115
    plain = console.print
    seen: list[str] = []

    def watched(text: str, **words: object) -> None:
        plain(text, **words)  # type: ignore[arg-type]
        seen.append(text)
        if lines and len(seen) == lines:
            raise KeyboardInterrupt

    console.print = watched  # type: ignore[method-assign, assignment]
    if lines:
        with pytest.raises(KeyboardInterrupt):
            print_plots(console, open_recording(video), settings(learn), loop=True)
    else:
        print_plots(console, open_recording(video), settings(learn), loop=False)
    return seen


def test_it_says_how_far_the_learning_is(video: Path) -> None:
    told = printed(video, 3)
    assert [one.rsplit("  ", 1)[1] for one in told[:3]] == [f"learning, {i} of 3 turns" for i in (1, 2, 3)]
    assert all("plots" in one for one in told[3:])
    assert len(told) == 5


def test_a_recording_that_is_too_short_says_what_to_do(video: Path) -> None:
    told = printed(video, 12)
    assert "learning, 5 of 12 turns" in told[4]
    assert "--loop" in told[5]


def test_with_loop_it_goes_on_past_the_learning(video: Path) -> None:
    told = printed(video, 12, lines=23)
    assert [int(one.split()[1]) for one in told] == list(range(23))
    times = [float(one.split()[2]) for one in told]
    assert np.allclose(np.diff(times), 1.0, atol=0.02)
    assert all("learning" in one for one in told[:12])
    assert all("plots" in one for one in told[12:])


def test_the_command_hands_the_wish_on(video: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[bool] = []
    monkeypatch.setattr("app.replay.plots.print_plots", lambda *words: asked.append(words[3]))
    for line in (["--headless"], ["--headless", "--loop"]):
        assert CliRunner().invoke(app, ["replay", str(video), *line]).exit_code == 0
    assert asked == [False, True]

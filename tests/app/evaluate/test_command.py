"""`airside evaluate`: same seed, same figures; every way to call it; what it writes."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner, Result

import pipeline.lab.evaluate
from app.cli import app
from app.evaluate.recorded import recorded_video
from app.evaluate.runs import carry_out
from app.evaluate.words import duration, figure, plain
from app.ingest.recording import RecordingError
from app.kernel_cache import ROOT
from tests.pipeline.lab.evaluate.checks import check, read_strictly
from tests.pipeline.lab.evaluate.toy import TOYS, Circumstance, Toy

COMMAND = CliRunner()


@pytest.fixture(autouse=True)
def toys(monkeypatch: pytest.MonkeyPatch) -> None:
    only_toys(monkeypatch, *TOYS)


def only_toys(monkeypatch: pytest.MonkeyPatch, *names: str) -> None:
    monkeypatch.setattr(pipeline.lab.evaluate, "experiments", lambda: {name: TOYS[name] for name in names})


def evaluate(*words: str | Path) -> Result:
    return COMMAND.invoke(app, ["evaluate", *map(str, words)], catch_exceptions=False)


def recording(path: Path, **more: Any) -> Path:
    scans = np.random.default_rng(3).integers(0, 16, (5, 64, 40), dtype=np.uint8)
    np.savez(path, **{"scans": scans, "t": 100.0 + 2.4 * np.arange(5), **more})
    return path


@pytest.mark.parametrize(("jobs", "backend"), [(2, "loky"), (3, "loky"), (1, "threading"), (2, "threading")])
def test_same_seed_same_figures_on_any_number_of_processes(jobs: int, backend: Any) -> None:
    alone = carry_out("toy", Toy(), seed=7, jobs=1)
    many = carry_out("toy", Toy(), seed=7, jobs=jobs, backend=backend)
    assert [one["mean"] for one in many.results] == [one["mean"] for one in alone.results]
    assert [(row.measured, row.low, row.high) for row in many.rows[:-1]] == [
        (row.measured, row.low, row.high) for row in alone.rows[:-1]
    ]
    assert [one["mean"] for one in carry_out("toy", Toy(), seed=8).results] != [one["mean"] for one in alone.results]


def test_a_trial_draws_the_same_whatever_the_number_of_trials() -> None:
    few, more = (carry_out("toy", Toy(trials=trials), seed=5) for trials in (3, 9))
    assert [one["mean"] for one in few.results] == [one["mean"] for one in more.results[:3]]
    expected = np.random.default_rng([5, 2]).rayleigh(size=2000).mean()
    assert few.results[2]["mean"] == expected


def test_processes_work_in_one_thread_with_the_compiled_kernels() -> None:
    run = carry_out("circumstance", Circumstance(), jobs=2)
    assert {str(one["threads"]) for one in run.results} == {"1"}
    assert {str(one["cache"]) for one in run.results} == {os.environ["NUMBA_CACHE_DIR"]}
    assert os.getpid() not in {int(one["process"]) for one in run.results}


def test_progress_counts_every_trial() -> None:
    heard: list[int] = []
    carry_out("toy", Toy(trials=5), done=heard.append)
    assert heard == [1, 2, 3, 4, 5]


def test_the_table_tells_what_was_found_and_how() -> None:
    result = evaluate("toy", "--jobs", 1, "--seed", 4)
    assert result.exit_code == 0
    words = ("Mean of Rayleigh", "Rayleigh 1880, <eq. 1>", "averaged | linearly", "draws = 2000", "seed 4", "12 trials")
    for word in (
        *words,
        "reproduced",
        "beaten",
        "not reproduced",
        "no figure in the paper",
        "NOT MET",
        "≥ 88",
        "≤ 1e-6",
    ):
        assert word in result.output, word


def test_the_json_is_strict_and_as_documented(tmp_path: Path) -> None:
    assert evaluate("toy", "--jobs", 1, "--seed", 4, "--trials", 3, "--json", tmp_path / "toy.json").exit_code == 0
    document = read_strictly(tmp_path / "toy.json")
    check(document)
    assert (document["experiment"], document["seed"], document["trials"]) == ("toy", 4, 3)
    assert document["settings"] == {"draws": 2000, "snr_db": [19.5, 20.5]}
    rows = document["rows"]
    assert [row["verdict"] for row in rows[:4]] == [
        "reproduced", "beaten", "not reproduced", "no figure in the paper"
    ]  # fmt: skip
    assert [row["met"] for row in rows] == [None, True, False, True, None]
    assert rows[4]["measured"] is None
    assert rows[4]["ci95"] == [None, None]


def test_the_same_call_writes_the_same_document(tmp_path: Path) -> None:
    for name, jobs in (("a", 1), ("b", 2)):
        evaluate("toy", "--jobs", jobs, "--json", tmp_path / name)
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


def test_all_leaves_out_what_needs_a_recording_and_says_so(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    only_toys(monkeypatch, "toy", "filmed")
    result = evaluate("all", "--quick", "--jobs", 1, "--json", tmp_path / "all.json")
    assert result.exit_code == 0
    assert "filmed is left out: it needs a recording" in result.output
    (only,) = read_strictly(tmp_path / "all.json")
    check(only)
    assert only["trials"] == 4
    with_file = evaluate(
        "all", "--quick", "--jobs", 1, "--file", recording(tmp_path / "turns.npz"), "--json", tmp_path / "b"
    )
    assert with_file.exit_code == 0
    assert [one["experiment"] for one in read_strictly(tmp_path / "b")] == ["toy", "filmed"]


def test_all_goes_on_after_a_failure_and_ends_with_an_error(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    only_toys(monkeypatch, "failing", "toy")
    result = evaluate("all", "--jobs", 1, "--json", tmp_path / "all.json", "--markdown", tmp_path / "all.md")
    assert result.exit_code == 1
    assert "failing: trial 2 failed: ValueError: no echo came back" in result.stderr
    assert [one["experiment"] for one in read_strictly(tmp_path / "all.json")] == ["toy"]
    assert "- failing failed" in (tmp_path / "all.md").read_text()


def test_a_trial_that_fails_in_another_process_is_told_with_its_traceback() -> None:
    result = evaluate("failing", "--jobs", 2)
    assert result.exit_code == 1
    assert "failing: trial 2 failed: ValueError: no echo came back" in result.stderr
    assert "toy.py" in result.stderr


def test_a_process_that_ends_is_told() -> None:
    result = evaluate("dying", "--jobs", 2, "--trials", 2)
    assert result.exit_code == 1
    assert "dying: TerminatedWorkerError" in result.stderr


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["toyy"], "did you mean 'toy'?"),
        (["xyz"], "there are: all, circumstance, dying"),
        ([], "say which experiment"),
        (["toy", "--jobs", "0"], "--jobs"),
        (["toy", "--trials", "0"], "--trials"),
        (["toy", "--trials", "many"], "--trials"),
        (["toy", "--seed", "-1"], "--seed"),
        (["toy", "--backend", "spark"], "there are loky, threading, dask"),
        (["filmed"], "name one with --file"),
        (["filmed", "--file", "nowhere.npz"], "nowhere.npz"),
        (["toy", "--json", "nowhere/toy.json"], "its folder does not exist"),
        (["toy", "--markdown", "."], "is a folder"),
        (["toy", "--report", __file__], "is a file"),
    ],
)
def test_what_cannot_be_done_is_told_before_anything_runs(words: list[str], told: str) -> None:
    result = evaluate(*words)
    assert result.exit_code == 2
    assert told in result.stderr
    assert "Traceback" not in result.output


def test_a_folder_that_cannot_be_written_to_is_told_before_anything_runs(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "access", lambda path, mode: False)
    result = evaluate("toy", "--json", "toy.json")
    assert result.exit_code == 2
    assert "cannot be written to" in result.stderr


def test_figures_that_fail_cost_nothing_but_themselves(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    only_toys(monkeypatch, "toy", "undrawn")
    result = evaluate("all", "--jobs", 1, "--report", tmp_path)
    assert result.exit_code == 1
    assert "could not be carried out: undrawn" in result.stderr
    page = (tmp_path / "all.html").read_text(encoding="utf-8")
    assert "undrawn: the figures failed: ValueError: no &lt;ink&gt;" in page
    assert page.count("<figure>") == len(Toy().figures([]))


def test_a_recording_may_have_any_name(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    only_toys(monkeypatch, "filmed")
    path = recording(tmp_path / os.fsdecode(b"caf\xe9.npz"))
    result = evaluate("filmed", "--jobs", 1, "--file", path, "--json", tmp_path / "a", "--markdown", tmp_path / "b")
    assert result.exit_code == 0, result.stderr
    assert read_strictly(tmp_path / "a")["settings"]["video"] == "caf\ufffd.npz"


def test_a_recording_for_an_experiment_that_takes_none(tmp_path: Path) -> None:
    result = evaluate("toy", "--file", recording(tmp_path / "turns.npz"))
    assert result.exit_code == 2
    assert "leave out --file" in result.stderr


def test_without_dask_it_is_told_how_to_get_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    result = evaluate("toy", "--backend", "dask")
    assert result.exit_code == 2
    assert "[cluster]" in result.stderr


def test_dask_gives_the_same_figures() -> None:
    pytest.importorskip("distributed", reason="dask is not installed: its backend was not tried")
    alone, cluster = carry_out("toy", Toy(), seed=7), carry_out("toy", Toy(), seed=7, jobs=2, backend="dask")
    assert [one["mean"] for one in cluster.results] == [one["mean"] for one in alone.results]


def test_the_list_tells_every_experiment() -> None:
    result = evaluate("--list")
    assert result.exit_code == 0
    assert "Mean of Rayleigh amplitudes" in result.output
    assert "works on a recording" in result.output


def test_the_markdown_tells_how_it_was_made_and_what_falls_short(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    only_toys(monkeypatch, "toy")
    assert evaluate("all", "--jobs", 1, "--quick", "--markdown", tmp_path / "page.md").exit_code == 0
    text = (tmp_path / "page.md").read_text(encoding="utf-8")
    assert "- Command: `airside evaluate all --seed 1 --jobs 1 --quick`" in text
    assert "- Machine: " in text
    assert "| [toy](#toy) | 5 | 1 | 1 | 1 | 2 | 1 | 4 |" in text
    short = text[text.index("## What falls short") : text.index("## toy")]
    assert short.count("\n| toy |") == 1
    assert r"of a target \| beside another" in short
    for line in text.splitlines():
        if line.startswith("|"):
            assert line.replace(r"\|", "").count("|") == line.replace(r"\|", "").rstrip("|").count("|") + 1


def test_a_recording_is_handed_over_as_it_is(tmp_path: Path) -> None:
    video = recorded_video(recording(tmp_path / "a.npz", range_step_m=np.float64(3.75), first_range_m=30.0))
    assert (video.scans.shape, video.bits, video.range_step_m, video.first_range_m) == ((5, 64, 40), 4, 3.75, 30.0)
    assert video.scans.max() == 15
    assert not video.scans.flags.writeable
    wide = np.full((2, 32, 16), 4000, np.uint16)
    video = recorded_video(recording(tmp_path / "b.npz", scans=wide, t=np.arange(2.0)))
    assert (video.scans.dtype, video.bits) == (np.uint16, 12)
    assert recorded_video(recording(tmp_path / "c.npz", bits=8)).bits == 8


@pytest.mark.parametrize(
    ("more", "told"),
    [
        ({"scans": np.zeros((5, 64), np.uint8)}, "3 dimensions"),
        ({"scans": np.zeros((5, 0, 0), np.uint8)}, "3 dimensions"),
        ({"scans": np.zeros((5, 64, 40), np.float32)}, "uint8 or uint16"),
        ({"t": np.arange(4.0)}, "one time for each"),
        ({"t": np.zeros(5)}, "steps back"),
        ({"t": np.array(["a"] * 5)}, "one time for each"),
        ({"bits": 3}, "bits says 3"),
        ({"bits": 9}, "bits says 9"),
        ({"range_step_m": -1.0}, "range_step_m"),
    ],
)
def test_a_bad_recording_is_refused_with_the_reason(tmp_path: Path, more: dict[str, Any], told: str) -> None:
    with pytest.raises(RecordingError, match=told):
        recorded_video(recording(tmp_path / "bad.npz", **more))


def test_files_that_are_no_recording(tmp_path: Path) -> None:
    (tmp_path / "text.npz").write_text("not a recording")
    np.savez(tmp_path / "other.npz", x=np.zeros(3))
    np.save(tmp_path / "array.npy", np.zeros(3))
    for name in ("text.npz", "other.npz", "array.npy"):
        with pytest.raises(RecordingError, match=name):
            recorded_video(tmp_path / name)


def test_an_interrupt_ends_it_cleanly(tmp_path: Path) -> None:
    script = (
        "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "import app, pipeline.lab.evaluate\n"
        "from tests.pipeline.lab.evaluate.toy import Slow\n"
        "pipeline.lab.evaluate.experiments = lambda: {'slow': Slow}\n"
        "from app.cli import app as command\n"
        f"command(['evaluate', 'slow', '--trials', '1000', '--jobs', '2', '--json', {str(tmp_path / 'x.json')!r}])\n"
    )
    with subprocess.Popen(
        [sys.executable, "-c", script], cwd=ROOT, stderr=subprocess.PIPE, text=True, start_new_session=True
    ) as process:
        assert process.stderr is not None
        assert "1000 trials" in process.stderr.readline()  # told just before the processes are started
        os.killpg(process.pid, signal.SIGINT)
        told = process.stderr.read()
        assert process.wait() == 130
    assert told == "airside: stopped; nothing is written\n"
    assert not (tmp_path / "x.json").exists()


def test_figures_in_words() -> None:
    assert [figure(one) for one in (None, float("nan"), 0.0, 92.34567, 1e-6, 3.1e-12, 12345.6, 2e6, float("inf"))] == [
        "–", "–", "0", "92.35", "1e-6", "3.1e-12", "12346", "2e6", "∞"
    ]  # fmt: skip
    assert [duration(one) for one in (0.04, 59.9, 61, 3600 * 2 + 60)] == ["0.0 s", "59.9 s", "1 min 1 s", "2 h 1 min"]
    assert plain({"a": (np.float32(0.5), float("nan"), np.arange(2)), 1: None}) == {"a": [0.5, None, [0, 1]], "1": None}

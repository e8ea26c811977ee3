"""Trials dealt out to processes so that any number of processes gives the same figures."""

from __future__ import annotations

import contextlib
import importlib.util
import signal
import threading
import time
import traceback
import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from multiprocessing import resource_tracker
from typing import Any, Literal

import joblib
import numpy as np

from pipeline.lab.evaluate import Experiment, Figure, Row, Trial

Backend = Literal["loky", "threading", "dask"]
BACKENDS: tuple[Backend, ...] = ("loky", "threading", "dask")


class EvaluationError(RuntimeError):
    """An experiment could not be carried out. details: the traceback, where there is one."""

    def __init__(self, message: str, details: str = "") -> None:
        super().__init__(message)
        self.details = details


class TrialError(RuntimeError):
    """A trial failed. Its arguments, which cross the process border: number, what was raised, traceback."""


@dataclass(frozen=True, eq=False)
class Run:
    """One experiment carried out. results: of all trials in order. seconds: how long it took."""

    name: str
    experiment: Experiment
    seed: int
    quick: bool
    jobs: int
    backend: Backend
    seconds: float
    results: tuple[Trial, ...]
    rows: tuple[Row, ...]

    @property
    def trials(self) -> int:
        """How many trials there were."""
        return len(self.results)

    def figures(self) -> tuple[Figure, ...]:
        """The plots. Raises EvaluationError."""
        with _explained(f"{self.name}: the figures"):
            return self.experiment.figures(self.results)


def carry_out(
    name: str,
    experiment: Experiment,
    *,
    seed: int = 1,
    jobs: int = 1,
    backend: Backend = "loky",
    quick: bool = False,
    done: Callable[[int], None] = lambda _: None,
) -> Run:
    """Run an experiment.

    Trial k draws from `numpy.random.default_rng([seed, k])`, so its result depends neither on the order nor on the
    process. done: hears how many trials are finished. Raises EvaluationError.
    """
    begun = time.perf_counter()
    found: dict[int, Trial] = {}
    try:
        with _workers(backend, jobs, experiment.trials):
            tasks = (joblib.delayed(one_trial)(experiment, seed, number) for number in range(experiment.trials))
            for number, result in _as_finished(tasks):
                found[number] = result
                done(len(found))
    except TrialError as error:
        number, what, details = error.args
        raise EvaluationError(f"{name}: trial {number} failed: {what}", details) from error
    except EvaluationError:
        raise
    except Exception as error:  # joblib, its pools and dask have no common base of what they raise
        told = str(error).split("\n\n")[0]
        raise EvaluationError(f"{name}: {type(error).__name__}: {told}", traceback.format_exc()) from error
    results = tuple(found[number] for number in range(experiment.trials))
    with _explained(f"{name}: the table"):
        rows = tuple(experiment.rows(results))
    return Run(name, experiment, seed, quick, jobs, backend, time.perf_counter() - begun, results, rows)


def one_trial(experiment: Experiment, seed: int, number: int) -> tuple[int, Trial]:
    """(number, result) of one trial. Raises TrialError.

    A process that is handed this imports `app` for it, and so finds the compiled kernels.
    """
    try:
        return number, experiment.trial(np.random.default_rng([seed, number]), number, time.perf_counter)
    except Exception as error:
        raise TrialError(number, f"{type(error).__name__}: {error}", traceback.format_exc()) from None


def usable_backend(name: str) -> Backend:
    """The backend called `name`. Raises ValueError when there is none, or when what it needs is not installed."""
    for backend in BACKENDS:
        if backend == name:
            if name == "dask" and importlib.util.find_spec("distributed") is None:
                raise ValueError(
                    "--backend dask needs dask and distributed, the extra `cluster`:"
                    " uv pip install --python .venv/bin/python -e '.[cluster]'; loky, the default, needs nothing more"
                )
            return backend
    raise ValueError(f"--backend {name}: there are {', '.join(BACKENDS)}")


@contextlib.contextmanager
def _explained(what: str) -> Iterator[None]:
    try:
        yield
    except Exception as error:
        raise EvaluationError(f"{what} failed: {type(error).__name__}: {error}", traceback.format_exc()) from error


@contextlib.contextmanager
def _workers(backend: Backend, jobs: int, trials: int) -> Iterator[None]:
    """Whoever works, one thread each."""
    jobs = max(1, min(jobs, trials))
    if backend == "dask":
        with _dask_client(jobs) as client, joblib.parallel_config("dask", client=client):
            yield
    elif backend == "loky" and jobs > 1:
        with joblib.parallel_config("loky", n_jobs=jobs, inner_max_num_threads=1):
            yield
    else:
        with joblib.parallel_config("threading", n_jobs=jobs):
            yield


def _as_finished(tasks: Iterator[Any]) -> Iterator[tuple[int, Trial]]:
    """What the trials gave, as they end. On the way out, whatever the reason, nobody goes on working."""
    finished = None
    try:
        with _interrupts_held():
            finished = joblib.Parallel(return_as="generator_unordered")(tasks)
        yield from finished
    except BaseException:
        if finished is not None:
            with _quietly():
                finished.close()
        raise


@contextlib.contextmanager
def _quietly() -> Iterator[None]:
    """joblib would warn of trials given up, and its pool's thread may stumble over them."""
    before, threading.excepthook = threading.excepthook, lambda _: None
    try:
        with warnings.catch_warnings(action="ignore"):
            yield
    finally:
        threading.excepthook = before


@contextlib.contextmanager
def _interrupts_held() -> Iterator[None]:
    """Ctrl-C waits until processes are started: they inherit that, and leave it to this one to answer."""
    resource_tracker.ensure_running()  # to start it later would let the interrupts through again
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _dask_client(jobs: int) -> Any:
    """A cluster's client: the one at DASK_SCHEDULER_ADDRESS, or one made here of `jobs` processes."""
    from dask import config
    from distributed import Client

    if config.get("scheduler-address", None):
        return Client()
    return Client(n_workers=jobs, threads_per_worker=1, dashboard_address=None)

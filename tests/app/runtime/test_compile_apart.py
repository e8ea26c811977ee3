"""The process that compiles: once for each combination, its faults told, ended with the service."""

from __future__ import annotations

import logging
import sys
import threading
from pathlib import Path

import pytest

from app.contract import Refused
from app.runtime.compile_apart import CompilerApart
from tests.support.running import until


def order(name: str = "hybrid", **settings: object) -> dict[str, dict[str, object]]:
    return {"detect": {"name": name, **settings}}


def test_each_combination_of_words_is_compiled_once(tmp_path: Path) -> None:
    told = tmp_path / "told"
    compiler = CompilerApart([sys.executable, "-c", f"import sys; open({str(told)!r}, 'a').write(sys.stdin.read())"])
    for chosen in (order(), order(pfa=0.1), order(cells="map")):
        compiler(chosen)
    compiler(order(pfa=0.2))
    assert told.read_text() == '{"detect": {"name": "hybrid"}}{"detect": {"name": "hybrid", "cells": "map"}}'


def test_what_fails_is_told_and_no_more(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.WARNING)
    CompilerApart([sys.executable, "-c", "raise SystemExit('no room')"])(order())
    assert "not compiled apart: no room" in caplog.text
    CompilerApart(["/no/such/program"])(order())
    assert "/no/such/program" in caplog.text


def test_a_service_that_ends_does_not_wait_for_the_compiler() -> None:
    compiler = CompilerApart([sys.executable, "-c", "import time; time.sleep(600)"])
    ended: list[BaseException] = []

    def compile() -> None:
        try:
            compiler(order())
        except Refused as error:
            ended.append(error)

    thread = threading.Thread(target=compile, daemon=True)
    thread.start()
    until(lambda: bool(compiler._running), "it compiles")
    (process,) = compiler._running
    compiler.stop()
    thread.join(10)
    assert str(ended[0]) == "the service ends"
    assert process.returncode is not None
    with pytest.raises(Refused):
        compiler(order("ca"))

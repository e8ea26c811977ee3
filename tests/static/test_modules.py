"""What can be checked of the display without a browser: its unit tests in Node, its types, its house rules."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent.parent
STATIC = ROOT / "static"


def test_the_modules_pass_their_own_tests() -> None:
    node = shutil.which("node")
    if node is None:
        pytest.skip("no Node.js on this machine: the unit tests of the display were not run")
    files = sorted(str(path) for path in (ROOT / "tests/static/js").glob("*.test.mjs"))
    done = subprocess.run([node, "--test", *files], capture_output=True, text=True, cwd=ROOT, timeout=120, check=False)
    assert done.returncode == 0, done.stdout[-4000:]


def test_the_types_hold() -> None:
    compiler = ROOT / "node_modules/.bin/tsc"
    if not compiler.exists():
        pytest.skip("typescript is not installed (npm ci): the types of the display were not checked")
    done = subprocess.run(
        [str(compiler), "--noEmit"], capture_output=True, text=True, cwd=ROOT, timeout=120, check=False
    )
    assert done.returncode == 0, done.stdout


@pytest.mark.parametrize("path", sorted(STATIC.rglob("*.js")), ids=lambda path: path.relative_to(STATIC).as_posix())
def test_a_module_is_short_and_all_its_imports_exist(path: Path) -> None:
    source = path.read_text()
    assert source.count("\n") < 400
    for target in re.findall(r"^(?:import|export)\b[^'\n;]*?\bfrom '([^']+)'", source, re.MULTILINE):
        assert target.startswith("."), f"{target} is not ours"
        assert (path.parent / target).exists(), target


def test_the_page_has_nothing_inline_and_nothing_from_elsewhere() -> None:
    page = (STATIC / "index.html").read_text()
    assert "style=" not in page
    assert not re.search(r"\son\w+=", page)
    assert re.findall(r"<script(?![^>]*\ssrc=)", page) == []
    everything = page + "".join(path.read_text() for path in STATIC.rglob("*.css"))
    assert "//" not in re.sub(r"xmlns=\S+", "", everything)
    for target in re.findall(r'(?:href|src)="([^"]+)"', page):
        assert target == "3d/" or (STATIC / target).exists(), target


@pytest.mark.parametrize("path", [*STATIC.rglob("*.html"), *STATIC.rglob("*.js"), *STATIC.rglob("*.css")], ids=str)
def test_no_link_and_no_request_begins_at_the_root_of_the_host(path: Path) -> None:
    """The pages may stand below a path that a proxy gives."""
    text = re.sub(r"/\*.*?\*/|^\s*//.*$", "", path.read_text(), flags=re.DOTALL | re.MULTILINE)
    assert re.findall(r"""(?:href|src)=["']/|url\(["']?/|["'`(]/(?:api|3d|docs|data|css|js)\b""", text) == []


def test_the_lock_names_no_host() -> None:
    assert "://" not in re.sub(r'"url": "https?://[^"]*"', "", (ROOT / "package-lock.json").read_text())
    assert set(json.loads((ROOT / "package.json").read_text())["devDependencies"]) == {"typescript"}

"""The image and the services of compose.yaml, as far as they can be judged without docker."""

from __future__ import annotations

import http.server
import json
import os
import re
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any

import pytest
import yaml
from sqlalchemy import make_url

from app.settings import ROOT, Settings, load
from app.settings_environment import NOT_SETTINGS, strays
from app.settings_file import settings_file

IMAGE = (ROOT / "Dockerfile").read_text()
VARIABLE = re.compile(r"\$\{(?P<name>[A-Z_]+)(?::-(?P<default>[^${}]*))?\}")
OWN = ("airside", "airside-host", "airside-fleet")


def filled(value: Any, variables: dict[str, str]) -> Any:
    """What compose makes of a value of its file: variables and defaults are put in, the innermost first."""
    if isinstance(value, dict):
        return {key: filled(one, variables) for key, one in value.items()}
    if isinstance(value, list):
        return [filled(one, variables) for one in value]
    if not isinstance(value, str):
        return value
    while found := VARIABLE.search(value):
        inner = variables.get(found["name"]) or found["default"] or ""
        value = value[: found.start()] + inner + value[found.end() :]
    return value


def services(**variables: str) -> dict[str, Any]:
    made: dict[str, Any] = filled(yaml.safe_load((ROOT / "compose.yaml").read_text()), variables)["services"]
    return made


def image_variables() -> dict[str, str]:
    """What the last stage of the image sets."""
    joined = IMAGE[IMAGE.rindex("FROM") :].replace("\\\n", " ")
    return dict(re.findall(r"([A-Z_]+)=(\S+)", "".join(re.findall(r"^ENV (.+)$", joined, re.M))))


def test_compose_and_image_set_only_settings_that_exist() -> None:
    given = {**image_variables()}
    for name in OWN:
        given |= services()[name]["environment"]
    assert len([one for one in given if one.startswith("AIRSIDE_")]) >= 10
    assert strays(given, Settings) == {}
    assert "AIRSIDE_SHIPPED_KERNELS" in NOT_SETTINGS


def test_one_command_starts_one_service_and_the_profiles_the_others() -> None:
    made = services()
    assert "profiles" not in made["airside"]
    assert made["airside-host"]["profiles"] == ["host"]
    fleet = made["airside-fleet"]
    assert all(made[name]["profiles"] == ["fleet"] for name in ("airside-fleet", *fleet["depends_on"]))


def test_the_image_copies_what_is_there_and_runs_as_a_user() -> None:
    taken = (ROOT / ".dockerignore").read_text().split("\n")
    for line in re.findall(r"^COPY (?!--from)(.+)$", IMAGE, re.M):
        for name in line.split()[:-1]:
            assert (ROOT / name).exists(), name
            assert f"!{name}" in taken, name
    assert re.search(r"^USER airside$", IMAGE, re.M)


def test_one_variable_is_the_port_inside_and_outside() -> None:
    for port in ("8000", "9123"):
        for name in OWN:
            one = services(AIRSIDE_PORT=port)[name]
            assert one["environment"]["AIRSIDE_PORT"] == port
            assert "healthcheck" not in one  # the image's own
        assert services(AIRSIDE_PORT=port)["airside"]["ports"][0] == f"127.0.0.1:{port}:{port}"
    assert services(AIRSIDE_PUBLISH="80", AIRSIDE_PORT="9123")["airside"]["ports"][0] == "127.0.0.1:80:9123"
    assert image_variables()["AIRSIDE_PORT"] == "8000"


class Ready(http.server.BaseHTTPRequestHandler):
    def do_GET(self) -> None:
        self.send_response(200 if self.path == "/health/ready" else 404)
        self.end_headers()

    def log_message(self, *_: Any) -> None:
        pass


def test_the_health_check_asks_at_the_port_of_the_service() -> None:
    words = json.loads(re.findall(r"^HEALTHCHECK .*\\\n  CMD (\[.+\])$", IMAGE, re.M)[0])
    assert words[0] == "python"
    with http.server.HTTPServer(("127.0.0.1", 0), Ready) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        asked = [sys.executable, *words[1:]]
        for port, healthy in ((server.server_port, True), (1, False)):
            result = subprocess.run(
                asked, env={**os.environ, "AIRSIDE_PORT": str(port)}, capture_output=True, check=False
            )
            assert (result.returncode == 0) == healthy
        server.shutdown()


def test_ports_are_published_on_loopback_unless_another_address_is_given() -> None:
    for name, one in services().items():
        assert all(port.startswith("127.0.0.1:") for port in one.get("ports", [])), name
    published = services(AIRSIDE_RADAR_PUBLISH="192.0.2.10:8600")["airside"]["ports"]
    assert published[1] == "192.0.2.10:8600:8600/udp"


def test_multicast_has_the_network_of_the_host_and_listens_on_loopback_there() -> None:
    one = services()["airside-host"]
    assert one["network_mode"] == "host"
    assert "ports" not in one  # compose refuses both
    assert one["environment"]["AIRSIDE_HOST"] == one["environment"]["AIRSIDE_UDP_ADDRESS"] == "127.0.0.1"


def test_no_volume_hides_the_kernels_of_the_image() -> None:
    shipped = image_variables()["AIRSIDE_SHIPPED_KERNELS"]
    assert f"COPY --from=builder {shipped} {shipped}" in IMAGE
    assert f"ENV NUMBA_CACHE_DIR={shipped}\n" in IMAGE  # where the first stage compiles them
    for name in OWN:
        mounted = [one.split(":")[1] for one in services()[name]["volumes"]]
        assert image_variables()["NUMBA_CACHE_DIR"] in mounted
        assert not any(Path(shipped).is_relative_to(one) for one in mounted)


def test_relative_paths_count_from_where_the_settings_are_mounted() -> None:
    (workdir,) = re.findall(r"^WORKDIR (.+)$", IMAGE[IMAGE.rindex("FROM") :], re.M)
    for name in OWN:
        assert f"./settings:{workdir}:ro" in services()[name]["volumes"]


def test_a_database_password_may_hold_any_sign(monkeypatch: pytest.MonkeyPatch) -> None:
    password = "p@ss:w/o?r#d%40 ü"
    for name, value in services(POSTGRES_PASSWORD=password)["airside-fleet"]["environment"].items():
        monkeypatch.setenv(name, value)
    url = make_url(load().database)
    assert (url.drivername, url.host, url.port, url.database) == ("postgresql+psycopg", "postgres", 5432, "airside")
    assert (url.username, url.password) == ("airside", password)
    assert services(POSTGRES_PASSWORD=password)["postgres"]["environment"]["POSTGRES_PASSWORD"] == password


def test_the_settings_file_names_the_parts_of_a_database_url() -> None:
    assert "[postgres]" in settings_file()
    assert '#password = ""' in settings_file()

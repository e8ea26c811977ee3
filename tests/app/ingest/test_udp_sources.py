"""The allow-list of senders: addresses and networks of both families, whatever the port."""

from __future__ import annotations

import ipaddress
import socket

import numpy as np
import pytest
from numpy.typing import NDArray
from pydantic import ValidationError

from app.ingest.udp_sources import REMEMBERED, Sources, packed
from app.settings_sources import UdpSettings


def senders(*hosts: str, port: int = 0) -> NDArray[np.uint8]:
    rows = np.array([np.frombuffer(packed(one), np.uint8) for one in hosts])
    rows[:, 2:4] = np.frombuffer(port.to_bytes(2, "big"), np.uint8)
    return rows


def test_addresses_and_networks_of_both_families() -> None:
    sources = Sources(("192.0.2.7", "198.51.100.0/24", "2001:db8::/32", "fe80::1"))
    hosts = {
        "192.0.2.7": True, "192.0.2.8": False, "198.51.100.0": True, "198.51.100.255": True, "198.51.101.0": False,
        "2001:db8:1::5": True, "2001:db9::5": False, "fe80::1%eth0": True, "::ffff:192.0.2.7": True,
        "::ffff:192.0.2.8": False,
    }  # fmt: skip
    for port in (0, 8600):
        assert sources.admitted(senders(*hosts, port=port)).tolist() == list(hosts.values())
    assert sources.newest_refused in hosts
    assert sources.admitted(senders("203.0.113.5")).tolist() == [False]
    assert sources.newest_refused == "203.0.113.5"


def test_what_is_no_internet_address_is_refused() -> None:
    rows = senders("192.0.2.7")
    rows[:, :2] = np.frombuffer(np.uint16(socket.AF_UNIX).tobytes(), np.uint8)
    assert Sources(("0.0.0.0/0", "::/0")).admitted(rows).tolist() == [False]


def test_made_up_addresses_do_not_fill_the_memory() -> None:
    sources = Sources(("192.0.2.7",))
    first = int(ipaddress.IPv4Address("10.0.0.0"))
    for i in range(3 * REMEMBERED):
        sources.admitted(senders(str(ipaddress.IPv4Address(first + i))))
    assert len(sources._refused) <= REMEMBERED
    assert sources.admitted(senders("192.0.2.7", "10.0.0.1")).tolist() == [True, False]


@pytest.mark.parametrize("wrong", ["radar.example", "192.0.2.7/24", "192.0.2.256", "", "192.0.2.7:8600"])
def test_what_is_no_address_is_refused_by_the_settings(wrong: str) -> None:
    with pytest.raises(ValidationError, match=r"sources[\s\S]*such as"):
        UdpSettings(sources=("192.0.2.7", wrong))

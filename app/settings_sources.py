"""The settings of sources: where a radar's datagrams arrive, and how the times are taken that a source states."""

from __future__ import annotations

from ipaddress import ip_network
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field, field_validator


class Section(BaseModel):
    """A table of the settings file."""

    model_config = ConfigDict(extra="forbid", frozen=True, hide_input_in_errors=True)


class UdpSettings(Section):
    """Where a radar's CAT240 datagrams arrive."""

    address: str | None = Field(
        None, description="local address to listen on; without it udp_address, or every address where a group is joined"
    )
    port: int = Field(8600, ge=0, le=65535, description="UDP port; 0 lets the system choose")
    group: str | None = Field(None, description="multicast group to join")
    interface: str = Field("0.0.0.0", description="address of the interface on which the group is joined")
    edition: Literal["1.2", "1.3"] = Field(
        "1.3", description="edition of CAT240 agreed with the radar, a note: both are read alike (1.2 unverified)"
    )
    sources: tuple[str, ...] = Field(
        (),
        description='take datagrams from these addresses and networks only, such as "192.0.2.7" and '
        '"198.51.100.0/24"; empty: from all',
    )
    sac: int | None = Field(None, ge=0, le=255, description="take only this system area code")
    sic: int | None = Field(None, ge=0, le=255, description="take only this system identification code")

    @field_validator("sources")
    @classmethod
    def _networks(cls, value: tuple[str, ...]) -> tuple[str, ...]:
        for one in value:
            try:
                ip_network(one)
            except ValueError as error:
                raise ValueError(f'addresses or networks, such as "192.0.2.7" or "198.51.100.0/24": {error}') from None
        return value


class ClockSettings(Section):
    """How the times that a source states are taken."""

    mode: Literal["auto", "taken", "corrected", "arrival"] = Field(
        "auto",
        description="taken: as stated; corrected: the estimated offset of its clock is removed; arrival: stamped with "
        "the time of arrival; auto: corrected only when latency cannot explain the offset",
    )
    max_offset_s: float = Field(
        5.0, gt=0, description="a report or event further than this from its arrival is refused; video is corrected"
    )
    max_latency_s: float = Field(
        2.0, ge=0, description="a time behind its arrival by less than this counts as latency, not as a wrong clock"
    )


class ClocksSettings(Section):
    """The clocks of the sources that are not radars."""

    reports: ClockSettings = ClockSettings()
    nodes: ClockSettings = ClockSettings()

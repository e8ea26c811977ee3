"""What the channels of a journal file say about their messages, so that other programs can decode them."""

from __future__ import annotations

import json
from dataclasses import dataclass

import pipeline.tables.codec as table_codec
import pipeline.values.codec as value_codec
from pipeline.values import reader as value_reader

MESSAGE_ENCODING = "airside"
SCHEMA_ENCODING = "airside"
"""MCAP names for encodings of its own list; others are free, and say here that the byte forms are those of Airside."""


@dataclass(frozen=True, slots=True)
class ChannelSchema:
    """Name and description (JSON text) of what the messages of a channel are."""

    name: str
    data: bytes


OCTETS = ChannelSchema("airside.octets/1", json.dumps({"layout": "octets that say nothing about themselves"}).encode())
VALUE = ChannelSchema(
    f"airside.value/{value_reader.VERSION}", json.dumps({"layout": value_codec.__doc__}, ensure_ascii=False).encode()
)
_tables: dict[str, ChannelSchema] = {}


def schema_of(data: bytes) -> ChannelSchema:
    """The schema of a message, from its first octets: a table, a value, or octets of any other kind."""
    if value_codec.is_value(data):
        return VALUE
    name = table_codec.table_name(data)
    return OCTETS if name is None else _table(name)


def _table(name: str) -> ChannelSchema:
    known = _tables.get(name)
    if known is None:
        kind = table_codec.known_tables().get(name)
        description = {
            "layout": table_codec.__doc__,
            "table": name,
            "meaning": kind.__doc__ if kind else None,
            "columns": table_codec.layout_of(kind) if kind else None,
        }
        data = json.dumps(description, ensure_ascii=False).encode()
        known = _tables[name] = ChannelSchema(f"airside.table.{name}/{table_codec.VERSION}", data)
    return known

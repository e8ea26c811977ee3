"""ASTERIX CAT240 (radar video): the one place to import its encoder and decoders from."""

from __future__ import annotations

from pipeline.asterix.cat240_batch import VideoBatch, decode_batch
from pipeline.asterix.cat240_decode import DecodeError, SummaryMessage, VideoMessage, decode, read_datagram
from pipeline.asterix.cat240_encode import MAX_DATAGRAM, encode_message, encode_summary, encode_sweeps

__all__ = [
    "MAX_DATAGRAM",
    "DecodeError",
    "SummaryMessage",
    "VideoBatch",
    "VideoMessage",
    "decode",
    "decode_batch",
    "encode_message",
    "encode_summary",
    "encode_sweeps",
    "read_datagram",
]

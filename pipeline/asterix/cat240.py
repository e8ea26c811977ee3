"""ASTERIX CAT240 (radar video): the one place to import its encoder and decoder from."""

from __future__ import annotations

from pipeline.asterix.cat240_encode import MAX_DATAGRAM, encode_message, encode_summary, encode_sweeps

__all__ = ["MAX_DATAGRAM", "encode_message", "encode_summary", "encode_sweeps"]

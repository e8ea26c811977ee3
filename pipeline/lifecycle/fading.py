"""What the lifecycle parts share: how a track coasts and ends."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.contracts.lifecycle import Evidence
from pipeline.kernels.compiled import allocating, inlined
from pipeline.tables import TrackPhase
from pipeline.tables.arrays import Array, Floats

TENTATIVE, CONFIRMED, COASTING = int(TrackPhase.TENTATIVE), int(TrackPhase.CONFIRMED), int(TrackPhase.COASTING)

NEVER_LOOKED = 1 << 30
"""Misses in a row of a track that no radar has seen: it neither coasts nor ends by misses."""


@dataclass(frozen=True, kw_only=True)
class Fading:
    """coast_after: looks in a row without a hit, of every radar that has seen the target, or coast_silence s without
    any measurement, after which a confirmed track is coasting. delete_misses such looks in a row, or delete_silence s
    (identified_silence s when a report has named it), end it; so does a position standard deviation above
    max_position_sd m.
    """

    coast_after: int = 2
    coast_silence: float = 2.5
    delete_misses: int = 8
    delete_silence: float = 10.0
    identified_silence: float = 20.0
    max_position_sd: float = 120.0

    def __post_init__(self) -> None:
        if not 0 < self.coast_after <= self.delete_misses:
            raise ValueError("coast_after must be positive and not above delete_misses")
        if not 0 < self.coast_silence <= self.delete_silence <= self.identified_silence:
            raise ValueError("coast_silence, delete_silence and identified_silence must be positive and ascend")
        if not self.max_position_sd > 0:
            raise ValueError("max_position_sd must be positive")

    def fade(self, evidence: Evidence, confirmed: Array) -> tuple[Array, Array]:
        """The TrackPhase (n,) of confirmed tracks (the others keep theirs), and the mask of tracks that end."""
        phase, ended = np.empty(len(confirmed), np.uint8), np.empty(len(confirmed), np.bool_)
        _fade(
            evidence.phase, evidence.history, evidence.misses, evidence.radars, evidence.silence, evidence.identified,
            evidence.position_sd, confirmed, self.coast_after, self.coast_silence, self.delete_misses,
            self.delete_silence, self.identified_silence, self.max_position_sd, phase, ended,
        )  # fmt: skip
        return phase, ended


@inlined
def hits_within(history: int, looks: int) -> int:
    """How many of the newest `looks` (at most 32) bits are set."""
    # the number of bits, added up in parallel within pairs, fours and bytes of the word
    bits = int(history) & ((1 << looks) - 1)
    bits -= (bits >> 1) & 0x55555555
    bits = (bits & 0x33333333) + ((bits >> 2) & 0x33333333)
    bits = (bits + (bits >> 4)) & 0x0F0F0F0F
    return ((bits * 0x01010101) >> 24) & 0xFF


@allocating
def _fade(
    phase: Array, history: Array, misses: Array, radars: int, silence: Floats, identified: Array, position_sd: Floats,
    confirmed: Array, coast_after: int, coast_silence: float, delete_misses: int, delete_silence: float,
    identified_silence: float, max_position_sd: float, out_phase: Array, ended: Array,
) -> None:  # fmt: skip
    for k in range(len(phase)):
        fewest = NEVER_LOOKED
        for s in range(radars):
            if history[k, s] != 0:
                fewest = min(fewest, misses[k, s])
        if fewest == NEVER_LOOKED:
            fewest = 0
        out_phase[k] = phase[k]
        patience = min(delete_silence, 2.0 * coast_silence)
        if confirmed[k]:
            coasts = fewest >= coast_after or silence[k] > coast_silence
            out_phase[k] = COASTING if coasts else CONFIRMED
            patience = identified_silence if identified[k] else delete_silence
        missed = confirmed[k] and fewest >= delete_misses and not identified[k]
        ended[k] = silence[k] > patience or missed or not position_sd[k] <= max_position_sd

"""From decoded radar messages to blocks of sweeps on the radar's azimuth grid."""

from pipeline.assemble.assembler import Assembler

__all__ = ["Assembler"]

"""Replays journals: the same engine on the same inputs, to verify it, to try other settings, or to look at the day."""

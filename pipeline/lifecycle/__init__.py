"""When a track begins, is believed, coasts and ends."""

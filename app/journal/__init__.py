"""The journal: files (MCAP) of everything that entered the engine and came out of it, in order; written, read, cut."""

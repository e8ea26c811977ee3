"""Storage: one writer thread that owns its connection, readers on their own."""

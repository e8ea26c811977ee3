"""The airport: its map, its frame, its runways and holding positions, and look-ups over them."""

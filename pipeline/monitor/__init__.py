"""Watching the picture: the situation on the runways, and the life of each alert."""

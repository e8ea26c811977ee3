"""Serves the displays with the picture of a journal."""

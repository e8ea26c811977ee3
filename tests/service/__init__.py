"""Tests of storage, REST, live feed and metrics."""

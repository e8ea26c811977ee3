"""Detections to plots."""

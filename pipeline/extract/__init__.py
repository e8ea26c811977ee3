"""Detections to plots: each file is a method; `pipeline.contracts.extract` says what all of them keep to."""

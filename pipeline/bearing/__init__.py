"""Plots to bearings: each file is a method; `pipeline.contracts.bearing` says what all of them keep to."""

"""Prediction and update of track states."""

"""What moving tracks say of headings: where, which way, and how surely."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.tables import TrackPhase, Tracks
from pipeline.track.expected_headings import DRIFT, expected_headings


def tracks(*velocities: tuple[float, float], phase: int = TrackPhase.CONFIRMED, spread: float = 0.0) -> Tracks:
    state = np.array([(100.0 * k, -50.0, *one) for k, one in enumerate(velocities)])
    return Tracks.build(
        len(velocities), id=np.arange(len(velocities)) + 1, time=1000.0, state=state,
        covariance=np.eye(4) * spread**2, phase=phase,
    )  # fmt: skip


def test_the_way_a_track_moves_is_the_way_it_points() -> None:
    got = expected_headings(tracks((0, 10), (10, 0), (0, -10), (-10, 0), (5, 5)), 1000.5)
    np.testing.assert_allclose(np.rad2deg(got.heading), [0, 90, 180, 270, 45], atol=1e-9)
    np.testing.assert_allclose(got.east, [0, 105, 200, 295, 402.5])
    np.testing.assert_allclose(got.north, [-45, -50, -55, -50, -47.5])
    np.testing.assert_allclose(got.sd, DRIFT)


def test_how_sure_it_is_falls_with_speed() -> None:
    got = expected_headings(tracks((0, 3), (0, 30), spread=0.6), 1000.0)
    np.testing.assert_allclose(got.sd, np.hypot([0.2, 0.02], DRIFT))


def test_only_what_moves_and_is_confirmed() -> None:
    assert len(expected_headings(tracks((0, 1.9), (0.0, 0.0), (np.nan, 5.0)), 1000.0).east) == 0
    for phase in (TrackPhase.TENTATIVE, TrackPhase.COASTING):
        assert len(expected_headings(tracks((0, 10), phase=phase), 1000.0).east) == 0
    assert len(expected_headings(Tracks.empty(), 1000.0).east) == 0


def test_an_old_track_is_not_moved_far() -> None:
    assert expected_headings(tracks((0, 10)), 2000.0).north[0] == pytest.approx(-30.0)


def test_the_sd_is_that_of_directions_drawn_from_the_covariance() -> None:
    rng = np.random.default_rng(2)
    covariance = np.array([[0.5, 0.2], [0.2, 0.3]])
    whole = np.eye(4)[None]
    whole[0, 2:, 2:] = covariance
    one = replace(tracks((6.0, 8.0)), covariance=whole)
    drawn = rng.multivariate_normal([6.0, 8.0], covariance, 40_000)
    turned = np.angle(np.exp(1j * (np.arctan2(drawn[:, 0], drawn[:, 1]) - np.arctan2(6.0, 8.0))))
    assert expected_headings(one, 1000.0).sd[0] == pytest.approx(np.hypot(turned.std(), DRIFT), rel=0.03)

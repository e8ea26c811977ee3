"""The velocity that a report states is a measurement with a doubt: speed or course may be wrong altogether."""

from __future__ import annotations

import numpy as np

from pipeline.contracts.filter import Prior
from pipeline.tables import TargetReports
from pipeline.track.core import Core
from pipeline.track.update import unknown_velocity

STANDING_SPEED = 1.0
"""m/s, below which a report without a course still has a velocity: nearly none."""

MOST_SPEED = 300.0
"""m/s, above which a reported speed is not believed; nothing flies faster near an airport."""

SPEED_SD, SPEED_SD_SHARE = 2.0, 0.05
"""m/s and fraction of the speed: standard deviation of each component of a reported velocity; ADS-B of NACv 2 states
3 m/s with 95 %, and the course is rounded."""

WRONG_SHARE, WRONG_SPEED_SD = 0.3, 15.0
"""Fraction of the sources whose stated velocity has nothing to do with the motion (courses that stay at north, are
reversed, or are those of a nose that is pushed back), and m/s of each component that it may then be beside zero."""


def stated_velocity(core: Core, reports: TargetReports) -> Prior:
    """What reports say of their velocities, and how far that is believed: speed or course may be wrong altogether."""
    speed, course = reports.speed.astype(np.float64), reports.course.astype(np.float64)
    course = np.where(np.isfinite(course) | ~(speed < STANDING_SPEED), course, 0.0)
    knows = np.isfinite(speed) & np.isfinite(course) & (speed >= 0) & (speed < MOST_SPEED)
    prior = unknown_velocity(core, len(reports))
    speed, course = speed[knows], course[knows]
    prior.velocity[knows] = np.stack([speed * np.sin(course), speed * np.cos(course)], axis=1)
    right = (SPEED_SD + SPEED_SD_SHARE * speed) ** 2
    wrong = WRONG_SPEED_SD**2 + 2.0 * speed**2
    variance = (1.0 - WRONG_SHARE) * right + WRONG_SHARE * wrong
    prior.covariance[knows] = variance[:, None, None] * np.eye(2)
    prior.known[knows] = True
    return prior

"""The settings of the tracker itself, by what they set; its parts (filter, association, ...) have their own.

Those whose value holds for an antenna that turns about once a second say so: "tied to a one-second antenna".
"""

from __future__ import annotations

from dataclasses import dataclass, field

LARGEST_CAPACITY = 1_000_000
"""Tracks: a hundred times what the largest airport has, false ones included. They take 0.8 gigabytes with
one radar; what asks for more is a typing error."""


@dataclass(frozen=True)
class TimingSettings:
    """Which measurements come too late or too early, s.

    max_lag: what is older than the tracker's time by more is dropped: sensors and their network deliver within 2 s,
    and what is older would pull a track back. Tied to a one-second antenna: a turn must have passed within it.
    max_lead: what is newer by more is dropped while a radar gives the time: the clocks of sensors that are kept by
    GPS or NTP agree far better.
    """

    max_lag: float = 3.0
    max_lead: float = 5.0


@dataclass(frozen=True)
class CoverageSettings:
    """Where a sensor's word counts, m.

    report_range: horizontal distance from the airport, beyond which reports are dropped; final approaches are inside.
    report_ceiling: height, above which reports are dropped; a 3-degree approach is at 2,100 m when 40 km away.
    radar_ceiling: height, above which a miss of a surface radar says nothing: its beam looks down.
    """

    report_range: float = 40_000.0
    report_ceiling: float = 3_000.0
    radar_ceiling: float = 50.0


@dataclass(frozen=True)
class MeasurementSettings:
    """How far a measurement may lie from the centre of its target, beyond the noise that its sensor states.

    plot_centroid_sd: standard deviation of the centroid of an extended echo, as a fraction of its length and width:
    which reflectors dominate changes from turn to turn. report_centroid_sd: standard deviation of a transmitter's
    antenna from the centre of the echo, as a fraction of the length: antennas sit between nose and wing. lane_sd:
    standard deviation of a target across the lane of a pavement node, m: taxiway lanes are 15 to 23 m wide.
    tentative_penalty: cost of a measurement for a tentative track, -2 log units: at 6 an established track wins
    unless the tentative one explains the measurement 20 times better.
    """

    plot_centroid_sd: float = 0.08
    report_centroid_sd: float = 0.1
    lane_sd: float = 6.0
    tentative_penalty: float = 6.0


@dataclass(frozen=True)
class IdentitySettings:
    """When an address reported by a transponder belongs to a track.

    gate: squared Mahalanobis distance up to which an address stays on its track; 25 is 5 standard deviations, since a
    wrong identity costs more than a wide gate. patience: reports in a row that are needed to move an identity away
    from its track, or to give it to one of two tracks that fit alike. Tied to reports once a second.
    ambiguity: difference in cost, -2 log units, below which two tracks fit alike (a likelihood ratio of 4.5).
    forget_after: s without a report, after which a track loses its address; transponders are switched off at the
    stand. protect_for: s after a report, for which the address keeps a track that radars miss.
    """

    gate: float = 25.0
    patience: int = 3
    ambiguity: float = 3.0
    forget_after: float = 120.0
    protect_for: float = 10.0


@dataclass(frozen=True)
class EvidenceSettings:
    """What measurements say about whether a track is a target: the terms of its score, a natural logarithm of
    likelihoods (Blackman and Popoli, Design and Analysis of Modern Tracking Systems, 6.2).

    detection: probability that a look of a radar finds a target. false_on_pavement, false_elsewhere: density of false
    plots, 1/m^2 and turn; on the pavement a constant, elsewhere the least, since more is learnt where they recur.
    cell_scores: added for a plot of one, two, ... cells, the last for all larger ones: noise makes small plots.
    other_sensor: added by a node event or a report, which false plots do not cause. max_score: the score grows no
    further, so that a track can be lost again. young_hits, score_per_hit: a track of fewer hits is bounded lower, by
    this much for each hit that it lacks: what was seen for long may be lost for long. Both are tied to a one-second
    antenna: they count looks.
    The values are not derived; with them `airside bench picture` meets its bounds.
    """

    detection: float = 0.9
    false_on_pavement: float = 1e-6
    false_elsewhere: float = 2e-5
    cell_scores: tuple[float, ...] = (-2.0, 0.5, 1.5, 2.5)
    other_sensor: float = 6.0
    max_score: float = 20.0
    young_hits: int = 20
    score_per_hit: float = 0.4


@dataclass(frozen=True)
class ExtentSettings:
    """How extent and heading of a track follow its plots. grow, shrink and the gains are tied to a one-second antenna:
    they are taken once a plot.

    grow, shrink: fraction of the difference taken from a longer or shorter plot: a target hides more easily than it
    grows. start_speed, stop_speed: m/s, above and below which the course gives the heading; a person walks at 1.4.
    speed_sigmas: to start, the speed must also be so many of its own standard deviations, lest noise turn what
    stands. reverse_speed: m/s, up to which a target may move backwards; push-back is below 3. bearing_sd: rad,
    plots less sure of their long axis do not turn the heading. aircraft_length: m; what is longer is taken for an
    aircraft; most vehicles of an airport are shorter.
    """

    grow: float = 0.2
    shrink: float = 0.1
    start_speed: float = 2.5
    stop_speed: float = 1.2
    speed_sigmas: float = 3.0
    reverse_speed: float = 4.0
    bearing_sd: float = 0.25
    aircraft_length: float = 12.0


@dataclass(frozen=True)
class GroupingSettings:
    """When several plots, or several tracks, are one target.

    absorb_margin: m, a plot this far outside the extent of an established track still belongs to it: about a range
    cell, by which both edges of an echo are unsure. merge_after: checks in a row, one a second, that must find a track
    to duplicate another, or to be a fragment of it, before both become one. merge_named_after: the same where only one
    of them bears an address and they do not both move fast: a vehicle at walking speed has left what it passes by then.
    starved_turns: turns, of the fastest radar that sees a track, without a plot, after which it may duplicate another:
    two, and what the time of a look varies by.
    """

    absorb_margin: float = 4.0
    merge_after: int = 3
    merge_named_after: int = 15
    starved_turns: float = 2.2


@dataclass(frozen=True)
class StartSettings:
    """What starts a track.

    speed_sd: m/s of each component of the velocity of what nothing is known of; 25 m/s twice is a fast take-off.
    ignore_plots_on_buildings: a plot shorter than an aircraft that lies on a building starts none: it is an echo of
    the building. apron_speed_sd: m/s of each component of the velocity of what begins on an apron: nothing is fast
    among parked aircraft, and 7 m/s is the speed limit of service roads.
    """

    speed_sd: float = 25.0
    ignore_plots_on_buildings: bool = True
    apron_speed_sd: float = 7.0


@dataclass(frozen=True)
class ReportingSettings:
    """Which tracks are shown, and what is said of them.

    fixed_off_pavement: show tracks by radar alone off the pavement that never moved: masts and fences look so.
    asterix_numbers: give each track that is shown a number 1 .. 4095 besides its id. Off, since an id that never comes
    again names one target for good; only an ASTERIX output has no room for it.
    moved_by: m, how far beyond half its extent a track must come from where it began to count as moved; the centroid
    of what stands strays by less. source_memory: s for which a sensor's contribution is shown. Tied to a one-second
    antenna: five turns.
    """

    fixed_off_pavement: bool = False
    asterix_numbers: bool = False
    moved_by: float = 30.0
    source_memory: float = 5.0


@dataclass(frozen=True)
class TrackerSettings:
    """All settings of the tracker, by what they set."""

    timing: TimingSettings = field(default_factory=TimingSettings)
    coverage: CoverageSettings = field(default_factory=CoverageSettings)
    measurement: MeasurementSettings = field(default_factory=MeasurementSettings)
    identity: IdentitySettings = field(default_factory=IdentitySettings)
    evidence: EvidenceSettings = field(default_factory=EvidenceSettings)
    extent: ExtentSettings = field(default_factory=ExtentSettings)
    grouping: GroupingSettings = field(default_factory=GroupingSettings)
    start: StartSettings = field(default_factory=StartSettings)
    reporting: ReportingSettings = field(default_factory=ReportingSettings)

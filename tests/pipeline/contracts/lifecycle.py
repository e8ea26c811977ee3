"""What every lifecycle has to keep to; the test of a new one inherits the suite and sets `part`."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from pipeline.contracts.lifecycle import Evidence, LifecyclePart
from pipeline.tables import TrackPhase

SENSOR_COLUMNS = {"history": "u4", "looks": "i4", "misses": "i4", "score": "f8"}


def evidence(radars: int = 1, **given: Any) -> Evidence:
    """Evidence for one track, hit once by the first radar. The columns of sensors: a value, or a list, one a sensor."""
    row: dict[str, Any] = {
        "phase": TrackPhase.TENTATIVE, "history": 1, "looks": 1, "misses": 0, "score": 9.0, "silence": 0.0,
        "identified": False, "position_sd": 3.0,
    } | given  # fmt: skip
    kinds = SENSOR_COLUMNS | {"phase": "u1", "identified": "?"}
    made = {name: np.array([value], kinds.get(name, "f8")) for name, value in row.items()}
    sensors = max(made[name].shape[-1] if made[name].ndim == 2 else 1 for name in SENSOR_COLUMNS)
    for name in SENSOR_COLUMNS:
        made[name] = np.broadcast_to(made[name].reshape(1, -1), (1, sensors)).copy()
    return Evidence(**made, radars=radars)


def together(rows: list[Evidence]) -> Evidence:
    made = {name: np.concatenate([getattr(one, name) for one in rows]) for name in Evidence._fields if name != "radars"}
    return Evidence(**made, radars=rows[0].radars)


def random_row(rng: np.random.Generator) -> dict[str, Any]:
    """Evidence of one sensor that has seen the target, of all kinds."""
    looks = int(rng.integers(1, 40))
    misses = int(rng.integers(0, min(looks, 12)))
    bits = rng.random(32) < rng.uniform(0.2, 1.0)
    bits[:misses] = False
    bits[misses] = True
    bits[looks:] = False
    return {
        "phase": rng.choice(list(TrackPhase)), "history": int(bits @ (1 << np.arange(32))), "looks": looks,
        "misses": misses, "score": rng.uniform(-8, 30), "silence": rng.choice([0.5, 2.0, 3.0, 6.0, 12.0, 25.0]),
        "identified": rng.random() < 0.3, "position_sd": rng.choice([3.0, 200.0], p=[0.9, 0.1]),
    }  # fmt: skip


class LifecycleContract:
    part: LifecyclePart

    def judge(self, radars: int = 1, **given: Any) -> tuple[int, bool]:
        phase, ended = self.part.judge(evidence(radars, **given))
        assert phase.dtype == np.uint8
        assert ended.dtype == np.bool_
        return int(phase[0]), bool(ended[0])

    def test_no_tracks(self) -> None:
        one = evidence()
        none = Evidence(**{name: column[:0] for name, column in one._asdict().items() if name != "radars"}, radars=1)
        assert [len(made) for made in self.part.judge(none)] == [0, 0]

    def test_rows_do_not_mix_and_nothing_is_changed(self) -> None:
        rng = np.random.default_rng(1)
        rows = [evidence(**random_row(rng)) for _ in range(200)]
        given = together(rows)
        kept = [np.copy(one) for one in given]
        phase, ended = self.part.judge(given)
        assert all(np.array_equal(a, b) for a, b in zip(given, kept, strict=True))
        alone = [self.part.judge(one) for one in rows]
        assert phase.tolist() == [int(one[0][0]) for one in alone]
        assert ended.tolist() == [bool(one[1][0]) for one in alone]
        assert len(set(phase.tolist())) == 3
        assert 20 < ended.sum() < 180

    def test_one_hit_is_tentative_and_many_confirm(self) -> None:
        assert self.judge() == (TrackPhase.TENTATIVE, False)
        assert self.judge(history=0xFFFFFFFF, looks=32, score=100.0) == (TrackPhase.CONFIRMED, False)

    def test_misses_coast_then_end_and_a_hit_brings_back(self) -> None:
        confirmed = {"phase": TrackPhase.CONFIRMED, "looks": 40}
        phases = [self.judge(**confirmed, history=(0xFFFFFFFF << k) & 0xFFFFFFFF, misses=k) for k in range(31)]
        assert phases[0] == (TrackPhase.CONFIRMED, False)
        assert (TrackPhase.COASTING, False) in phases
        assert phases[-1][1]
        assert self.judge(phase=TrackPhase.COASTING, misses=0, looks=40) == (TrackPhase.CONFIRMED, False)

    def test_silence_and_ignorance_end_every_track(self) -> None:
        for phase in TrackPhase:
            assert self.judge(phase=phase, silence=1e4, looks=40, history=0xFF)[1]
            assert self.judge(phase=phase, silence=np.inf, identified=True)[1]
            assert self.judge(phase=phase, position_sd=1e6)[1]
            assert self.judge(phase=phase, position_sd=np.nan)[1]

    @pytest.mark.parametrize("seer", [0, 1, 2])
    def test_radars_that_have_not_seen_a_target_say_nothing(self, seer: int) -> None:
        """With two radars that are blind to it, each target fares as with the one that sees it alone."""
        rng = np.random.default_rng(2 + seer)
        rows = [random_row(rng) for _ in range(300)]
        blind = {"history": 0, "looks": 32, "misses": 32, "score": -30.0}
        among = []
        for row in rows:
            columns = {name: [blind[name]] * 3 for name in blind}
            for name in blind:
                columns[name][seer] = row[name]
            among.append(evidence(3, **(row | columns)))
        with_others = self.part.judge(together(among))
        alone = self.part.judge(together([evidence(**row) for row in rows]))
        assert with_others[0].tolist() == alone[0].tolist()
        assert with_others[1].tolist() == alone[1].tolist()

    @pytest.mark.parametrize("seers", [2, 3])
    def test_one_radar_that_sees_it_is_enough(self, seers: int) -> None:
        history = [0xFFFFFFFF] + [0xFF000000] * (seers - 1)
        held = {
            "history": history,
            "misses": [0] + [24] * (seers - 1),
            "looks": 40,
            "score": [40.0] + [0.0] * (seers - 1),
        }
        for phase in TrackPhase:
            assert self.judge(seers, phase=phase, **held) == (TrackPhase.CONFIRMED, False)

    def test_when_every_radar_that_saw_it_misses_it_coasts_and_ends_as_with_one(self) -> None:
        for k in range(25):
            history = (0xFFFFFFFF << k) & 0xFFFFFFFF
            held = {"phase": TrackPhase.CONFIRMED, "looks": 40, "score": 20.0}
            alone = self.judge(history=history, misses=k, **held)
            both = {"history": [history, history << 4 & 0xFFFFFFFF, 0], "misses": [k, k + 4, 99]}
            assert self.judge(3, **held, **both) == alone

    def test_reports_alone_confirm_and_hold(self) -> None:
        """The columns after those of the radars are of sensors that count no misses."""
        for phase in TrackPhase:
            reported = {"history": [0, 0, 0xFFFFFFFF], "looks": [50, 50, 50], "misses": [50, 50, 0]}
            made = self.judge(2, phase=phase, **reported, score=[-9.0, -9.0, 40.0], identified=True)
            assert made == (TrackPhase.CONFIRMED, False)

"""What the settings say reaches the parts of the core."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from app.assembly import surface_engine
from app.settings import Settings, SettingsError, load
from pipeline.engine import SurfaceEngine
from pipeline.tables import TargetReports, Tracks
from pipeline.track.settings import LARGEST_CAPACITY
from tests.support.small_airport import small_airport

T0 = 1_700_000_000.0


def shown(engine: SurfaceEngine, targets: int) -> Tracks:
    """What is shown of targets that stand 100 m apart and have said three times where they are."""
    which = np.arange(targets)
    for second in range(3):
        engine.target_reports(
            TargetReports.build(
                targets, time=T0 + second, address=[f"{one:06x}" for one in which], east=100.0 * which, north=0.0,
                speed=0.0,
            )
        )  # fmt: skip
        engine.advance(T0 + second + 0.5)
    return engine.tracker.tracks()


@pytest.mark.parametrize(("numbered", "numbers"), [(False, [0, 0, 0]), (True, [1, 2, 3])])
def test_capacity_and_numbering_of_the_tracker_are_settings(numbered: bool, numbers: list[int]) -> None:
    settings = Settings.model_validate({"tracker": {"capacity": 3, "asterix_numbers": numbered}})
    engine = surface_engine(settings, small_airport(), (), ())
    tracks = shown(engine, 5)
    assert tracks.id.tolist() == [1, 2, 3]
    assert tracks.number.tolist() == numbers
    assert engine.counters["no_room"] >= 2


def test_without_a_setting_ids_are_shown() -> None:
    tracks = shown(surface_engine(Settings(), small_airport(), (), ()), 5)
    assert tracks.shown_number.tolist() == [1, 2, 3, 4, 5]
    assert not tracks.number.any()


@pytest.mark.parametrize("capacity", [0, LARGEST_CAPACITY + 1])
def test_a_capacity_out_of_bounds_is_refused_by_name(tmp_path: Path, capacity: int) -> None:
    path = tmp_path / "airside.toml"
    path.write_text(f"[tracker]\ncapacity = {capacity}\n")
    with pytest.raises(SettingsError, match=r"tracker\.capacity: .*(1000000|equal to 1)"):
        load(path)

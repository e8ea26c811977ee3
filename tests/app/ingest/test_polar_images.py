"""Folders of polar images as people make them."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from PIL import Image

from app.ingest.recordings import Recording, RecordingError, open_recording
from pipeline.sites import RadarSite
from pipeline.tables import VideoFormat
from tests.support.sweeps import closed_turn

NOTES = {"start": 1_700_000_000, "period_s": 1}
VIDEO = np.random.default_rng(5).integers(0, 256, (3, 64, 40), dtype=np.uint8)
GREY = [level for i in range(256) for level in (i, i, i)]


def folder(path: Path, images: dict[str, Image.Image], **words: Any) -> Path:
    path.mkdir(exist_ok=True)
    for name, image in images.items():
        image.save(path / name, "PNG")
    (path / "radar.yaml").write_text(yaml.safe_dump(NOTES | words))
    return path


def pictures(turns: np.ndarray = VIDEO) -> dict[str, Image.Image]:
    return {f"{i}.png": Image.fromarray(turn) for i, turn in enumerate(turns)}


def cells(recording: Recording) -> np.ndarray:
    video = recording.site.video
    blocks = [one.amplitude for one in recording.blocks()]
    return np.concatenate(blocks).reshape(-1, video.azimuths, video.ranges)


@pytest.mark.parametrize(
    "names",
    [
        ["1.png", "2.png", "10.png"], ["scan_9.png", "scan_10.png", "scan_100.png"],
        ["a9b2.png", "a9b11.PNG", "a10b1.png"],
        ["0099.png", "100.png", "101.png"], ["7-99.png", "7-100.png", "8-1.png"],
        ["1700000000999.png", "1700000001999.png", "17000000029990.png"],
    ],
)  # fmt: skip
def test_images_go_by_the_numbers_in_their_names(tmp_path: Path, names: list[str]) -> None:
    images = {name: Image.fromarray(turn) for name, turn in zip(names, VIDEO, strict=True)}
    assert np.array_equal(cells(open_recording(folder(tmp_path / "a", images))), VIDEO)


def test_files_that_a_system_hides_are_not_images(tmp_path: Path) -> None:
    path = folder(tmp_path / "a", pictures())
    for name in ("._0.png", ".hidden.yaml"):
        (path / name).write_bytes(b"junk")
    assert np.array_equal(cells(open_recording(path)), VIDEO)


def palette_image(turn: np.ndarray, palette: list[int]) -> Image.Image:
    image = Image.fromarray(turn, "P")
    image.putpalette(palette)
    return image


def test_a_palette_of_greys_gives_the_greys(tmp_path: Path) -> None:
    """The index is no amplitude: here it runs backwards."""
    images = {f"{i}.png": palette_image(255 - turn, GREY[::-1]) for i, turn in enumerate(VIDEO)}
    recording = open_recording(folder(tmp_path / "a", images))
    assert np.array_equal(cells(recording), VIDEO)
    assert "pixels of P are all grey, and taken as grey values" in recording.notes


@pytest.mark.parametrize("mode", ["RGB", "RGBA", "LA"])
def test_colours_that_are_all_grey_are_taken(tmp_path: Path, mode: str) -> None:
    images = {name: one.convert(mode) for name, one in pictures().items()}
    recording = open_recording(folder(tmp_path / "a", images))
    assert np.array_equal(cells(recording), VIDEO)
    assert any(mode in one for one in recording.notes)


def test_colours_and_transparency_are_refused(tmp_path: Path) -> None:
    colours = [level for i in range(256) for level in (i, 255 - i, 40)]
    red = Image.merge("RGB", (Image.fromarray(VIDEO[0]),) + (Image.fromarray(VIDEO[0] // 2),) * 2)
    clear = Image.merge("LA", (Image.fromarray(VIDEO[0]), Image.fromarray(VIDEO[0])))
    for image, says in (
        (palette_image(VIDEO[0], colours), "colours of a palette"), (red, "colours of RGB"), (clear, "transparent"),
    ):  # fmt: skip
        with pytest.raises(RecordingError, match=f"0.png: .*{says}"):
            open_recording(folder(tmp_path / "a", {"0.png": image}))


@pytest.mark.parametrize("bits", [9, 12, 16])
def test_images_of_more_bits_keep_their_upper_eight(tmp_path: Path, bits: int) -> None:
    turns = VIDEO.astype(np.uint16) << (bits - 8) | 1
    recording = open_recording(folder(tmp_path / "a", pictures(turns)))
    assert np.array_equal(cells(recording), VIDEO)
    assert any(f"values of {bits} bits" in one for one in recording.notes)
    dark = open_recording(folder(tmp_path / "b", pictures(turns), bits=16))
    assert np.array_equal(cells(dark), VIDEO >> (16 - bits))


def test_images_of_two_kinds_are_refused(tmp_path: Path) -> None:
    path = folder(tmp_path / "a", pictures() | {"1.png": Image.fromarray(VIDEO[1].astype(np.uint16) * 257)})
    with pytest.raises(RecordingError, match=r"1.png: .* of uint16 where the first image has .* of uint8"):
        cells(open_recording(path))


def test_the_way_round_is_said_or_told(tmp_path: Path) -> None:
    recording = open_recording(folder(tmp_path / "a", pictures()))
    assert any(
        "64 rows are taken for azimuths and 40 columns for cells; `transpose: true`" in one for one in recording.notes
    )
    turned = VIDEO.transpose(0, 2, 1)
    recording = open_recording(folder(tmp_path / "b", pictures(turned), transpose=True))
    assert np.array_equal(cells(recording), VIDEO)
    assert recording.notes == ()
    recording = open_recording(folder(tmp_path / "b", pictures(turned), transpose=False))
    assert np.array_equal(cells(recording), turned)
    for wrong in ("yes please", 1, []):
        with pytest.raises(RecordingError, match="transpose must be true or false"):
            open_recording(folder(tmp_path / "b", pictures(turned), transpose=wrong))


def test_columns_before_the_first_cell_are_counted_after_the_turning(tmp_path: Path) -> None:
    turned = np.concatenate([np.full((3, 64, 4), 255, np.uint8), VIDEO], axis=2).transpose(0, 2, 1)
    recording = open_recording(folder(tmp_path / "a", pictures(turned), transpose=True, skip_columns=4))
    assert np.array_equal(cells(recording), VIDEO)


def test_images_that_look_transposed_are_refused_until_it_is_said(tmp_path: Path) -> None:
    turns = np.stack([closed_turn(seed) for seed in range(2)])
    assert np.array_equal(cells(open_recording(folder(tmp_path / "a", pictures(turns)))), turns)
    turned = turns.transpose(0, 2, 1)
    with pytest.raises(RecordingError, match="say `transpose: true`"):
        open_recording(folder(tmp_path / "b", pictures(turned)))
    for transpose, expected in ((True, turns), (False, turned)):
        assert np.array_equal(
            cells(open_recording(folder(tmp_path / "b", pictures(turned), transpose=transpose))), expected
        )


def test_a_radar_with_the_grid_the_other_way_round_names_the_key(tmp_path: Path) -> None:
    path = folder(tmp_path / "a", pictures())
    for grid, says in (((40, 64), "say `transpose`"), ((64, 41), "has 64 of 41$")):
        site = RadarSite("smr", 0, 0, 0, VideoFormat(*grid, range_step_m=3.0, first_range_m=0.0))
        with pytest.raises(RecordingError, match=says):
            open_recording(path, site=site)


def test_a_period_in_milliseconds_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match="no radar turns once in 1500 s"):
        open_recording(folder(tmp_path / "a", pictures(), period_s=1500))

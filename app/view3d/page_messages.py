"""What viser's page says to its server, decoded strictly: viser itself trusts it and fails with a traceback."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

import msgspec

LONGEST_WORD = 64
"""Signs of the name of a button: the longest of ours has eight."""

HIGHEST_PLACE = 2**31
"""Instances of one shape; what is not below has been made up."""


class Malformed(ValueError):
    """This is no message of the page."""


class Unwanted(ValueError):
    """The page need not say this: it is dropped."""


class _Kind(msgspec.Struct):
    type: str


class _Camera(msgspec.Struct, forbid_unknown_fields=True):
    """Where the viewer looks from."""

    type: str
    wxyz: tuple[float, float, float, float]
    position: tuple[float, float, float]
    fov: float
    near: float
    far: float
    image_height: float
    image_width: float
    look_at: tuple[float, float, float]
    up_direction: tuple[float, float, float]

    def check(self) -> None:
        """Raises Unwanted for numbers that are none."""
        _finite((*self.wxyz, *self.position, *self.look_at, *self.up_direction))
        _finite((self.fov, self.near, self.far, self.image_height, self.image_width))


class _Click(msgspec.Struct, forbid_unknown_fields=True):
    """A shape was clicked."""

    type: str
    name: str
    instance_index: int | None
    ray_origin: tuple[float, float, float]
    ray_direction: tuple[float, float, float]
    screen_pos: tuple[float, float]
    modifier: str | None
    owner: str = ""

    def check(self) -> None:
        """Raises Unwanted for numbers that are none, and for a place that no instance has."""
        _finite((*self.ray_origin, *self.ray_direction, *self.screen_pos))
        if self.instance_index is not None and not 0 <= self.instance_index < HIGHEST_PLACE:
            raise Unwanted("no such instance")


class _Update(msgspec.Struct, forbid_unknown_fields=True):
    """A control was set; ours are buttons in a row, whose value is a name."""

    type: str
    uuid: str
    updates: dict[str, Any]

    def check(self) -> None:
        """Raises Unwanted for anything but a short text as the value: viser would set any attribute it is told to."""
        value = self.updates.get("value")
        if set(self.updates) != {"value"} or not isinstance(value, str) or len(value) > LONGEST_WORD:
            raise Unwanted("no button has this value")


_kind = msgspec.msgpack.Decoder(_Kind)
_WANTED: dict[str, msgspec.msgpack.Decoder[Any]] = {
    "ViewerCameraMessage": msgspec.msgpack.Decoder(_Camera),
    "SceneNodeClickMessage": msgspec.msgpack.Decoder(_Click),
    "GuiUpdateMessage": msgspec.msgpack.Decoder(_Update),
}
"""All that our scene asks for. No uploads, no drags, no pictures of what is seen, no request for a public tunnel."""


def check(data: bytes) -> None:
    """Raises Malformed for what is no message of the page; Unwanted for one that may be dropped."""
    try:
        kind = _kind.decode(data).type
        decoder = _WANTED.get(kind)
        if decoder is None:
            raise Unwanted(kind)
        decoder.decode(data).check()
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError) as error:
        raise Malformed(str(error)) from error


def _finite(numbers: Iterable[float]) -> None:
    if not all(map(math.isfinite, numbers)):
        raise Unwanted("not a number")

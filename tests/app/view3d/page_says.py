"""What viser's page (1.1.1) says to its server, with members changed."""

from __future__ import annotations

from typing import Any

import msgspec


def message(kind: str, **fields: Any) -> bytes:
    return msgspec.msgpack.encode({"type": kind, **fields})


def camera(**changed: Any) -> bytes:
    seen = {
        "wxyz": [1.0, 0, 0, 0], "position": [0, -900.5, 400], "fov": 0.9, "near": 1, "far": 20000, "image_height": 720,
        "image_width": 1280, "look_at": [0, 0, 0], "up_direction": [0, 0, 1],
    }  # fmt: skip
    return message("ViewerCameraMessage", **{**seen, **changed})


def click(**changed: Any) -> bytes:
    clicked = {
        "name": "/targets/marks", "instance_index": 3, "ray_origin": [0.0, 1, 2], "ray_direction": [0, 0.6, -0.8],
        "screen_pos": [0.5, 0.25], "modifier": None, "owner": "",
    }  # fmt: skip
    return message("SceneNodeClickMessage", **{**clicked, **changed})


def update(**updates: Any) -> bytes:
    return message("GuiUpdateMessage", uuid="x", updates=updates)

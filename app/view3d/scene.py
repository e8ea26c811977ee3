"""The shared scene in viser: what does not move is sent once, what moves is a handful of batched nodes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from app.view3d import shapes
from app.view3d.ground import Ground
from app.view3d.movers import ALERT_LINES, CAPACITY, RINGS, Frame, Instances, Strokes

SKY = (42, 52, 64)
SKY_M = 16_000.0
AMBIENT = 3.0
SUN = 1.6


LINEAR = np.round(
    255 * np.where(np.arange(256) <= 10, np.arange(256) / 255 / 12.92, ((np.arange(256) / 255 + 0.055) / 1.055) ** 2.4)
).astype(np.uint8)
"""viser takes colours that come one for each instance or point as linear light, all others as sRGB (IEC 61966-2-1)."""


class Scene:
    """Handles of the nodes that change. picked: called with (client id, place of the instance) on a click."""

    def __init__(self, server: Any, ground: Ground, picked: Callable[[int, int | None], None]) -> None:
        self._server = server
        _light(server.scene)
        _build(server.scene, ground)
        self._bodies = {
            name: _batch(server.scene, f"/targets/{name}", shape, CAPACITY)
            for name, shape in (
                ("unknown", shapes.unknown()),
                ("round", shapes.puck()),
                ("aircraft", shapes.aircraft()),
                ("vehicle", shapes.vehicle()),
            )
        }
        self._marks = _batch(server.scene, "/targets/marks", shapes.ring(0.84, 24), CAPACITY)
        self._rings = {
            "information": _batch(server.scene, "/alerts/information", shapes.ring(0.88), RINGS),
            "alarm": _batch(server.scene, "/alerts/alarm", shapes.alarm_ring(), RINGS),
        }
        self._vectors = _strokes(server.scene, "/targets/vectors", CAPACITY, 2.0)
        self._alert_lines = _strokes(server.scene, "/alerts/lines", ALERT_LINES, 3.5)
        for handle in (*self._bodies.values(), self._marks):
            handle.on_click(lambda event: picked(event.client_id, event.instance_index))

    def show(self, frame: Frame) -> None:
        """Send what has changed; viser leaves out arrays that are as before."""
        with self._server.atomic():
            for name, handle in self._bodies.items():
                _fill(handle, frame.bodies[name])
            _fill(self._marks, frame.marks)
            for name, handle in self._rings.items():
                _fill(handle, frame.rings[name])
            _draw(self._vectors, frame.vectors)
            _draw(self._alert_lines, frame.alert_lines)


def _light(scene: Any) -> None:
    scene.set_up_direction("+z")
    scene.world_axes.visible = False
    # The default environment washes alert colours out to pink; shadows cost more than they tell.
    scene.configure_environment_map(None)
    scene.configure_default_lights(enabled=False, cast_shadow=False)
    scene.add_light_ambient("/light/ambient", color=(222, 232, 245), intensity=AMBIENT)
    scene.add_light_directional(
        "/light/sun", color=(255, 246, 230), intensity=SUN, position=(-3000.0, -5000.0, 6500.0), cast_shadow=False
    )
    # No fog: with it the outline of a hovered instance stops the client (1.1.1) from drawing what is translucent.
    scene.add_icosphere(
        "/sky", radius=SKY_M, color=SKY, subdivisions=2, side="back", cast_shadow=False, receive_shadow=False
    )


def _build(scene: Any, ground: Ground) -> None:
    for one in ground.surfaces:
        scene.add_mesh_simple(
            one.name, one.vertices, one.faces, color=one.colour, flat_shading=one.flat, cast_shadow=False,
            receive_shadow=False, side="double" if one.flat else "front",
        )  # fmt: skip
    for line in ground.lines:
        scene.add_line_segments(
            line.name, line.points, np.array(line.colour, np.uint8), thickness=line.width, thickness_units="screen"
        )
    for text, position in ground.notes:
        scene.add_label(f"/notes/{text}", text, position=position, font_screen_scale=1.0, anchor="bottom-center")


def _batch(scene: Any, name: str, shape: shapes.Shape, capacity: int) -> Any:
    return scene.add_batched_meshes_simple(
        name, shape.vertices, shape.faces,
        batched_wxyzs=np.tile(np.array([1, 0, 0, 0], np.float32), (capacity, 1)),
        batched_positions=np.zeros((capacity, 3), np.float32),
        batched_scales=np.zeros((capacity, 3), np.float32),
        batched_colors=np.full((capacity, 3), 128, np.uint8),
        batched_opacities=np.ones(capacity, np.float32),
        lod="off", flat_shading=True, side="double", cast_shadow=False, receive_shadow=False,
    )  # fmt: skip


def _strokes(scene: Any, name: str, capacity: int, width: float) -> Any:
    return scene.add_line_segments(
        name, np.zeros((capacity, 2, 3), np.float32), np.zeros((capacity, 2, 3), np.uint8),
        thickness=width, thickness_units="screen",
    )  # fmt: skip


def _fill(handle: Any, one: Instances) -> None:
    handle.batched_positions = one.positions
    handle.batched_wxyzs = one.wxyzs
    handle.batched_scales = one.scales
    handle.batched_colors = LINEAR[one.colours]
    handle.batched_opacities = one.opacities


def _draw(handle: Any, one: Strokes) -> None:
    handle.points = one.points
    handle.colors = LINEAR[one.colours]

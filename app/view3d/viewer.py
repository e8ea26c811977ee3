"""One person who looks: camera buttons, a selection, and labels of their own."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.view3d import cameras, labels, panel, shapes
from app.view3d.cameras import Pose
from app.view3d.ground import Ground
from app.view3d.movers import Frame, Target
from app.view3d.slots import Slots
from pipeline.airport.model import Airport

LABEL_SCALE = 0.9


class Viewer:
    """The nodes and controls that only one client has. `refresh` belongs to the pusher, the rest to any thread."""

    def __init__(self, client: Any, airport: Airport, ground: Ground, changed: Callable[[], None]) -> None:
        self.id: int = client.client_id
        self._client = client
        self._airport = airport
        self._changed = changed
        self._selected: int | None = None
        self._follow = False
        self._followed: NDArray[np.float64] | None = None
        self._lock = threading.Lock()
        self._places = Slots(labels.MOST)
        self._labels: dict[int, Any] = {}
        self._text = ""
        # Controllers look from the ground; a camera further out than this sees nothing.
        client.camera.max_orbit_distance = 12_000.0
        gui = client.gui
        self._views = gui.add_button_group("Camera", ("Tower", "Overview", "Follow"))
        self._views.on_click(lambda event: self._pressed(str(event.target.value), ground))
        with gui.add_folder("Selected target"):
            self._facts = gui.add_markdown("*Nothing selected: click a target.*")
        gui.add_html(panel.legend())
        ring = shapes.ring(0.92)
        self._ring = client.scene.add_mesh_simple(
            "/selection", ring.vertices, ring.faces, color=(255, 255, 255), side="double", cast_shadow=False,
            receive_shadow=False, visible=False,
        )  # fmt: skip

    @property
    def label_count(self) -> int:
        """Labels shown now."""
        return sum(1 for one in self._labels.values() if one.visible)

    @property
    def selection(self) -> int | None:
        """The track that is looked at."""
        return self._selected

    def select(self, track: int | None) -> None:
        """Look at this track; the same one again lets it go."""
        with self._lock:
            self._selected = None if track == self._selected else track
            self._followed = None
            if self._selected is None:
                self._follow = False
        self._changed()

    def _pressed(self, name: str, ground: Ground) -> None:
        with self._lock:
            self._follow = name == "Follow" and self._selected is not None
            self._followed = None
        if name == "Follow":
            if self._selected is None:
                self._client.add_notification(
                    "Nothing to follow", "Click an aircraft or a vehicle first.", auto_close_seconds=4
                )
            self._changed()
            return
        self.look(cameras.tower(ground) if name == "Tower" else cameras.overview(ground))

    def look(self, pose: Pose) -> None:
        """Put the camera there."""
        camera = self._client.camera
        with self._client.atomic():
            camera.position, camera.look_at, camera.fov = pose.position, pose.look_at, pose.fov
        self._changed()

    def refresh(self, frame: Frame) -> None:
        """Bring labels, selection ring, facts and the following camera up to this frame."""
        target = frame.targets.get(self._selected) if self._selected is not None else None
        with self._client.atomic():
            self._move_labels(frame)
            self._ring.visible = target is not None
            if target is not None:
                radius = max(0.75 * target.size, 14.0)
                self._ring.position = (target.east, target.north, target.height + 0.6)
                self._ring.scale = (radius, radius, 1.0)
        text = panel.selected(self._airport, frame, target)
        if self._selected is not None and target is None:
            text = f"*Track {self._selected} is gone.*"
        if text != self._text:
            self._facts.content = self._text = text
        if target is not None:
            self._follow_on(frame, target)

    def _move_labels(self, frame: Frame) -> None:
        chosen = labels.choose(frame.targets.values(), {self._selected} - {None}, self._eye())  # type: ignore[arg-type]
        places, _ = self._places.assign(one.id for one in chosen)
        shown = set()
        for one in chosen:
            place = places[one.id]
            shown.add(place)
            position = (round(one.east), round(one.north), round(labels.label_height(one)))
            handle = self._labels.get(place)
            if handle is None:
                handle = self._client.scene.add_label(
                    f"/labels/{place}", labels.label_text(one), position=position, anchor="bottom-center",
                    font_screen_scale=LABEL_SCALE,
                )  # fmt: skip
                self._labels[place] = handle
            handle.text, handle.position, handle.visible = labels.label_text(one), position, True
        for place, handle in self._labels.items():
            if place not in shown:
                handle.visible = False

    def _eye(self) -> labels.Eye | None:
        camera = self._client.camera
        w, x, y, z = np.asarray(camera.wxyz, float)
        rotation = np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
            ]
        )
        width, height = float(camera.image_width), float(camera.image_height)
        if not (width > 0 and height > 0 and np.isfinite(rotation).all()):
            return None
        return labels.Eye(np.asarray(camera.position, float), rotation, float(camera.fov), width, height)

    def _follow_on(self, frame: Frame, target: Target) -> None:
        with self._lock:
            if not self._follow:
                return
            here = np.array([target.east, target.north, target.height])
            before, self._followed = self._followed, here
        camera = self._client.camera
        if before is None:
            row = int(np.flatnonzero(frame.picture.tracks.id == target.id)[0])
            tracks = frame.picture.tracks
            course = float(np.arctan2(tracks.state[row, 2], tracks.state[row, 3]))
            heading = float(tracks.heading[row])
            pose = cameras.chase(
                target.east, target.north, target.height, heading if np.isfinite(heading) else course, target.size
            )
            with self._client.atomic():
                camera.position, camera.look_at, camera.fov = pose.position, pose.look_at, pose.fov
            return
        # The camera keeps the place relative to the target that the viewer has turned it to. Setting the position
        # moves the point looked at along.
        camera.position = np.asarray(camera.position, float) + (here - before)

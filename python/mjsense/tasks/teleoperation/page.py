# SPDX-License-Identifier: Apache-2.0
"""The page on which a person drives a robot: the scene, a handle at the target of the tool, keys and buttons."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from mjsense.sim.simulation import Simulation
from mjsense.tasks.teleoperation.pose import Pose
from mjsense.viewer.pictures import Pictures
from mjsense.viewer.source import LiveSource
from mjsense.viewer.text import panel_text
from mjsense.viewer.viewer import Viewer

REACH = 3.0
"""Maximum distance of the target from the robot's base along each axis, m."""
STEP = 0.01  # m per press of a key
TURN = 0.1  # rad per press of a key
_MAX_PRESSES = 100  # that wait; a person makes a few between two steps

# Key: what it does, translation and rotation in steps, in the axes of the robot's base.
MOVES: dict[str, tuple[str, tuple[float, ...]]] = {
    "I": ("Forward", (1, 0, 0, 0, 0, 0)),
    "K": ("Back", (-1, 0, 0, 0, 0, 0)),
    "J": ("Left", (0, 1, 0, 0, 0, 0)),
    "L": ("Right", (0, -1, 0, 0, 0, 0)),
    "U": ("Up", (0, 0, 1, 0, 0, 0)),
    "M": ("Down", (0, 0, -1, 0, 0, 0)),
    "T": ("Roll +", (0, 0, 0, 1, 0, 0)),
    "G": ("Roll -", (0, 0, 0, -1, 0, 0)),
    "Y": ("Pitch +", (0, 0, 0, 0, 1, 0)),
    "H": ("Pitch -", (0, 0, 0, 0, -1, 0)),
    "O": ("Yaw +", (0, 0, 0, 0, 0, 1)),
    "P": ("Yaw -", (0, 0, 0, 0, 0, -1)),
}


class DrivePage(Viewer):
    """Shows world 0, and keeps what the user wants: a target of the tool, the gripper, the end of the episode."""

    def __init__(self, sim: Simulation, title: str, host: str, port: int) -> None:
        super().__init__(title, host, port)
        self._source = LiveSource(sim, title)
        self.base = Pose(np.zeros(3), np.array([1.0, 0, 0, 0]))
        """Pose of the robot's base, world frame."""
        self.target = Pose(np.zeros(3), np.array([1.0, 0, 0, 0]))
        """Target of the tool, base frame."""
        self.finished = False
        """Whether the user has ended the episode."""
        gui = self._server.gui
        with gui.add_folder("Drive"):
            self._text = gui.add_html("")
            self._closed_box = gui.add_checkbox("Close gripper", initial_value=False, hint="Key: space")
            self._paused = gui.add_checkbox(
                "Pause", initial_value=False, hint="The world waits. Moving the target ends the pause."
            )
            self._later(
                gui.add_button("End episode", hint="It counts as failed unless the task has succeeded. Key: enter"), self._finish
            )
        gui.add_markdown(
            "Drag the handle at the tool, or press keys: "
            + ", ".join(f"**{key}** {what.lower()}" for key, (what, _) in MOVES.items())
            + ", **space** gripper, **enter** end of the episode."
        )
        with gui.add_folder("Cameras"):
            self._pictures = Pictures(gui, self._source.pictures(), self._later, self._show)
        self._handle = self._server.scene.add_transform_controls("/target", scale=0.15, depth_test=False)
        self._later(self._handle, self._dragged)
        for key, (what, steps) in MOVES.items():
            self._key(key, what, partial(self.move, STEP * np.array(steps[:3]), TURN * np.array(steps[3:])))
        self._key("space", "Open or close the gripper", self.toggle_gripper)
        self._key("enter", "End the episode", self._finish)
        self._presses: list[Callable[[], None]] = []

    def _key(self, key: str, label: str, action: Callable[[], None]) -> None:
        command = self._server.gui.add_command(label, hotkey=key)

        async def pressed(_: Any) -> None:
            with self._lock:
                if len(self._presses) < _MAX_PRESSES:
                    self._presses.append(action)

        command.on_trigger(pressed)

    def _finish(self) -> None:
        self.finished = True

    def _dragged(self) -> None:
        self._paused.value = False
        self._aim(Pose(self._handle.position, self._handle.wxyz).seen_from(self.base))

    def _aim(self, target: Pose) -> None:
        self.target = Pose(np.clip(target.position, -REACH, REACH), target.quaternion)
        if not np.array_equal(self.target.position, target.position):
            self._place_handle()

    @property
    def gripper_closed(self) -> bool:
        return bool(self._closed_box.value)

    @property
    def paused(self) -> bool:
        """Whether the worlds wait: the user has paused, or no browser shows the page."""
        return bool(self._paused.value) or not self.watched

    def toggle_gripper(self) -> None:
        self._closed_box.value = not self._closed_box.value

    def move(self, translation: np.ndarray, rotation: np.ndarray) -> None:
        """Displaces the target, and the handle with it."""
        if translation.any() or rotation.any():
            self._paused.value = False
            self._aim(self.target.moved(translation, rotation))
            self._place_handle()

    def begin_episode(self, base: Pose, target: Pose, instruction: str) -> None:
        """Shows the world of a new episode and what is to be done, with the target at the tool. It waits until the user moves the
        target or ends the pause."""
        self._paused.value = True
        self.base, self.target, self.finished = base, target, False
        self._closed_box.value = False
        self._text.content = panel_text(instruction, self._source.title)
        self._stage.set_model(self._source.model(0))
        self._look(*self._source.camera(0))
        self._place_handle()
        self.update()

    def _place_handle(self) -> None:
        pose = self.target.carried_by(self.base)
        self._handle.position, self._handle.wxyz = pose.position, pose.quaternion

    def _handle_events(self) -> bool:
        with self._lock:
            presses, self._presses = self._presses, []
        for action in presses:
            self._do(action)
        return super()._handle_events() or bool(presses)

    def _show(self) -> None:
        self._stage.show(lambda name: self._source.field(name, 0))
        self._pictures.refresh(lambda name: self._source.picture(name, 0))

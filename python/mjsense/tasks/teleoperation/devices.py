# SPDX-License-Identifier: Apache-2.0
"""Input devices: the keys of the page, and a SpaceMouse."""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol

import numpy as np


class Motion(NamedTuple):
    """What a device asks for since it was read last."""

    translation: np.ndarray
    """[3] m, axes of the robot's base."""
    rotation: np.ndarray
    """Rotation vector [3] rad, axes of the robot's base."""
    toggle_gripper: bool = False


class Device(Protocol):
    """A source of motions that is read once per step of the policy."""

    def read(self, dt: float) -> Motion:
        """``dt``: duration of a step, s."""
        ...


class SpaceMouse:
    """3Dconnexion's SpaceMouse, read by ``pyspacemouse``. A button opens or closes the gripper."""

    SPEED = 0.25
    """m/s at full deflection."""
    TURN = 1.0
    """rad/s at full deflection."""
    DEAD_ZONE = 0.05
    """Share of the full deflection that is ignored."""

    def __init__(self) -> None:
        try:
            import pyspacemouse  # pyright: ignore[reportMissingImports]
        except ImportError as error:
            raise ModuleNotFoundError(f"The device 'spacemouse' needs pyspacemouse: pip install pyspacemouse ({error})") from None
        self._library: Any = pyspacemouse
        if not pyspacemouse.open():
            raise RuntimeError(
                "pyspacemouse finds no SpaceMouse: connect it, and allow access to its hidraw device (see pyspacemouse's page)"
            )
        self._pressed = False

    def read(self, dt: float) -> Motion:
        state = self._library.read()
        values = np.array([state.y, -state.x, state.z, state.roll, state.pitch, state.yaw], np.float64)
        values = np.clip(np.nan_to_num(values, nan=0.0), -1, 1)
        values[np.abs(values) < self.DEAD_ZONE] = 0
        pressed = any(state.buttons)
        toggle, self._pressed = pressed and not self._pressed, pressed
        return Motion(self.SPEED * dt * values[:3], self.TURN * dt * values[3:], toggle)


def device_of(name: str) -> Device | None:
    """None for the keyboard, whose keys the page reads."""
    if name == "keyboard":
        return None
    if name == "spacemouse":
        return SpaceMouse()
    raise ValueError(f"device is '{name}': must be keyboard or spacemouse")

# SPDX-License-Identifier: Apache-2.0
"""What a client may say: only new values of the page's controls that a person could have set there. Everything else is ignored.

Files, forms, storage, clicks on the scene and public addresses, which viser has messages for, are not used by the pages.
"""

from __future__ import annotations

import math
from typing import Any

from mjsense.core.representations import plain

_MAX_TEXT = 200  # characters
_MAX_INTEGER = 2**53
_SPACE = 1e3  # m, of handles
_CAMERA = 1e9
_IMAGE = 65536  # pixels along a side
_NAME = 256  # characters of identifiers


class Messages:
    """Checks the messages for one server, once, before the server sees them."""

    def __init__(self, viser: Any, server: Any) -> None:
        import msgspec.msgpack  # a dependency of viser

        self._viser, self._gui, self._scene = viser, server.gui, server.scene
        private = {
            "_gui_input_handle_from_uuid": server.gui,
            "_command_handle_from_uuid": server.gui,
            "_handle_from_transform_controls_name": server.scene,
        }
        if missing := [name for name, owner in private.items() if not hasattr(owner, name)]:
            raise RuntimeError(
                f"viser {plain(viser.__version__)} has no {missing[0]}, which the viewer reads: install viser 1.1.1"
            )
        self._codec: Any = msgspec.msgpack
        self._error: type[Exception] = msgspec.MsgspecError
        self._kinds = {
            "GuiUpdateMessage": self._value,
            "CommandTriggerMessage": self._command,
            "ViewerCameraMessage": self._camera,
            "TransformControlsUpdateMessage": self._pose,
            "TransformControlsDragStartMessage": self._handle,
            "TransformControlsDragEndMessage": self._handle,
            "GetRenderResponseMessage": self._render,
        }

    def __call__(self, raw: bytes | str) -> bytes | None:
        """The message made again of checked values; None: it is ignored."""
        if not isinstance(raw, bytes):
            return None
        try:
            message = self._codec.decode(raw)
        except (self._error, ValueError, RecursionError):
            return None
        kind = message.pop("type", None) if isinstance(message, dict) else None
        check = self._kinds.get(kind) if isinstance(kind, str) else None
        checked = check(message) if check is not None else None
        return None if checked is None else self._codec.encode({"type": kind, **checked})

    def _value(self, message: dict[Any, Any]) -> dict[str, Any] | None:
        uuid, updates = message.get("uuid"), message.get("updates")
        handle = self._gui._gui_input_handle_from_uuid.get(uuid) if _is_name(uuid) else None
        if handle is None or handle.disabled or not isinstance(updates, dict) or list(updates) != ["value"]:
            return None
        value = self._value_of(handle, updates["value"])
        return None if value is None else {"uuid": uuid, "updates": {"value": value}}

    def _value_of(self, handle: Any, value: Any) -> Any:
        """The new value of a control; None: it cannot have this value."""
        viser = self._viser
        if isinstance(handle, viser.GuiCheckboxHandle):
            return value if isinstance(value, bool) else None
        if isinstance(handle, viser.GuiButtonHandle):
            return True if value is True else None
        if isinstance(handle, viser.GuiDropdownHandle):
            return value if isinstance(value, str) and value in handle.options else None
        if isinstance(handle, viser.GuiTextHandle):
            return plain(value, _MAX_TEXT) if isinstance(value, str) and len(value) <= _MAX_TEXT else None
        if isinstance(handle, (viser.GuiSliderHandle, viser.GuiNumberHandle)):
            return _number(value, handle.min, handle.max, handle.step, type(handle.value))
        return None

    def _command(self, message: dict[Any, Any]) -> dict[str, Any] | None:
        uuid = message.get("uuid")
        return {"uuid": uuid} if _is_name(uuid) and uuid in self._gui._command_handle_from_uuid else None

    def _handle(self, message: dict[Any, Any]) -> dict[str, Any] | None:
        name = message.get("name")
        known = _is_name(name) and name in self._scene._handle_from_transform_controls_name and message.get("owner", "") == ""
        return {"name": name, "owner": ""} if known else None

    def _pose(self, message: dict[Any, Any]) -> dict[str, Any] | None:
        handle, position, wxyz = (
            self._handle(message),
            _numbers(message.get("position"), 3, _SPACE),
            _numbers(message.get("wxyz"), 4, 1.1),
        )
        length = math.hypot(*wxyz) if wxyz else 0.0
        if handle is None or position is None or wxyz is None or not 0.9 < length < 1.1:
            return None
        return {**handle, "position": position, "wxyz": [component / length for component in wxyz]}

    def _camera(self, message: dict[Any, Any]) -> dict[str, Any] | None:
        found: dict[str, Any] = {
            name: _numbers(message.get(name), count, _CAMERA)
            for name, count in (("wxyz", 4), ("position", 3), ("look_at", 3), ("up_direction", 3))
        }
        found |= {name: _number(message.get(name), 0, _CAMERA, None, float) for name in ("fov", "near", "far")}
        found |= {name: _number(message.get(name), 0, _IMAGE, None, int) for name in ("image_height", "image_width")}
        return None if any(value is None for value in found.values()) else found

    def _render(self, message: dict[Any, Any]) -> dict[str, Any] | None:
        payload, uuid = message.get("payload"), message.get("render_uuid")
        return {"payload": payload, "render_uuid": uuid} if isinstance(payload, bytes) and _is_name(uuid) else None


def _is_name(value: Any) -> bool:
    return isinstance(value, str) and len(value) <= _NAME


def _number(value: Any, low: float | None, high: float | None, step: float | None, kind: type) -> Any:
    """A number between these limits; None: it is none. A browser rounds to decimals, so that a slider's end may be up to one step
    outside."""
    if type(value) not in (int, float):
        return None
    low, high = (-_MAX_INTEGER if low is None else low), (_MAX_INTEGER if high is None else high)
    slack = 0 if step is None or kind is int else step
    if not low - slack <= value <= high + slack or (kind is int and value != int(value)):  # NaN is not between the limits
        return None
    return kind(min(max(value, low), high))


def _numbers(value: Any, count: int, limit: float) -> list[float] | None:
    if not isinstance(value, list) or len(value) != count:
        return None
    found = [_number(one, -limit, limit, None, float) for one in value]
    return None if any(one is None for one in found) else found

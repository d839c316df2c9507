# SPDX-License-Identifier: Apache-2.0
"""The viewer of live worlds."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from mjsense.viewer.curves import Curves
from mjsense.viewer.pictures import Pictures
from mjsense.viewer.sliders import Sliders
from mjsense.viewer.source import LiveSource
from mjsense.viewer.text import label, panel_text
from mjsense.viewer.viewer import Viewer

_PANEL_PERIOD = 0.15  # s between two updates of images and curves
_MAX_CATCH_UP = 0.1  # s of computing between two frames
_UNLIMITED = "as fast as possible"
_SPEEDS = ("0.1", "0.25", "0.5", "1", "2", "5", _UNLIMITED)


class LiveViewer(Viewer):
    """Shows the worlds of a simulation or a task, and steps them."""

    def __init__(self, source: LiveSource, *, world: int = 0, host: str = "127.0.0.1", port: int = 8080, seed: int = 0) -> None:
        if not 0 <= world < source.num_worlds:
            raise ValueError(f"world {world}: must be in [0, {source.num_worlds})")
        super().__init__(source.title, host, port)
        self._source, self._world = source, world
        self._panels_due = 0.0  # time.perf_counter() of the next update of the panels
        self._has_shapes = False
        gui = self._server.gui
        tabs = gui.add_tab_group()
        with tabs.add_tab("Play"):
            self._add_play_tab(gui, seed)
        with tabs.add_tab("Show"):
            self._add_groups(gui)
            self._shape_boxes = {name: gui.add_checkbox(label(name), initial_value=False) for name in source.shape_names()}
            for box in self._shape_boxes.values():
                self._later(box, self._draw_shapes)
        with tabs.add_tab("Cameras"):
            self._pictures = Pictures(
                gui, source.pictures(), self._later, self._show, points=lambda name: source.image_points(name, self._world)
            )
        with tabs.add_tab("Curves"):
            self._curves = Curves(gui, source.streams(), self._later)
        with tabs.add_tab("Control"):
            title = "Actuators" if source.policy is None else "Actions"
            controls = Sliders(
                gui, title, source.controls(), world, source.control, self._writer(source.set_control), self._later
            )
            joints = Sliders(
                gui, "Joints", source.joints(), world, source.joint_positions, self._writer(source.set_joint), self._later
            )
            self._sliders = controls, joints
        self._update_model()
        self._look(*source.camera(world))
        self._show()

    # -------------------------------------------------------------------------------------------------------- page layout

    def _add_play_tab(self, gui: Any, seed: int) -> None:
        source = self._source
        self._clock = gui.add_html("")
        self._add_play(gui)
        self._later(gui.add_button("Step", hint="One control step."), self._step_once)
        self._speed = gui.add_dropdown("Speed", _SPEEDS, initial_value="1")
        self._later(self._speed, self._start)
        self._world_box = gui.add_number(
            "World", self._world, min=0, max=source.num_worlds - 1, step=1, disabled=source.num_worlds == 1
        )
        self._later(self._world_box, self._change_world)
        self._seed = gui.add_number("Seed", seed, min=0, max=2**53, step=1)
        self._later(gui.add_button("Reset", hint="Start the first episode of this seed in all worlds."), self._reset)
        if source.policy is not None:
            self._policy = gui.add_checkbox(
                "Policy", initial_value=source.policy, hint="Off: the sliders of the page Control act."
            )
            self._later(self._policy, self._switch_policy)

    def _writer(self, write: Callable[[int, int, float], None]) -> Callable[[int, float], None]:
        """Sets a value in the world that is shown, and shows the result."""

        def write_and_show(index: int, value: float) -> None:
            write(self._world, index, value)
            self._show()

        return write_and_show

    # -------------------------------------------------------------------------------------------------------- user events

    def _step_once(self) -> None:
        self._set_playing(False)
        self._step()
        self._show()

    def _change_world(self) -> None:
        self._world = int(min(max(self._world_box.value, 0), self._source.num_worlds - 1))
        self._curves.clear()
        self._update_model()
        self._show()

    def _reset(self) -> None:
        self._source.reset(int(self._seed.value))
        self._curves.clear()
        self._show()

    def _switch_policy(self) -> None:
        self._source.policy = self._policy.value
        self._sync_sliders()

    # ----------------------------------------------------------------------------------------------------------- stepping

    def _step(self) -> None:
        self._source.step()
        self._curves.append(self._source.time(self._world), lambda name: self._source.value(name, self._world))

    def _advance(self, now: float) -> bool:
        if not self._playing:
            return False
        speed = self._speed.value
        period = 0.0 if speed == _UNLIMITED else self._source.period / float(speed)
        stepped = False
        while self._due <= now and time.perf_counter() - now < _MAX_CATCH_UP:
            self._step()
            stepped = True
            self._due += period
        self._due = max(self._due, now - period)  # a machine that is too slow does not catch up later
        if stepped:
            self._show()
        return True

    # ------------------------------------------------------------------------------------------------------------ showing

    def _show(self) -> None:
        source, world = self._source, self._world
        if source.version != self._version:
            self._update_model()
        self._stage.show(lambda name: source.field(name, world))
        if self._has_shapes:
            self._draw_shapes()
        now = time.perf_counter()
        if not self._playing or now >= self._panels_due:
            self._panels_due = now + _PANEL_PERIOD
            self._show_panels()

    def _update_model(self) -> None:
        self._version = self._source.version
        self._stage.set_model(self._source.model(self._world))

    def _draw_shapes(self) -> None:
        names = [name for name, box in self._shape_boxes.items() if box.value]
        self._layer.show(self._source.shapes(self._world, names))
        self._has_shapes = bool(names)

    def _show_panels(self) -> None:
        source, world = self._source, self._world
        clock = f"World {world} of {source.num_worlds}, t = {source.time(world):.2f} s"
        self._clock.content = panel_text(source.instruction(world), clock, *source.notes(world))
        self._pictures.refresh(lambda name: source.picture(name, world))
        self._curves.append(source.time(world), lambda name: source.value(name, world))
        self._curves.refresh()
        self._sync_sliders()

    def _sync_sliders(self) -> None:
        for sliders in self._sliders:
            sliders.sync(self._world)

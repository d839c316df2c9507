# SPDX-License-Identifier: Apache-2.0
"""The viewer of live worlds."""

from __future__ import annotations

import time
from typing import Any

from mjsense.viewer.curves import Curves
from mjsense.viewer.pictures import Pictures
from mjsense.viewer.source import LiveSource
from mjsense.viewer.text import label, panel_text
from mjsense.viewer.viewer import Viewer

_PANELS = 0.15  # s between two updates of images and curves
_MAX_CATCH_UP = 0.1  # s of computing between two frames
_SPEEDS = ("0.1", "0.25", "0.5", "1", "2", "5", "as fast as possible")
_MAX_SLIDERS = 60


class LiveViewer(Viewer):
    """Shows the worlds of a simulation or a task, and steps them."""

    def __init__(self, source: LiveSource, *, world: int = 0, host: str = "127.0.0.1", port: int = 8080, seed: int = 0) -> None:
        if not 0 <= world < source.num_worlds:
            raise ValueError(f"world {world}: must be in [0, {source.num_worlds})")
        super().__init__(source.title, host, port)
        self._source, self._world = source, world
        self._panels_due = 0.0
        gui = self._server.gui
        tabs = gui.add_tab_group()
        with tabs.add_tab("Play"):
            self._clock = gui.add_html("")
            self._add_play(gui)
            self._later(gui.add_button("Step", hint="One control step."), self._step_once)
            self._speed = gui.add_dropdown("Speed", _SPEEDS, initial_value="1")
            self._later(self._speed, self._start)
            self._picker = gui.add_number(
                "World", world, min=0, max=source.num_worlds - 1, step=1, disabled=source.num_worlds == 1
            )
            self._later(self._picker, self._pick)
            self._seed = gui.add_number("Seed", seed, min=0, max=2**53, step=1)
            self._later(gui.add_button("Reset", hint="Start the first episode of this seed in all worlds."), self._reset)
            if source.policy is not None:
                self._policy = gui.add_checkbox(
                    "Policy", initial_value=source.policy, hint="Off: the sliders of the page Control act."
                )
                self._later(self._policy, self._switch)
        with tabs.add_tab("Show"):
            self._add_groups(gui)
            self._drawn = {name: gui.add_checkbox(label(name), initial_value=False) for name in source.shape_names()}
            for box in self._drawn.values():
                self._later(box, self._draw)
        with tabs.add_tab("Cameras"):
            self._pictures = Pictures(
                gui, source.pictures(), self._later, self._show, points=lambda name: source.image_points(name, self._world)
            )
        with tabs.add_tab("Curves"):
            self._curves = Curves(gui, source.streams(), self._later)
        with tabs.add_tab("Control"):
            self._sliders(gui)
        self._model_changed()
        self._look(*source.camera(world))
        self._show()

    # ------------------------------------------------------------------------------------------------------------ events

    def _sliders(self, gui: Any) -> None:
        source = self._source
        self._controls, self._joints = [], []
        for title, made, controls, values, write in (
            (
                "Actions" if source.policy is not None else "Actuators",
                self._controls,
                source.controls(),
                source.control,
                source.set_control,
            ),
            ("Joints", self._joints, source.joints(), source.joint_positions, source.set_joint),
        ):
            if not controls:
                continue
            with gui.add_folder(title):
                present = values(self._world)
                for i, control in enumerate(controls[:_MAX_SLIDERS]):
                    low, high = control.low, max(control.high, control.low + 1e-6)
                    value = float(min(max(present[i], low), high))
                    slider = gui.add_slider(label(control.name), min=low, max=high, step=(high - low) / 1000, initial_value=value)
                    self._later(slider, lambda i=i, slider=slider, write=write: self._write(write, i, slider))
                    made.append(slider)

    def _write(self, write: Any, index: int, slider: Any) -> None:
        write(self._world, index, float(slider.value))
        self._show()

    def _step_once(self) -> None:
        self._set_playing(False)
        self._step()
        self._show()

    def _pick(self) -> None:
        self._world = int(min(max(self._picker.value, 0), self._source.num_worlds - 1))
        self._curves.clear()
        self._model_changed()
        self._show()

    def _reset(self) -> None:
        self._source.reset(int(self._seed.value))
        self._curves.clear()
        self._show()

    def _switch(self) -> None:
        self._source.policy = self._policy.value
        self._sync_sliders()

    # ----------------------------------------------------------------------------------------------------------- showing

    def _model_changed(self) -> None:
        self._version = self._source.version
        self._stage.set_model(self._source.model(self._world))

    def _step(self) -> None:
        self._source.step()
        self._curves.append(self._source.time(self._world), lambda name: self._source.value(name, self._world))

    def _advance(self, now: float) -> bool:
        if not self._playing:
            return False
        speed = self._speed.value
        period = 0.0 if speed == _SPEEDS[-1] else self._source.period / float(speed)
        stepped = False
        while self._due <= now and time.perf_counter() - now < _MAX_CATCH_UP:
            self._step()
            stepped = True
            self._due += period
        self._due = max(self._due, now - period)  # a machine that is too slow does not catch up later
        if stepped:
            self._show()
        return True

    def _draw(self) -> None:
        names = [name for name, box in self._drawn.items() if box.value]
        self._layer.show(self._source.shapes(self._world, names))
        self._layer_used = bool(names)

    _layer_used = False

    def _show(self) -> None:
        source, world = self._source, self._world
        if source.version != self._version:
            self._model_changed()
        self._stage.show(lambda name: source.field(name, world))
        if self._layer_used:
            self._draw()
        now = time.perf_counter()
        if now < self._panels_due and self._playing:
            return
        self._panels_due = now + _PANELS
        clock = f"World {world} of {source.num_worlds}, t = {source.time(world):.2f} s"
        self._clock.content = panel_text(source.instruction(world), clock, *source.notes(world))
        self._pictures.refresh(lambda name: source.picture(name, world))
        self._curves.append(source.time(world), lambda name: source.value(name, world))
        self._curves.refresh()
        self._sync_sliders()

    def _sync_sliders(self) -> None:
        for sliders, values in ((self._controls, self._source.control), (self._joints, self._source.joint_positions)):
            if sliders:
                present = values(self._world)
                for slider, value in zip(sliders, present):
                    value = float(min(max(value, slider.min), slider.max))
                    if abs(value - slider.value) > slider.step:
                        slider.value = value

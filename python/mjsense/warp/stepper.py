# SPDX-License-Identifier: Apache-2.0
"""Steps of all worlds: the physics, worlds that fail, clocks and sensors. Its functions launch kernels only, so that CUDA devices
can run them as graphs."""

from __future__ import annotations

from typing import Any

import numpy as np
import warp as wp

from mjsense.warp import kernels, limits, physics
from mjsense.warp.sensor import Stage, WarpSensor, Worlds, rows_view
from mjsense.warp.state import MEMORY, STATE, start_states

FINITE = ("qpos", "qvel", "act", "ctrl", "mocap_pos", "mocap_quat", "qacc")
"""Fields in which an invalid number makes a world fail; bit i of the status is that of field i."""
_DERIVED_FROM = ("qpos", "qvel", "mocap_pos", "mocap_quat")
"""State from which the derived quantities at the beginning of a step were computed."""


class Stepper:
    """The worlds' rows and what a step does with them.

    Args:
        worlds: Model, data, clocks and sensors.
    """

    def __init__(self, worlds: Worlds) -> None:
        B, d = worlds.num_worlds, worlds.data
        self.worlds = worlds
        self.ctrl = wp.zeros_like(d.ctrl)
        """Controls of the next step; those of the physics are the last step's."""
        self.rows = {name: rows_view(getattr(d, name)) for name in (*STATE, *MEMORY, "ctrl", "qacc")}
        """Fields of Data as scalars ``[B, n]``."""
        self.failed = worlds.zeros(B, wp.bool)
        """Worlds that failed in the last step."""
        self.status = worlds.zeros(B, wp.int32)
        """Bits of ``FINITE`` and ``kernels``."""
        self.substepped: list[WarpSensor] = []
        """Sensors whose substep() runs after every physics step."""
        self.substep_stage = Stage.NONE
        self.used: list[WarpSensor] = []
        """Sensors that are computed with every step, inputs first."""
        self._next_ctrl = rows_view(self.ctrl)
        self._known = {name: wp.clone(self.rows[name]) for name in _DERIVED_FROM}
        self.starts = start_states(worlds.compiled.model, self.rows)
        """Components of the state after a reset, ``[1 + nkey, n]``: the model's own pose, then its keyframes."""
        times = np.concatenate([[0.0], worlds.compiled.model.key_time])
        self._start_times = worlds.array(times, wp.float64)
        self.start_row = worlds.zeros(B, wp.int32)
        self._own_row = wp.array(np.arange(B), dtype=wp.int32, device=worlds.device)

    def control_step(self) -> None:
        w, d = self.worlds, self.worlds.data
        self._begin()
        for name in _DERIVED_FROM:
            self._launch(kernels.flag_changed, name, [self.rows[name], self._known[name], self.status])
        wp.copy(d.ctrl, self.ctrl)
        has_forces = False
        for substep in range(w.decimation):
            if not has_forces:
                physics.compute_forces(w.model, d)
            self._integrate(last=substep == w.decimation - 1)
            physics.compute_velocities(w.model, d)
            has_forces = self.substep_stage == Stage.ACC
            if has_forces:
                physics.compute_forces(w.model, d)
            for sensor in self.substepped:
                sensor.substep()
        self._remember()
        self.reset_sensors(self.failed)
        self.store_again()
        self._update_used(has_forces)

    def raw_step(self, behind: bool) -> None:
        """``behind``: the derived quantities are those before the previous step."""
        self._begin()
        wp.copy(self.worlds.data.ctrl, self.ctrl)
        if behind:
            physics.compute_velocities(self.worlds.model, self.worlds.data)
        physics.compute_forces(self.worlds.model, self.worlds.data)
        self._integrate(last=True)
        self.reset_sensors(self.failed)

    def settle(self) -> None:
        """Makes derived quantities those of the state, after resetting the worlds in which it contains invalid numbers."""
        self._begin()
        self.worlds.data.qacc.zero_()  # may contain invalid numbers of an earlier state
        self._restore_failed(begin=True)
        self.reset_sensors(self.failed)
        physics.compute_velocities(self.worlds.model, self.worlds.data)
        self._remember()

    def reset(self, mask: wp.array, start_row: int) -> None:
        """Begins an episode in these worlds, in this row of the start states. settle() must follow."""
        row = wp.array([[start_row]], dtype=wp.int32, device=self.worlds.device)
        inputs = [mask, self._own_row, row, self.start_row.reshape((-1, 1))]
        wp.launch(kernels.copy_rows, (self.worlds.num_worlds, 1), inputs)
        self._restore(mask)
        self._begin_episode(mask)
        self.reset_sensors(mask, on_host=True)

    def set_times(self, mask: wp.array, times: wp.array) -> None:
        """Gives these worlds their times, float64 ``[B]``."""
        w = self.worlds
        wp.launch(kernels.set_times, w.num_worlds, [mask, w.physics_dt, w.substep, times, w.start, w.data.time])

    def store_again(self) -> None:
        """Sensors that cast rays from earlier poses store those of the current state, which was reset or written."""
        for sensor in self.substepped:
            if sensor.stores_writes:
                sensor.substep()

    def apply_ctrl(self, mask: wp.array) -> None:
        """Gives the physics of these worlds the controls of the next step."""
        self._launch(kernels.copy_rows, "ctrl", [mask, self._own_row, self._next_ctrl, self.rows["ctrl"]])

    def reset_sensors(self, mask: wp.array, on_host: bool = False) -> None:
        """``on_host``: also those that are written in Python."""
        for sensor in self.worlds.sensors.values():
            if on_host or not sensor.on_host:
                sensor.reset(mask)

    def read_status(self) -> np.ndarray:
        """Bits of what went wrong in each world; waits for the device."""
        d = self.worlds.data
        counts = [d.nefc, d.nacon, d.ncollision, d.overflow]
        wp.launch(kernels.flag_overflow, self.worlds.num_worlds, [limits.ERRORS, d.njmax, d.naconmax, *counts, self.status])
        return self.status.numpy()

    def _begin(self) -> None:
        self.status.zero_()
        self.worlds.data.overflow.zero_()

    def _integrate(self, last: bool) -> None:
        """``last``: the next episode of worlds that fail begins now."""
        w = self.worlds
        physics.integrate(w.model, w.data)
        wp.launch(kernels.advance_clocks, w.num_worlds, [w.physics_dt, w.substep, w.tick, w.first, w.start, w.data.time])
        self._restore_failed(begin=last)

    def _update_used(self, has_forces: bool) -> None:
        if not has_forces and any(sensor.needs == Stage.ACC for sensor in self.used):
            physics.compute_forces(self.worlds.model, self.worlds.data)
        for sensor in self.used:
            if not (sensor.wants_substep and sensor.substep_fills_rows):
                sensor.update()

    def _restore_failed(self, begin: bool) -> None:
        """Gives worlds with invalid numbers the state of their last reset. ``begin``: their next episode begins now."""
        for bit, name in enumerate(FINITE):
            self._launch(kernels.flag_invalid, name, [self.rows[name], 1 << bit, self.status])
        wp.launch(kernels.failed_worlds, self.worlds.num_worlds, [self.status, self.failed])
        self._restore(self.failed)
        if begin:
            self._begin_episode(self.failed)

    def _restore(self, mask: wp.array) -> None:
        for name, source in self.starts.items():
            self._launch(kernels.copy_rows, name, [mask, self.start_row, source, self.rows[name]])
        self._launch(kernels.copy_rows, "ctrl", [mask, self.start_row, self.starts["ctrl"], self._next_ctrl])
        qpos0 = rows_view(self.worlds.model.qpos0)
        self._launch(kernels.copy_qpos0, "qpos", [mask, self.start_row, qpos0, self.rows["qpos"]])

    def _begin_episode(self, mask: wp.array) -> None:
        w = self.worlds
        inputs = [mask, self.start_row, self._start_times, w.substep, w.episode, w.first, w.start, w.data.time]
        wp.launch(kernels.begin_episode, w.num_worlds, inputs)

    def _remember(self) -> None:
        for name, known in self._known.items():
            wp.copy(known, self.rows[name])

    def _launch(self, kernel: Any, name: str, inputs: list[Any]) -> None:
        """Runs a kernel on all elements of the rows of this name."""
        wp.launch(kernel, (self.worlds.num_worlds, self.rows[name].shape[1]), inputs)

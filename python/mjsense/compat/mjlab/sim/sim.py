# SPDX-License-Identifier: Apache-2.0
"""``mjlab.sim``: worlds of a scene, stepped in mjlab's order of calls."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import mujoco
import numpy as np

import mjsense
from mjsense.compat.mjlab._data import Data
from mjsense.compat.mjlab._tensors import ids, tensor
from mjsense.compat.mjlab.scene import scene_of
from mjsense.compat.mjlab.sensor.sensor_context import SensorContext
from mjsense.sensors import configs


@dataclass
class MujocoCfg:
    """Physics options."""

    timestep: float = 0.002
    integrator: str = "implicitfast"
    impratio: float = 1.0
    cone: str = "pyramidal"
    jacobian: str = "auto"
    solver: str = "newton"
    iterations: int = 100
    tolerance: float = 1e-8
    ls_iterations: int = 50
    ls_tolerance: float = 0.01
    ccd_iterations: int = 50
    gravity: tuple[float, float, float] = (0.0, 0.0, -9.81)
    disableflags: tuple[str, ...] = ()
    enableflags: tuple[str, ...] = ()

    def native(self) -> configs.MujocoCfg:
        return configs.MujocoCfg(**vars(self))


@dataclass(kw_only=True)
class SimulationCfg:
    """Only ``mujoco`` has an effect, and with ``backend="warp"`` ``nconmax`` and ``njmax``: otherwise there are no limits on
    contacts."""

    nconmax: int | None = None
    njmax: int | None = None
    contact_sensor_maxmatch: int = 64
    broadphase: str | None = None
    broadphase_filter: tuple[str, ...] | None = None
    ls_parallel: bool | None = None
    mujoco: MujocoCfg = field(default_factory=MujocoCfg)
    nan_guard: Any = None


class ExpandedModel:
    """A model of which some fields have a row for each world."""

    def __init__(self, model: Any, fields: dict[str, np.ndarray]) -> None:
        self._model = model
        vars(self).update({name: tensor(values) for name, values in fields.items()})

    def __getattr__(self, name: str) -> Any:
        return getattr(self._model, name)


class Simulation:
    """``num_envs`` worlds of the scene of this model. ``native`` is the :class:`mjsense.Simulation`.

    ``step()`` is one plain physics step: until ``forward()``, derived quantities belong to the state before the step.
    """

    def __init__(
        self,
        num_envs: int,
        cfg: SimulationCfg,
        model: mujoco.MjModel | None = None,
        device: str = "cpu",
        *,
        spec: mujoco.MjSpec | None = None,
        threads: int = 0,
        backend: str | None = None,
    ) -> None:
        """``backend`` is that of :class:`mjsense.Simulation`; by default ``"cpu"`` on the CPU and ``"warp"`` on other devices."""
        self.scene = scene_of(spec if model is None else model)
        self.cfg, self.num_envs, self.device = cfg, num_envs, str(device)
        self.scene._cfg.num_envs = num_envs
        self.scene.native._set_options(cfg.mujoco.native())
        backend = backend or ("cpu" if self.device == "cpu" else "warp")
        options: dict[str, Any] = {"threads": threads, "backend": backend}
        if backend == "warp":
            options |= {"device": self.device, "nconmax": cfg.nconmax, "njmax": cfg.njmax}
        elif self.device != "cpu":
            raise ValueError(f"Simulation: device is '{device}': backend='cpu' is on the 'cpu'")
        self.native = mjsense.Simulation(self.scene.native, num_envs, **options)
        self.scene._begin(self.native)
        self._data = Data(self.native)
        self._expanded: dict[str, tuple[np.ndarray, np.ndarray]] = {}

    @property
    def mj_model(self) -> mujoco.MjModel:
        """A copy of the model, for look-ups."""
        return self.scene.native.model  # the object by which scene_of() knows the scene

    @property
    def model(self) -> Any:
        """The model of the worlds: mujoco_warp's with ``backend="warp"``; otherwise ``mj_model``, with the expanded fields."""
        return getattr(self.native, "warp_model", self._model if self._expanded else self.mj_model)

    def expand_model_fields(self, fields: Sequence[str]) -> None:
        """These fields of ``model`` become tensors with a row for each world, which can be written; ``forward()`` applies them.

        With ``backend="cpu"``. Afterwards, read ``model`` again.
        """
        if self.native.__class__ is not mjsense.Simulation:
            raise NotImplementedError(
                "expand_model_fields() is for backend='cpu': write the arrays of sim.model with backend='warp'"
            )
        for name in fields:
            if name not in self._expanded:
                values = np.array(self.native.model_field(name))
                self._expanded[name] = values, values.copy()
        self._model = ExpandedModel(self.mj_model, {name: now for name, (now, _) in self._expanded.items()})

    def _apply_fields(self) -> None:
        for name, (now, before) in self._expanded.items():
            if not np.array_equal(now, before):
                self.native.randomize(name, now)
                before[...] = now

    @property
    def data(self) -> Data:
        """Fields of mjData as tensors."""
        return self._data

    def step(self) -> None:
        """One physics step."""
        self._apply_fields()
        self.native.step_raw(1)

    def forward(self) -> None:
        """Computes the derived quantities of the current state."""
        self._apply_fields()
        self.native.forward()

    def set_sensor_context(self, ctx: SensorContext) -> None:
        """Has no effect: the sensors know the worlds."""

    def sense(self) -> None:
        """Has no effect: cameras and rays are computed from the current state when they are read."""

    def reset(self, env_ids: Any = None) -> None:
        """Resets these worlds, by default all, to the model's initial pose."""
        self.native.reset(ids(env_ids))

    def close(self) -> None:
        """Frees the worlds."""
        self.native.close()


__all__ = ["Data", "MujocoCfg", "Simulation", "SimulationCfg"]

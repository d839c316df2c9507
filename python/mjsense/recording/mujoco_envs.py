# SPDX-License-Identifier: Apache-2.0
"""The MuJoCo models and data in Gymnasium environments, and what sensors and cameras see in them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from mjsense.sim.attached import Attached
from mjsense.sim.renderer import Renderer

_OWNERS = ("", "robot_env", "point_env", "ant_env", "sim", "env.sim", "physics", "_env.physics")
"""Attributes of environments that have the MuJoCo `model` and `data`."""


class MujocoEnvs:
    """The MuJoCo models and data of environments, and what sensors and cameras see in them."""

    def __init__(self, envs: Sequence[Any], sensors: Sequence[Any], decimation: int | None) -> None:
        self._envs = envs
        self._pairs = [self._pair(env) for env in envs]
        self._renderers: dict[int, Renderer] = {}
        self.attached: Attached | None = None
        if sensors:
            inner = envs[0].unwrapped
            steps = decimation or int(getattr(inner, "frame_skip", getattr(inner, "n_substeps", 1)))
            models, datas = zip(*self._pairs)
            self.attached = Attached(models, datas, sensors, decimation=steps)

    @staticmethod
    def _pair(env: Any) -> tuple[Any, Any]:
        for path in _OWNERS:
            owner: Any = env.unwrapped
            for name in filter(None, path.split(".")):
                owner = getattr(owner, name, None)
            model, data = getattr(owner, "model", None), getattr(owner, "data", None)
            model, data = getattr(model, "_model", model), getattr(data, "_data", data)  # robosuite and dm_control wrap them
            if model is not None and hasattr(data, "qpos"):
                return model, data
        raise TypeError(
            f"RecordEpisodes: {env} has no MuJoCo `model` and `data`, which sensors and cameras need; 'render' needs none"
        )

    def sense(self, begun: Sequence[int]) -> None:
        """Makes the sensors current; episodes have begun in these worlds."""
        pairs = [self._pair(env) for env in self._envs]
        made = [w for w, (pair, old) in enumerate(zip(pairs, self._pairs)) if pair[0] is not old[0] or pair[1] is not old[1]]
        self._pairs = pairs
        for world in made:  # as robosuite does in reset()
            if world in self._renderers:
                self._renderers.pop(world).close()
        if self.attached is not None:
            for world in made:
                self.attached.replace(world, pairs[world][1], pairs[world][0])
            self.attached.reset(begun)
            self.attached.update()

    def image(self, world: int, camera: str | int, height: int, width: int) -> np.ndarray:
        model, data = self._pairs[world]
        if world not in self._renderers:
            self._renderers[world] = Renderer(model, height, width)
        self._renderers[world].update_scene(data, camera)
        return self._renderers[world].render()

    def close(self) -> None:
        for renderer in self._renderers.values():
            renderer.close()
        if self.attached is not None:
            self.attached.close()

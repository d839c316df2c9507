# SPDX-License-Identifier: Apache-2.0
"""The configuration of the environment type ``mjsense``: the options ``--env.*`` of LeRobot's programs."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import gymnasium
from lerobot.configs.types import FeatureType, PolicyFeature
from lerobot.envs.configs import EnvConfig
from lerobot.utils.constants import ACTION, OBS_ENV_STATE

from lerobot_env_mjsense.environments import PIXELS, LeRobotVectorEnv, key_of
from mjsense.evaluation.benchmarks import Benchmark, is_benchmark
from mjsense.evaluation.lerobot_features import IMAGES

_ID = "mjsense/lerobot-v0"
_NAMED = ("robot", "scene", "split", "arm_controller", "cameras", "width", "height", "horizon", "policy_dt_ms")
gymnasium.register(_ID, "lerobot_env_mjsense.environments:LeRobotEnv", order_enforce=False, disable_env_checker=True)


@EnvConfig.register_subclass("mjsense")
@dataclass
class MjsenseEnvConfig(EnvConfig):
    """A task of mjsense. None and empty texts stand for mjsense's defaults."""

    task: str | None = "pick"
    """Name of the task, or a benchmark, which fixes all other options but ``map``: its folder, or ``benchmark:pick`` and
    similar."""
    robot: str = ""
    scene: str = ""
    split: str = ""
    arm_controller: str = ""
    env_seed: int = 0
    """mjsense's seed, as in ``mjsense evaluate --seed``. LeRobot's own ``--seed`` is the number of the first episode."""
    episodes: list[int] | None = None
    """Numbers of the episodes to play; None: from LeRobot's ``--seed`` on."""
    cameras: list[str] | None = None
    width: int | None = None
    height: int | None = None
    horizon: int | None = None
    policy_dt_ms: int | None = None
    options: dict[str, Any] = field(default_factory=dict)
    """Other arguments of ``mjsense.make_vec``, such as ``{shadows: false}``."""
    map: str | None = None
    """The map of the export, if it had one: a TOML file."""

    def __post_init__(self) -> None:
        benchmark = None
        if is_benchmark(self.task):
            benchmark = Benchmark(str(self.task))
            benchmark.check_starts()
            self.episodes = self.episodes or benchmark.episodes
        self._options = self._given() if benchmark is None else dict(benchmark.recipe)
        made = LeRobotVectorEnv(self._options, map=self.map)
        self.fps = round(made.metadata["render_fps"])
        self.features = {ACTION: PolicyFeature(type=FeatureType.ACTION, shape=made.single_action_space.shape)}
        self.features_map = {ACTION: ACTION}
        for feature, shape in made.shapes.items():
            image = feature.startswith(IMAGES)
            kind = FeatureType.VISUAL if image else FeatureType.ENV if feature == OBS_ENV_STATE else FeatureType.STATE
            name = f"{PIXELS}/{feature.removeprefix(IMAGES)}" if image else key_of(feature)
            self.features[name], self.features_map[name] = PolicyFeature(type=kind, shape=shape), feature
        made.close()

    def _given(self) -> dict[str, Any]:
        named = {name: getattr(self, name) for name in _NAMED}
        return {
            "task": self.task or "pick",
            "seed": self.env_seed,
            **{k: v for k, v in named.items() if v not in (None, "")},
            **self.options,
        }

    def create_envs(self, n_envs: int, use_async_envs: bool = False) -> dict[str, dict[int, gymnasium.vector.VectorEnv]]:
        """One environment whose worlds run in parallel, with or without ``use_async_envs``."""
        return {self.type: {0: LeRobotVectorEnv(self._options, n_envs, self.episodes, self.map)}}

    @property
    def package_name(self) -> str:
        return "lerobot_env_mjsense"

    @property
    def gym_id(self) -> str:
        return _ID

    @property
    def gym_kwargs(self) -> dict[str, Any]:
        return {"options": self._options, "episodes": self.episodes, "map": self.map}

# SPDX-License-Identifier: Apache-2.0
"""Checkpoints of LeRobot as policies, with the processors that they were saved with."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

import numpy as np

from mjsense.core.optional import optional
from mjsense.exporting import Mapping
from mjsense.tasks.policy import Policy

_IMAGES, _STATE, _OTHERS = "observation.images.", "observation.state", "observation."
_PLACES = ("obs/agent/", "obs/extra/")


class LeRobotPolicy(Policy):
    """A checkpoint that was trained on a data set of :func:`mjsense.export`.

    Its features are made from the streams of which the export made them: ``observation.state`` from the joint positions of all move groups,
    ``observation.images.NAME`` from the camera ``NAME``, ``task`` from the instruction. The action is a joint target of each move group.

    Args:
        path: Folder with ``config.json`` and the weights: ``checkpoints/last/pretrained_model``.
        device: Device of PyTorch; by default that of the checkpoint if there is one, otherwise the CPU.
        map: The map that the export had, if any: a TOML file.
    """

    def __init__(self, path: str, *, device: str = "", map: str | None = None) -> None:
        folder = Path(path)
        if not (folder / "config.json").is_file():
            raise FileNotFoundError(f"lerobot: '{path}' has no config.json; expected a folder such as checkpoints/last/pretrained_model")
        self._torch: Any = optional("torch", "torch", "a LeRobot policy")
        configs: Any = optional("lerobot.configs.policies", "lerobot", "a LeRobot policy")
        optional("lerobot.policies", "lerobot", "a LeRobot policy")  # registers the kinds of policies
        factory: Any = optional("lerobot.policies.factory", "lerobot", "a LeRobot policy")
        config = configs.PreTrainedConfig.from_pretrained(folder)
        cuda = self._torch.cuda.is_available()
        self._device = config.device = device or (config.device if config.device and (cuda or config.device == "cpu") else "cpu")
        if getattr(config, "n_obs_steps", 1) > 1:
            raise ValueError(f"lerobot: '{path}' needs {config.n_obs_steps} observations at once; policies with one are supported")
        self.name = f"lerobot_{config.type}"
        self.path, self.map = str(path), map
        self._model = factory.get_policy_class(config.type).from_pretrained(folder, config=config).to(self._device).eval()
        overrides = {"device_processor": {"device": self._device}}
        self._before, self._after = factory.make_pre_post_processors(config, pretrained_path=str(folder), preprocessor_overrides=overrides)
        self.execution_horizon = int(getattr(config, "n_action_steps", 1))
        """Actions of a chunk that are executed before the policy is asked again, unless the caller says otherwise."""
        mapping = Mapping.of(map)
        state = mapping.state or ("obs/agent/qpos",)
        self._streams: dict[str, tuple[str, ...]] = {}  # by feature
        for feature in config.input_features:
            name = feature.removeprefix(_IMAGES if feature.startswith(_IMAGES) else _OTHERS)
            if feature.startswith(_IMAGES):
                self._streams[feature] = ((mapping.cameras or {}).get(name, name),)
            elif feature == _STATE or name in mapping.features:
                self._streams[feature] = tuple(map_name(stream) for stream in (state if feature == _STATE else mapping.features[name]))
            else:
                raise ValueError(f"lerobot: '{path}' needs the feature '{feature}', which is not in the map; policy option map=FILE names it")
        self._shapes = {feature: tuple(about.shape) for feature, about in config.input_features.items()}
        self._actions = int(config.output_features["action"].shape[0])
        self.observation = tuple(dict.fromkeys(stream for streams in self._streams.values() for stream in streams))

    def fingerprint(self) -> str:
        total = hashlib.sha256()
        for file in sorted(Path(self.path).iterdir()):
            if file.is_file():
                total.update(f"{file.name} {hashlib.sha256(file.read_bytes()).hexdigest()} ".encode())
        return total.hexdigest()

    def initialize(self) -> None:
        if len(self.action_low) != self._actions:
            groups = ", ".join(f"{name} {at.stop - at.start}" for name, at in self.action_groups.items())
            raise ValueError(f"lerobot: '{self.path}' has {self._actions} actions; the robot takes {len(self.action_low)}: {groups}")

    def act(self, obs: dict[str, Any]) -> dict[str, np.ndarray]:
        torch, worlds = self._torch, np.flatnonzero(self.wanted)
        batch: dict[str, Any] = {"task": [self.instructions[world] for world in worlds]}
        for feature, streams in self._streams.items():
            rows = np.concatenate([values[worlds] for stream in streams for values in _leaves(obs, stream)], -1)
            if feature.startswith(_IMAGES):
                rows = np.moveaxis(rows, -1, 1).astype(np.float32) / 255
            if rows.shape[1:] != self._shapes[feature]:
                sizes = tuple(f"{shape[2]}x{shape[1]}" if len(shape) == 3 else str(shape[0]) for shape in (self._shapes[feature], rows.shape[1:]))
                raise ValueError(f"lerobot: '{self.path}' was trained with {feature} of size {sizes[0]}, and here it is {sizes[1]}")
            batch[feature] = torch.as_tensor(rows.astype(np.float32))
        with torch.no_grad():
            chunk = self._after(self._model.predict_action_chunk(self._before(batch)))
        chunk = chunk.float().cpu().numpy()
        actions = np.zeros((self.num_worlds, *chunk.shape[1:]))
        actions[worlds] = chunk
        columns, first = {}, 0
        for name in sorted(self.action_groups):  # the order of an export
            size = self.action_groups[name].stop - self.action_groups[name].start
            columns[name] = actions[..., first : first + size]
            first += size
        return columns


def map_name(stream: str) -> str:
    """The name in an observation of a stream in a recording: ``qpos`` of ``obs/agent/qpos``."""
    for place in _PLACES:
        stream = stream.removeprefix(place)
    return stream


def _leaves(obs: dict[str, Any], stream: str) -> list[np.ndarray]:
    """Rows of a stream, or of all streams below a name, in the order of their names."""
    value: Any = obs
    for part in stream.split("/"):
        value = value[part]
    if not isinstance(value, dict):
        return [value.reshape(len(value), -1) if value.ndim < 3 else value]
    return [leaf for name in sorted(value) for leaf in _leaves(value, name)]


def policy_of(text: str, **options: Any) -> LeRobotPolicy:
    """The policy of ``lerobot:DIR``."""
    return LeRobotPolicy(text.partition(":")[2], **options)

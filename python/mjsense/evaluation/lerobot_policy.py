# SPDX-License-Identifier: Apache-2.0
"""Checkpoints of LeRobot as policies, with the processors that they were saved with."""

from __future__ import annotations

import contextlib
import hashlib
import importlib
from collections import deque
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from mjsense.core.errors import did_you_mean
from mjsense.dataset import bounded_json
from mjsense.evaluation.lerobot_features import IMAGES, Features
from mjsense.exporting.mapping import Mapping
from mjsense.tasks.policy import Policy

_CHUNKS = ("act", "eo1", "evo1", "groot", "molmoact2", "pi0", "pi0_fast", "pi05", "smolvla", "vla_jepa", "wall_x", "xvla")
"""Kinds whose actions depend on one observation: ``predict_action_chunk`` needs no state."""
_QUEUES = ("diffusion", "multi_task_dit", "vqbet")
"""Kinds whose state is ``_queues``: the last observations and the next actions, each with a row for each world."""
_PROCESSORS = ("policy_preprocessor.json", "policy_postprocessor.json")
_FILE_BYTES = 1 << 24


class LeRobotPolicy(Policy):
    """A checkpoint that was trained on a data set of :func:`mjsense.exporting.export_lerobot`.

    It observes what the export contains: ``observation.state``, ``observation.images.NAME`` of the camera ``NAME``, the other
    features of the map, and the instruction as ``task``. Its actions are commands of the move groups.

    Policies whose actions depend on one observation are called for all worlds that need a chunk, and ``n_action_steps`` of its
    actions are executed. Policies that remember observations or actions are called at every step, with a memory for each world.
    Of kinds that are not known to mjsense, one world can be played.

    Weights are read from safetensors files, and the steps of the processors are those that LeRobot has registered: a checkpoint
    contains no code.

    Args:
        path: Folder with ``config.json``, the weights and the processors: ``checkpoints/last/pretrained_model``.
        device: Device of PyTorch; by default that of the checkpoint if there is one, otherwise the CPU.
        map: The map that the export had: a TOML file.
    """

    observation: Sequence[str] | None = ()
    """Streams of the checkpoint's features, once the worlds are known."""
    execution_horizon: int | None = None
    """Number of actions of a chunk that are executed before the policy is called again."""
    ensemble: float | None = None
    """Weight of the temporal ensemble, if the checkpoint has one."""

    def __init__(self, path: str, *, device: str = "", map: Mapping | str | dict[str, Any] | None = None) -> None:
        self.path, self.map = str(path), Mapping.of(map)
        self._folder, self._owner = Path(path), f"lerobot: '{path}'"
        self._check_files()
        self._torch: Any = _needed("torch", "torch")
        config = self._config(device)
        self.name = f"lerobot_{config.type}"
        self.device = str(config.device)
        factory: Any = _needed("lerobot.policies.factory", "lerobot")
        loaded = {}
        if getattr(config, "pretrained_backbone_weights", None):
            config.pretrained_backbone_weights = None  # LeRobot would download them, and then replace them by the checkpoint's
            loaded["strict"] = True
        self._model = factory.get_policy_class(config.type).from_pretrained(self._folder, config=config, **loaded)
        self._model.to(self.device).eval()
        self._before, self._after = factory.make_pre_post_processors(
            config, pretrained_path=str(self._folder), preprocessor_overrides={"device_processor": {"device": self.device}}
        )
        self._inputs = {feature: tuple(about.shape) for feature, about in config.input_features.items()}
        self._size = int(config.output_features["action"].shape[0])
        self._use_amp = bool(config.use_amp)
        self._kind = str(config.type)
        if self._kind in _CHUNKS:
            self.ensemble = getattr(config, "temporal_ensemble_coeff", None)
            self.execution_horizon = int(config.n_action_steps)

    def fingerprint(self) -> str:
        total = hashlib.sha256(f"{self.device} {self.map}".encode())
        for file in sorted(self._folder.iterdir()):
            if file.is_file():
                with open(file, "rb") as opened:
                    total.update(f"{file.name} {hashlib.file_digest(opened, 'sha256').hexdigest()} ".encode())
        return total.hexdigest()

    def _mjs_bind(self, sim: Any, streams: list[Any], layout: list[Any]) -> tuple[dict[str, Any], np.ndarray]:
        bound = super()._mjs_bind(sim, streams, layout)
        self._rows = {spec.name: rows for _, spec, rows in streams}
        self._features = Features({spec.name: spec for _, spec, _ in streams}, self.action_groups, self.map)
        self._features.check(self._inputs, self._owner)
        self.observation = tuple(dict.fromkeys(stream for feature in self._inputs for stream in self._features.streams[feature]))
        for feature, shape in self._inputs.items():
            here = self._features.shape(feature)
            if feature.startswith(IMAGES) and (here[2], here[0], here[1]) != shape:
                height, width = shape[1:]
                raise ValueError(
                    f"{self._owner} was trained with images of {width}x{height} as '{feature}', and here they have "
                    f"{here[1]}x{here[0]} "
                    f"pixels; render them with width={width}, height={height} (--width {width} --height {height})"
                )
            if not feature.startswith(IMAGES) and here != shape:
                streams_here = ", ".join(self._features.streams[feature])
                raise ValueError(
                    f"{self._owner} needs {shape[0]} numbers as '{feature}', and here they are {here[0]}: {streams_here}"
                )
        if len(self._features.action) != self._size:
            raise ValueError(
                f"{self._owner} has {self._size} numbers as 'action', and here they are {len(self._features.action)}: "
                f"{self._features.layout()}. The map of the export names the streams of the action (map=FILE)"
            )
        if self._kind not in _CHUNKS and self._kind not in _QUEUES and self.num_worlds > 1:
            raise ValueError(
                f"{self._owner} is a policy of the kind '{self._kind}', whose memory mjsense does not know: play one world "
                "(num_worlds=1, --worlds 1)"
            )
        self._queues: list[Any] = [None] * self.num_worlds
        return bound

    def reset(self, ids: np.ndarray) -> None:
        for world in ids.tolist():
            self._queues[world] = None
        if self._kind not in _CHUNKS:
            self._model.reset()

    def act(self, obs: dict[str, Any]) -> dict[str, np.ndarray]:
        worlds = np.flatnonzero(self.wanted)
        batch = self._before(self._batch(worlds))
        with self._inference(worlds):
            if self._kind in _CHUNKS:
                self._model.reset()  # actions that it kept for itself belong to other worlds
                chunk = self._model.predict_action_chunk(batch)
                rows = np.stack([self._numbers(chunk[:, step]) for step in range(chunk.shape[1])], 1)
            elif self._kind in _QUEUES:
                rows = self._of_queues(batch, worlds)[:, None]
            else:
                rows = self._numbers(self._model.select_action(batch))[:, None]
        actions = np.zeros((self.num_worlds, rows.shape[1], len(self.action_low)))
        actions[worlds] = self._features.commands(rows)
        hold = np.array([name in self._features.held for name in self.action_groups])
        return {"action": actions, "hold": np.tile(hold, (self.num_worlds, 1))}

    def _batch(self, worlds: np.ndarray) -> dict[str, Any]:
        """The observations ``[k, ...]`` as LeRobot's data sets contain them: images float32 ``[k, 3, height, width]``, 0 to 1."""
        batch: dict[str, Any] = {"task": [self.instructions[world] for world in worlds]}
        for feature in self._inputs:
            rows = self._torch.from_numpy(self._features.rows(feature, self._rows, worlds))
            batch[feature] = rows.permute(0, 3, 1, 2).contiguous().float() / 255 if feature.startswith(IMAGES) else rows
        return batch

    @contextlib.contextmanager
    def _inference(self, worlds: np.ndarray) -> Any:
        """Without gradients, and with random numbers that depend on the episodes that are due."""
        torch = self._torch
        kind = torch.device(self.device).type
        with torch.inference_mode(), torch.autocast(kind) if self._use_amp else contextlib.nullcontext():
            with torch.random.fork_rng([] if kind == "cpu" else None):
                torch.manual_seed(int(self.rng(int(worlds[0])).integers(2**63)))
                yield

    def _of_queues(self, batch: dict[str, Any], worlds: np.ndarray) -> np.ndarray:
        """Actions ``[k, n]``. Worlds whose queues have the same lengths are computed together."""
        alike: dict[tuple[int, ...], list[int]] = {}
        for row, world in enumerate(worlds.tolist()):
            if self._queues[world] is None:
                self._model.reset()
                self._queues[world] = self._model._queues
            alike.setdefault(tuple(map(len, self._queues[world].values())), []).append(row)
        actions = np.zeros((len(worlds), self._size))
        for rows in alike.values():
            of_rows = [self._queues[worlds[row]] for row in rows]
            self._model._queues = {
                name: deque((self._torch.cat(inner) for inner in zip(*(queues[name] for queues in of_rows))), queue.maxlen)
                for name, queue in of_rows[0].items()
            }
            some = {name: _taken(values, rows) for name, values in batch.items()}
            actions[rows] = self._numbers(self._model.select_action(some))
            for i, row in enumerate(rows):
                self._queues[worlds[row]] = {
                    name: deque((inner[i : i + 1] for inner in queue), queue.maxlen)
                    for name, queue in self._model._queues.items()
                }
        return actions

    def _numbers(self, actions: Any) -> np.ndarray:
        """Actions in the units of the data set, float64 ``[k, n]``."""
        return self._after(actions).float().cpu().numpy().astype(np.float64)

    def _check_files(self) -> None:
        """Raises an error if a file is missing, or if a processor has steps that are not registered in LeRobot."""
        if not (self._folder / "config.json").is_file():
            inside = sorted(path.parent for path in self._folder.glob("**/pretrained_model/config.json"))
            near = (
                f"; did you mean '{inside[-1]}'?" if inside else "; expected a folder such as checkpoints/last/pretrained_model"
            )
            raise FileNotFoundError(f"{self._owner} has no config.json{near}")
        for name in _PROCESSORS:
            path = self._folder / name
            if not path.is_file():
                raise FileNotFoundError(
                    f"{self._owner} has no {name}; checkpoints of LeRobot before 0.4 are converted by python -m "
                    "lerobot.processor.migrate_policy_normalization"
                )
            with open(path, "rb") as file:
                table = bounded_json.parse_object(file.read(_FILE_BYTES + 1), str(path), _FILE_BYTES)
            steps = table.get("steps")
            for step in steps if isinstance(steps, list) else [steps]:
                if not isinstance(step, dict) or not isinstance(step.get("registry_name"), str):
                    raise ValueError(
                        f"{path}: a step of the processor is {str(step)[:200]}; expected one with a registry_name: "
                        "steps by the name of a "
                        "class are refused, because they can run any code"
                    )

    def _config(self, device: str) -> Any:
        with open(self._folder / "config.json", "rb") as file:
            table = bounded_json.parse_object(file.read(_FILE_BYTES + 1), str(self._folder / "config.json"), _FILE_BYTES)
        configs = _needed("lerobot.configs.policies", "lerobot").PreTrainedConfig
        _needed("lerobot.policies.factory", "lerobot")  # registers the kinds of policies
        _needed("lerobot.utils.import_utils", "lerobot").register_third_party_plugins()
        known, kind = sorted(configs.get_known_choices()), str(table.get("type"))
        if kind not in known:
            raise ValueError(f"{self._owner} is of the kind '{kind}'{did_you_mean(kind, known, 'the installed LeRobot has')}")
        config = configs.from_pretrained(self._folder)  # replaces a device that this machine does not have
        if config.use_peft:
            raise ValueError(f"{self._owner} is an adapter (PEFT); merge it with its base model first")
        if device:
            config.device = device
        return config


def policy_of(text: str, **options: Any) -> LeRobotPolicy:
    """The policy of ``lerobot:DIR``."""
    return LeRobotPolicy(text.partition(":")[2], **options)


def _taken(values: Any, rows: list[int]) -> Any:
    """These rows of a value of a batch, which may be a list of texts, or something that is not a row for each world."""
    if isinstance(values, list):
        return [values[row] for row in rows]
    return values[rows] if hasattr(values, "ndim") and values.ndim else values


def _needed(module: str, package: str) -> Any:
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError(
            f"a policy lerobot:DIR needs the package {package} (LeRobot 0.4.4 or newer, pip install lerobot) in "
            f"this Python's environment: {error}",
            name=error.name,
        ) from error

# SPDX-License-Identifier: Apache-2.0
"""The recording that :class:`mjsense.RecordEpisodes` makes of what an environment returns."""

from __future__ import annotations

import contextlib
import json
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv

from mjsense import _core
from mjsense.recording.mujoco_envs import MujocoEnvs
from mjsense.recording.recorder import recorded_handle
from mjsense.recording.written_rows import WrittenRows
from mjsense.sensors.row_declarations import Row, is_rgb, leaves, rows_of_space
from mjsense.sensors.sensor import encode_json

_RGB = 3  # channels


@dataclass
class _Step:
    """What one environment has returned."""

    observation: list[Any]
    action: list[Any] | None
    """None after a reset."""
    info: Mapping[str, Any]
    reward: float = 0.0
    terminated: bool = False
    truncated: bool = False

    @property
    def success(self) -> bool:
        return any(bool(np.all(self.info[key])) for key in ("is_success", "success") if key in self.info)


def _dicts(value: Any) -> Any:
    """Tuples, of values and of spaces, as dicts with the keys "0", "1" ..."""
    spaces = gymnasium.spaces
    if isinstance(value, spaces.Tuple):
        value = spaces.Dict({str(i): space for i, space in enumerate(value.spaces)})
    if isinstance(value, spaces.Dict):
        return spaces.Dict({key: _dicts(space) for key, space in value.spaces.items()})
    if isinstance(value, tuple):
        value = {str(i): inner for i, inner in enumerate(value)}
    return {str(key): _dicts(inner) for key, inner in value.items()} if isinstance(value, Mapping) else value


class EpisodeRecording:
    """The recording of a wrapped environment; see :class:`RecordEpisodes` for the arguments."""

    def __init__(
        self,
        env: Any,
        out: str | Path,
        cameras: Mapping[str, Any] | Sequence[str],
        sensors: Sequence[Any],
        camera_size: Sequence[float],
        decimation: int | None,
        fps: float | Fraction | None,
        keep_partial: bool,
        image_videos: bool,
        info_bytes: int,
        settings: Mapping[str, Any] | None,
        options: dict[str, Any],
    ) -> None:
        _core.check_options("FilesCfg", options)
        if len(camera_size) != 2:
            raise ValueError(f"RecordEpisodes: camera_size is {camera_size}: must be (height, width)")
        self._env = env
        self._vector = isinstance(env, VectorEnv)
        self._worlds: int = env.num_envs if self._vector else 1
        self._cameras = dict(cameras) if isinstance(cameras, Mapping) else {str(name): name for name in cameras}
        self._size = [int(n) for n in camera_size]
        self._keep_partial, self._image_videos, self._info_bytes = keep_partial, image_videos, info_bytes
        self._options, self._episodes = options, options["episodes"]
        self.path = Path(out) / f"house_{self._options['house']}"
        """Folder of the episodes."""
        if not options["resume"] and self.path.exists() and any(self.path.iterdir()):
            raise ValueError(
                f"RecordEpisodes: '{self.path}' has a recording: pass resume=True to continue it, or choose another folder"
            )
        prefix = "single_" if self._vector else ""
        spaces = {
            "observation": getattr(env, f"{prefix}observation_space"),
            "actions/action": getattr(env, f"{prefix}action_space"),
        }
        self._rows = {name: self._rows_of(name, space) for name, space in spaces.items()}
        self.autoreset = (
            (env.metadata or {}).get("autoreset_mode", AutoresetMode.NEXT_STEP) if self._vector else AutoresetMode.DISABLED
        )
        """When the environments are reset."""
        self._fps = self._rate(fps)
        needs_mujoco = bool(sensors) or any(camera != "render" for camera in self._cameras.values())
        self._mujoco = MujocoEnvs(self._single_envs(), sensors, decimation) if needs_mujoco else None
        if self.autoreset == AutoresetMode.SAME_STEP and (self._cameras or sensors):
            raise ValueError(
                "RecordEpisodes: cameras and sensors do not see the last state of an episode with "
                "AutoresetMode.SAME_STEP; use NEXT_STEP"
            )
        name = getattr(env.spec, "id", None) or type(env.unwrapped).__name__
        self._settings = {"env": name, "cameras": self._cameras, "camera_size": self._size, **(settings or {})}
        self._scene = {"task_description": name, "policy_dt_ms": float(1000 / self._fps)}
        self._core: Any = None
        self._written: dict[str, np.ndarray] = {}
        self._running: set[int] = set()
        self._ended: set[int] = set()
        self._next = self._kept = 0
        self._warned: set[str] = set()
        self.complete = False
        """Whether all episodes are recorded; the environment then runs on without a recording."""

    @staticmethod
    def _rows_of(name: str, space: Any) -> list[Row]:
        try:
            return rows_of_space(_dicts(space))
        except TypeError as error:
            wrapper = "leave it out with gymnasium.wrappers.FilterObservation"
            if name != "observation":
                wrapper = "make it one of them with gymnasium.wrappers.TransformAction"
            raise TypeError(f"RecordEpisodes: {name}: {str(error).removeprefix('observation_')}; {wrapper}") from None

    def _single_envs(self) -> Sequence[Any]:
        if not self._vector:
            return [self._env]
        envs = getattr(self._env.unwrapped, "envs", None)
        if envs is None:
            raise TypeError(
                f"RecordEpisodes: the environments of {self._env} are in other processes, where sensors and cameras "
                "cannot see them: "
                "use the camera 'render', or wrap each environment where it is made, with house=0, 1, 2 ..."
            )
        return envs

    def _rate(self, fps: float | Fraction | None) -> Fraction:
        if fps is None:
            inner = getattr(self._env.unwrapped, "envs", [self._env])[0].unwrapped
            fps = float(getattr(inner, "control_freq", None) or (self._env.metadata or {}).get("render_fps") or 30)
            with contextlib.suppress(AttributeError, TypeError, ZeroDivisionError):
                fps = 1 / float(inner.dt)
        rate = Fraction(fps).limit_denominator(10**6)
        if rate <= 0:
            raise ValueError(f"RecordEpisodes: fps is {fps}: must be positive")
        return rate

    @property
    def kept(self) -> int:
        """Number of episodes that are recorded."""
        return self._core.kept if self._core is not None else self._kept

    # --------------------------------------------------------------------------------------------- what the environment returns

    def of_world(self, value: Any, name: str, world: int) -> list[Any]:
        """The arrays of one environment in an observation or action, which is batched if the environment is a vector."""
        parts = leaves(_dicts(value), self._rows[name])
        return [part[world] for part in parts] if self._vector else parts

    def reset(self, observation: Any, infos: Sequence[Mapping[str, Any]], seeds: Mapping[int, int | None]) -> None:
        """Episodes have begun in these worlds."""
        steps = {w: _Step(self.of_world(observation, "observation", w), None, infos[w]) for w in seeds}
        self._record(steps, seeds)

    def step(
        self,
        action: Any,
        observation: Any,
        reward: Any,
        terminated: Any,
        truncated: Any,
        infos: Sequence[Mapping[str, Any]],
        final: Any = None,
    ) -> None:
        """All environments have made a step.

        Args:
            final: function that returns the last observation and info of an episode by world, with SAME_STEP.
        """
        steps, begun, after = {}, {}, {}
        if np.size(reward) != self._worlds:
            raise ValueError(
                f"RecordEpisodes: the reward has the shape {np.shape(reward)}, expected one number for each environment"
            )
        for w in range(self._worlds):
            seen = self.of_world(observation, "observation", w)
            if self.autoreset == AutoresetMode.NEXT_STEP and w in self._ended:
                steps[w], begun[w] = _Step(seen, None, infos[w]), None
                self._ended.discard(w)
                continue
            ends = [bool(np.ravel(x)[w]) for x in (terminated, truncated)]
            step = _Step(seen, self.of_world(action, "actions/action", w), infos[w], float(np.ravel(reward)[w]), *ends)
            if any(ends):
                self._ended.add(w)
                if self.autoreset == AutoresetMode.SAME_STEP:
                    after[w] = _Step(seen, None, infos[w])
                    last, step.info = final(w)
                    step.observation = leaves(_dicts(last), self._rows["observation"])
            steps[w] = step
        self._record(steps, begun)
        if after:
            self._ended -= after.keys()
            self._record(after, dict.fromkeys(after))

    # ---------------------------------------------------------------------------------------------------------- the recording

    def _record(self, steps: Mapping[int, _Step], begun: Mapping[int, int | None]) -> None:
        if self.complete:
            return
        if self._mujoco is not None:
            self._mujoco.sense([*begun])
        frames = self._env.render() if "render" in self._cameras.values() else None
        images = {w: self._images(w, frames) for w in steps}
        if self._core is None:
            core = self._open(next(iter(images.values())))
            if core.enough and core.kept < self._episodes:
                raise ValueError(
                    f"RecordEpisodes: '{self.path}' was published with {core.kept} of {self._episodes} episodes and "
                    "cannot be continued: "
                    "choose another folder or house"
                )
            self._core, self.complete = core, core.enough
        for world, seed in begun.items():
            self._ended.discard(world)
            self._leave(world, "the environment was reset")
            if self.kept + len(self._running) < self._episodes and not self.complete:
                while self._core.decided(self._next):
                    self._next += 1
                self._core.begin_episode(world, self._next, seed or 0)
                self._next += 1
                self._running.add(world)
        worlds = [w for w in steps if w in self._running]
        for world in worlds:
            self._write(world, steps[world], images[world])
        chosen = [steps[w] for w in worlds]
        self._core.append(
            worlds,
            [s.reward for s in chosen],
            [s.terminated for s in chosen],
            [s.truncated for s in chosen],
            [s.success for s in chosen],
        )
        for world, step in zip(worlds, chosen):
            if world in self._running and (step.terminated or step.truncated):
                self._finish(world, "success" if step.success else "terminated" if step.terminated else "truncated")

    def _images(self, world: int, frames: Any) -> dict[str, np.ndarray]:
        images = {}
        for name, camera in self._cameras.items():
            if camera != "render":
                assert self._mujoco is not None
                images[name] = self._mujoco.image(world, camera, self._size[0], self._size[1])
                continue
            image = np.asarray(frames[world] if self._vector and frames is not None else frames)
            if image.dtype != np.uint8 or image.ndim != 3 or image.shape[2] != 3:
                raise ValueError(
                    f"RecordEpisodes: env.render() has returned {image.dtype} {image.shape}, expected a uint8 image "
                    "(height, width, 3): "
                    "make the environment with render_mode='rgb_array'"
                )
            images[name] = image
        return images

    def _open(self, images: Mapping[str, np.ndarray]) -> Any:
        streams, written = WrittenRows(self._worlds), self._written
        texts = {
            "observation": "Observation of the environment.",
            "actions/action": "Action that led to this row; 0 in the first row.",
        }
        names: set[str] = set()
        for name, rows in self._rows.items():
            for row in rows:
                low, high = row.bounds()
                stream, shape = self._stream_of(name, row), row.shape
                if stream in names:
                    raise ValueError(
                        f"RecordEpisodes: two images of the observation would be the video '{stream}': rename one, "
                        "or pass image_videos=False"
                    )
                names.add(stream)
                video = self._is_video(name, row)
                if video:
                    low, high, shape = 0.0, 255.0, shape if shape[2] == _RGB else (*shape[1:], _RGB)
                written[stream] = streams.add(stream, row.kept, shape, texts[name], low=low, high=high, video=video)
        written["info"] = streams.add(
            "info", "uint8", [self._info_bytes], "Infos of the environment.", is_dict=True, low=0.0, high=255.0
        )
        for name, image in images.items():
            about = f"Image of the camera '{self._cameras[name]}'."
            written[name] = streams.add(name, "uint8", image.shape, about, low=0.0, high=255.0, frame="pixels", video=True)
        attached = self._mujoco.attached if self._mujoco is not None else None
        handles = [
            *streams.handles,
            *(recorded_handle(sensor) for sensor in (attached.sensors.values() if attached is not None else ())),
        ]
        return _core.Recorder(
            None if attached is None else attached.simulation._core,
            self._worlds,
            handles,
            str(self.path.parent),
            self._fps.numerator,
            self._fps.denominator,
            json.dumps(self._settings, sort_keys=True),
            self._options,
        )

    def _is_video(self, name: str, row: Row) -> bool:
        """Whether a row of the observation is an RGB image that becomes a video."""
        return self._image_videos and name == "observation" and is_rgb(row.dtype, row.shape)

    def _stream_of(self, name: str, row: Row) -> str:
        """Name of the stream that stores a row of an observation or action."""
        return "_".join(row.path) or name if self._is_video(name, row) else "/".join((name, *row.path))

    def _write(self, world: int, step: _Step, images: Mapping[str, np.ndarray]) -> None:
        for name, values in (("observation", step.observation), ("actions/action", step.action)):
            for i, row in enumerate(self._rows[name]):
                value: Any = 0 if values is None else values[i]
                if values is not None and np.shape(value) != row.shape:
                    raise ValueError(
                        f"RecordEpisodes: '{'/'.join((name, *row.path))}' has the shape {np.shape(value)}, expected "
                        f"{row.shape} as in its space"
                    )
                if values is not None and self._is_video(name, row) and row.shape[2] != _RGB:
                    value = np.moveaxis(value, 0, -1)
                self._written[self._stream_of(name, row)][world] = value
        for name, image in images.items():
            if image.shape != self._written[name].shape[1:]:
                raise ValueError(
                    f"RecordEpisodes: the image of '{name}' was {self._written[name].shape[1:]} and is now {image.shape}"
                )
            self._written[name][world] = image
        text = self._info_text(step.info)
        row = self._written["info"][world]
        row[:] = 0
        row[: len(text)] = np.frombuffer(text, np.uint8)

    def _info_text(self, info: Mapping[str, Any]) -> bytes:
        """The infos as JSON; without those that JSON cannot express, and without the longest if they do not fit."""
        texts, why = {}, {}
        for key, value in info.items():
            try:
                texts[str(key)] = encode_json({str(key): value})[1:-1]
            except (TypeError, ValueError):
                why[str(key)] = "is neither a number, a text nor an array"
        while 2 + sum(len(text) + 1 for text in texts.values()) > self._info_bytes:
            longest = max(texts, key=lambda key: len(texts[key]))
            why[longest] = f"needs {len(texts.pop(longest))} bytes of the {self._info_bytes} of info_bytes"
        for key in why.keys() - self._warned:
            self._warned.add(key)
            warnings.warn(f"RecordEpisodes: the info '{key}' is not recorded: it {why[key]}", stacklevel=6)
        return b"{" + b",".join(texts[key] for key in sorted(texts)) + b"}"

    def _finish(self, world: int, outcome: str) -> None:
        self._core.finish_episode(world, json.dumps(self._scene), outcome)
        self._running.discard(world)
        if self._core.enough:
            self._complete()

    def _leave(self, world: int, why: str) -> None:
        """Ends an episode that has not come to its end."""
        if world not in self._running:
            return
        if self._keep_partial:
            self._finish(world, why)
        else:
            self._core.discard_episode(world, why)
            self._running.discard(world)

    def _complete(self) -> None:
        for world in sorted(self._running):
            self._core.discard_episode(world, "the recording is complete")
        self._running.clear()
        self._core.complete()
        self.complete = True

    def abandon(self) -> None:
        """Ends the recording without publishing it; ``resume`` can continue it."""
        self._kept = self.kept
        self._core, self.complete = None, True

    def close(self) -> None:
        """Publishes the recording. Episodes that are running are discarded, or kept with ``keep_partial``."""
        if self._core is not None and not self.complete:
            for world in sorted(self._running):
                self._leave(world, "the environment was closed")
            if not self.complete:
                self._complete()
        if self._mujoco is not None:
            self._mujoco.close()
        self._mujoco, self.complete = None, True

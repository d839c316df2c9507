# SPDX-License-Identifier: Apache-2.0
"""Recordings of the episodes of any Gymnasium environment."""

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
from gymnasium.vector import AutoresetMode, VectorEnv, VectorWrapper

from mjsense import _core
from mjsense._arguments import checked
from mjsense._rows import Row, leaves, rows_of_space
from mjsense.attach import Attached
from mjsense.recorder import FILE_OPTIONS
from mjsense.renderer import Renderer
from mjsense.sensor import Sensor, encode_json

_OPTIONS = {"house": 0, "batches": 0, "gzip": 4, "ffmpeg": "", "crf": 25, "preset": "veryfast", "molmospaces_depth": False}
"""Options of the files, which are those of :class:`mjsense.Recorder`."""

_OWNERS = ("", "robot_env", "point_env", "ant_env", "sim", "env.sim", "physics", "_env.physics")
"""Attributes of environments that have the MuJoCo `model` and `data`."""


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


def _info_of(infos: Mapping[str, Any], world: int, worlds: int) -> dict[str, Any]:
    """The infos of one environment of a vector environment. Those without a mask belong to all of its environments."""
    found = {}
    for key, value in infos.items():
        if key in ("final_obs", "final_info") or (key[0] == "_" and key[1:] in infos):
            continue
        if isinstance(value, Mapping):
            found[key] = _info_of(value, world, worlds)
        elif np.ndim(value) and len(value) == worlds and infos.get(f"_{key}", np.ones(worlds, bool))[world]:
            found[key] = value[world]
    return found


class _MujocoEnvs:
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
        raise TypeError(f"RecordEpisodes: {env} has no MuJoCo `model` and `data`, which sensors and cameras need; 'render' needs none")

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


class _Recording:
    """The recording of a wrapped environment; see :class:`RecordEpisodes` for the arguments."""

    def __init__(
        self,
        env: Any,
        out: str | Path,
        episodes: int,
        cameras: Mapping[str, Any] | Sequence[str],
        sensors: Sequence[Any],
        camera_size: Sequence[float],
        decimation: int | None,
        fps: float | Fraction | None,
        resume: bool,
        keep_partial: bool,
        info_bytes: int,
        settings: Mapping[str, Any] | None,
        options: Mapping[str, Any],
    ) -> None:
        if episodes < 1:
            raise ValueError(f"RecordEpisodes: episodes is {episodes}: must be at least 1")
        if len(camera_size) != 2:
            raise ValueError(f"RecordEpisodes: camera_size is {camera_size}: must be (height, width)")
        if unknown := options.keys() - _OPTIONS.keys():
            raise TypeError(f"RecordEpisodes() got unexpected arguments {', '.join(sorted(unknown))}; options are {', '.join(_OPTIONS)}")
        self._env = env
        self._vector = isinstance(env, VectorEnv)
        self._worlds: int = env.num_envs if self._vector else 1
        self._cameras = dict(cameras) if isinstance(cameras, Mapping) else {str(name): name for name in cameras}
        self._size = [int(n) for n in camera_size]
        self._keep_partial, self._info_bytes = keep_partial, info_bytes
        self._options = {**FILE_OPTIONS, **_OPTIONS, **options, "episodes": episodes, "resume": resume}
        self._episodes = episodes
        self.path = Path(out) / f"house_{self._options['house']}"
        """Folder of the episodes."""
        if not resume and self.path.exists() and any(self.path.iterdir()):
            raise ValueError(f"RecordEpisodes: '{self.path}' has a recording: pass resume=True to continue it, or choose another folder")
        prefix = "single_" if self._vector else ""
        spaces = {"observation": getattr(env, f"{prefix}observation_space"), "actions/action": getattr(env, f"{prefix}action_space")}
        self._rows = {name: self._rows_of(name, space) for name, space in spaces.items()}
        self.autoreset = (env.metadata or {}).get("autoreset_mode", AutoresetMode.NEXT_STEP) if self._vector else AutoresetMode.DISABLED
        """When the environments are reset."""
        self._fps = self._rate(fps)
        needs_mujoco = bool(sensors) or any(camera != "render" for camera in self._cameras.values())
        self._mujoco = _MujocoEnvs(self._single_envs(), sensors, decimation) if needs_mujoco else None
        if self.autoreset == AutoresetMode.SAME_STEP and (self._cameras or sensors):
            raise ValueError("RecordEpisodes: cameras and sensors do not see the last state of an episode with AutoresetMode.SAME_STEP; use NEXT_STEP")
        name = getattr(env.spec, "id", None) or type(env.unwrapped).__name__
        self._settings = {"env": name, "cameras": self._cameras, "camera_size": self._size, **(settings or {})}
        self._scene = {"task_description": name, "policy_dt_ms": float(1000 / self._fps)}
        self._core: Any = None
        self._written: dict[str, np.ndarray] = {}
        self._running: set[int] = set()
        self._ended: set[int] = set()
        self._next = 0
        self._warned: set[str] = set()
        self.complete = False
        """Whether all episodes are recorded; the environment then runs on without a recording."""

    @staticmethod
    def _rows_of(name: str, space: Any) -> list[Row]:
        try:
            return rows_of_space(_dicts(space))
        except TypeError as error:
            raise TypeError(f"RecordEpisodes: {name}: {error}; leave it out with gymnasium.wrappers.FilterObservation") from None

    def _single_envs(self) -> Sequence[Any]:
        if not self._vector:
            return [self._env]
        envs = getattr(self._env.unwrapped, "envs", None)
        if envs is None:
            raise TypeError(
                f"RecordEpisodes: the environments of {self._env} are in other processes, where sensors and cameras cannot see them: "
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
        return self._core.kept if self._core is not None else 0

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
        self, action: Any, observation: Any, reward: Any, terminated: Any, truncated: Any, infos: Sequence[Mapping[str, Any]], final: Any = None
    ) -> None:
        """All environments have made a step.

        Args:
            final: function that returns the last observation and info of an episode by world, with SAME_STEP.
        """
        steps, begun, after = {}, {}, {}
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
            self._core = self._open(next(iter(images.values())))
            self.complete = self._core.enough
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
            worlds, [s.reward for s in chosen], [s.terminated for s in chosen], [s.truncated for s in chosen], [s.success for s in chosen]
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
                    f"RecordEpisodes: env.render() has returned {image.dtype} {image.shape}, expected a uint8 image (height, width, 3): "
                    "make the environment with render_mode='rgb_array'"
                )
            images[name] = image
        return images

    def _open(self, images: Mapping[str, np.ndarray]) -> Any:
        handles = []

        def add(name: str, dtype: str, shape: Sequence[int], description: str, **more: Any) -> None:
            spec = {"dtype": dtype, "shape": [*shape], "low": -np.inf, "high": np.inf, "is_dict": False, "unit": "", "frame": "",
                    "description": description, **more}  # fmt: skip
            handles.append(_core.written_rows(name, spec, self._worlds))
            self._written[name] = handles[-1].arrays(writable=True)[""]

        texts = {"observation": "Observation of the environment.", "actions/action": "Action that led to this row; 0 in the first row."}
        for name, rows in self._rows.items():
            for row in rows:
                low, high = row.bounds()
                add("/".join((name, *row.path)), row.kept, row.shape, texts[name], low=low, high=high)
        add("info", "uint8", [self._info_bytes], "Infos of the environment.", is_dict=True, low=0.0, high=255.0)
        for name, image in images.items():
            add(name, "uint8", image.shape, f"Image of the camera '{self._cameras[name]}'.", low=0.0, high=255.0, frame="pixels", video=True)
        attached = self._mujoco.attached if self._mujoco is not None else None
        for sensor in attached.sensors.values() if attached is not None else ():
            if isinstance(sensor, Sensor) and not sensor._mjs_fields:
                raise ValueError(f"sensor '{sensor.uuid}' cannot be recorded: give it an observation_space, or is_dict = True")
            handles.append(sensor._mjs_handle if isinstance(sensor, Sensor) else sensor._handle)
        return _core.Recorder(
            None if attached is None else attached.simulation._core, self._worlds, handles, str(self.path.parent), self._fps.numerator,
            self._fps.denominator, json.dumps(self._settings, sort_keys=True), {**self._options},
        )  # fmt: skip

    def _write(self, world: int, step: _Step, images: Mapping[str, np.ndarray]) -> None:
        for name, values in (("observation", step.observation), ("actions/action", step.action)):
            for i, row in enumerate(self._rows[name]):
                stream = "/".join((name, *row.path))
                if values is not None and np.shape(values[i]) != row.shape:
                    raise ValueError(f"RecordEpisodes: '{stream}' has the shape {np.shape(values[i])}, expected {row.shape} as in its space")
                self._written[stream][world] = 0 if values is None else values[i]
        for name, image in images.items():
            if image.shape != self._written[name].shape[1:]:
                raise ValueError(f"RecordEpisodes: the image of '{name}' was {self._written[name].shape[1:]} and is now {image.shape}")
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


def _seeds(seed: Any, worlds: Sequence[int]) -> dict[int, int | None]:
    """Seed of each world as Gymnasium derives it."""
    if seed is None or isinstance(seed, (int, np.integer)):
        return {w: None if seed is None else int(seed) + w for w in worlds}
    return {w: seed[w] for w in worlds}


@checked
class RecordEpisodes(gymnasium.Wrapper):
    """Records the episodes of a Gymnasium environment, MuJoCo or not, to the files of :func:`mjsense.record`::

        env = mjs.RecordEpisodes(gymnasium.make("HalfCheetah-v5", render_mode="rgb_array"), "data", episodes=10, cameras={"view": "render"})

    Given a ``gymnasium.vector.VectorEnv``, it returns a :class:`RecordVectorEpisodes`, which does the same for all its environments.

    Recorded are the observation, as ``observation`` or one stream for each entry of a dict or tuple, the action that led to it, the reward,
    ``terminated``, ``truncated``, all infos that JSON can express, the cameras and the sensors. A finished episode is safe on disk. When
    `episodes` are recorded, or at ``close()``, the recording is published, and the environment runs on without it.

    Args:
        env: The environment.
        out: Output directory; the files are in ``out/house_<house>/``.
        episodes: Number of episodes to keep.
        cameras: Videos by name: ``"render"`` is ``env.render()``; any other value is a camera (name or id) of the environment's MuJoCo model,
            which :class:`mjsense.Renderer` draws. A sequence of names gives cameras of the model their own names.
        sensors: Sensors over the environment's MuJoCo model, as for :func:`mjsense.attach`.
        camera_size: Height and width of the images of the model's cameras, pixels.
        decimation: Number of ``mj_step`` calls in a step of the environment; by default its ``frame_skip`` or ``n_substeps``.
        fps: Steps per second; by default ``1 / env.unwrapped.dt``, else ``env.unwrapped.control_freq``, else the metadata's ``render_fps``, else 30.
        resume: Continue an interrupted recording with the same settings.
        keep_partial: Keep episodes that ``reset()`` or ``close()`` cuts short; by default they are discarded.
        info_bytes: Maximum length of the JSON text of a step's infos.
        settings: Further settings that produced the data, as JSON: stored in every file, and equal when a recording is resumed.
        options: ``house``, ``batches``, ``gzip``, ``ffmpeg``, ``crf``, ``preset`` and ``molmospaces_depth`` of :class:`mjsense.Recorder`.

    Raises:
        ValueError: If `out` has a recording and `resume` is False, or if a camera or sensor cannot be recorded.
        TypeError: If a space has no arrays, or if a camera or sensor needs a MuJoCo model that the environment does not show.
    """

    recording: _Recording
    """State of the recording: ``path`` is its folder, ``kept`` the number of recorded episodes, ``complete`` whether all are recorded."""

    def __new__(cls, env: Any, *args: Any, **kwargs: Any) -> Any:
        return RecordVectorEpisodes(env, *args, **kwargs) if isinstance(env, VectorEnv) else super().__new__(cls)

    def __init__(
        self,
        env: Any,
        out: str | Path,
        episodes: int,
        *,
        cameras: Mapping[str, Any] | Sequence[str] = (),
        sensors: Sequence[Any] = (),
        camera_size: Sequence[float] = (240, 320),
        decimation: int | None = None,
        fps: float | Fraction | None = None,
        resume: bool = False,
        keep_partial: bool = False,
        info_bytes: int = 2000,
        settings: Mapping[str, Any] | None = None,
        **options: Any,
    ) -> None:
        super().__init__(env)
        self.recording = _Recording(
            env, out, episodes, cameras, sensors, camera_size, decimation, fps, resume, keep_partial, info_bytes, settings, options
        )

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        observation, info = self.env.reset(seed=seed, options=options)
        self.recording.reset(observation, [info], {0: seed})
        return observation, info

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        observation, reward, terminated, truncated, info = self.env.step(action)
        self.recording.step(action, observation, reward, terminated, truncated, [info])
        return observation, reward, terminated, truncated, info

    def close(self) -> None:
        """Publishes the recording and closes the environment."""
        self.recording.close()
        self.env.close()


@checked
class RecordVectorEpisodes(VectorWrapper):
    """:class:`RecordEpisodes` of a ``gymnasium.vector.VectorEnv``, with the same arguments, in all autoreset modes."""

    recording: _Recording
    """State of the recording: ``path`` is its folder, ``kept`` the number of recorded episodes, ``complete`` whether all are recorded."""

    def __init__(
        self,
        env: Any,
        out: str | Path,
        episodes: int,
        *,
        cameras: Mapping[str, Any] | Sequence[str] = (),
        sensors: Sequence[Any] = (),
        camera_size: Sequence[float] = (240, 320),
        decimation: int | None = None,
        fps: float | Fraction | None = None,
        resume: bool = False,
        keep_partial: bool = False,
        info_bytes: int = 2000,
        settings: Mapping[str, Any] | None = None,
        **options: Any,
    ) -> None:
        super().__init__(env)
        self.recording = _Recording(
            env, out, episodes, cameras, sensors, camera_size, decimation, fps, resume, keep_partial, info_bytes, settings, options
        )

    def reset(self, *, seed: Any = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        mask = (options or {}).get("reset_mask", np.ones(self.num_envs, bool))
        observation, infos = self.env.reset(seed=seed, options=options)
        self.recording.reset(observation, self._by_world(infos), _seeds(seed, np.flatnonzero(mask).tolist()))
        return observation, infos

    def step(self, actions: Any) -> tuple[Any, Any, Any, Any, dict[str, Any]]:
        observation, reward, terminated, truncated, infos = self.env.step(actions)

        def final(world: int) -> tuple[Any, dict[str, Any]]:
            return infos["final_obs"][world], _info_of(infos["final_info"], world, self.num_envs)

        self.recording.step(actions, observation, reward, terminated, truncated, self._by_world(infos), final)
        return observation, reward, terminated, truncated, infos

    def _by_world(self, infos: Mapping[str, Any]) -> list[dict[str, Any]]:
        return [_info_of(infos, world, self.num_envs) for world in range(self.num_envs)]

    def close(self, **kwargs: Any) -> None:
        """Publishes the recording and closes the environments."""
        self.recording.close()
        self.env.close(**kwargs)

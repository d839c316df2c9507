# SPDX-License-Identifier: Apache-2.0
"""Recordings of the episodes of any Gymnasium environment."""

from __future__ import annotations

from abc import ABCMeta
from collections.abc import Mapping, Sequence
from fractions import Fraction
from functools import partial
from pathlib import Path
from typing import Any, NoReturn

import gymnasium
import numpy as np
from gymnasium.vector import VectorEnv, VectorWrapper

from mjsense.core.arguments import checked
from mjsense.core.declared_fields import given_options
from mjsense.recording.episode_recording import EpisodeRecording


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


def _seeds(seed: Any, worlds: Sequence[int]) -> dict[int, int | None]:
    """Seed of each world as Gymnasium derives it."""
    if seed is None or isinstance(seed, (int, np.integer)):
        return {w: None if seed is None else int(seed) + w for w in worlds}
    return {w: seed[w] for w in worlds}


class _Recorded:
    """Base class of both wrappers, before that of Gymnasium."""

    recording: EpisodeRecording
    """State of the recording: ``path`` is its folder, ``kept`` the number of recorded episodes, ``complete`` whether all are
    recorded."""

    @partial(checked, context="RecordEpisodes()")
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
        # options of a recording
        resume: bool = False,
        house: int = 0,
        batches: int = 0,
        gzip: int = 4,
        ffmpeg: str = "",
        crf: int = 25,
        preset: str = "veryfast",
        tune: str = "fastdecode",
        keyint: int = 20,
        molmospaces_depth: bool = False,
        # end of options
        keep_partial: bool = False,
        image_videos: bool = False,
        info_bytes: int = 2000,
        settings: Mapping[str, Any] | None = None,
    ) -> None:
        options = given_options("FilesCfg", locals())
        super().__init__(env)  # pyright: ignore[reportCallIssue]  # Gymnasium's
        self.recording = EpisodeRecording(
            env,
            out,
            cameras,
            sensors,
            camera_size,
            decimation,
            fps,
            keep_partial,
            image_videos,
            info_bytes,
            settings,
            options,
        )

    def __enter__(self) -> Any:
        return self

    def __exit__(self, kind: Any, error: Any, traceback: Any) -> None:
        if error is not None:
            self.recording.abandon()
        self.close()  # pyright: ignore[reportAttributeAccessIssue]  # Gymnasium's

    def __del__(self) -> None:
        """Does nothing: Gymnasium before 1.3 closes vector environments here, which would publish the recording of a program that
        fails."""

    def __reduce__(self) -> NoReturn:
        raise TypeError(f"{type(self).__name__}: cannot be copied or pickled; make one in each process, with house=0, 1, 2 ...")


@checked
class RecordEpisodes(_Recorded, gymnasium.Wrapper, metaclass=ABCMeta):  # RecordVectorEpisodes is registered as a virtual subclass
    """Records the episodes of a Gymnasium environment, MuJoCo or not, to the files of :func:`mjsense.record`::

        env = mjs.RecordEpisodes(gymnasium.make("HalfCheetah-v5", render_mode="rgb_array"), "data", episodes=10, cameras={"view":
        "render"})

    Given a ``gymnasium.vector.VectorEnv``, it returns a :class:`RecordVectorEpisodes`, which does the same for all its
    environments, and which ``isinstance`` regards as a ``RecordEpisodes``.

    Recorded are the observation, as ``observation`` or one stream for each entry of a dict or tuple, the action that led to it,
    the reward, ``terminated``, ``truncated``, all infos that JSON can express, the cameras and the sensors. A finished episode is
    safe on disk. When `episodes` are recorded, or at ``close()``, the recording is published, and the environment runs on without
    it. An exception that ends a ``with`` block leaves the recording unpublished, so that ``resume=True`` can continue it.

    Args:
        env: The environment.
        out: Output directory; the files are in ``out/house_<house>/``.
        episodes: Number of episodes to keep.
        cameras: Videos by name: ``"render"`` is ``env.render()``; any other value is a camera (name or id) of the environment's
            MuJoCo model, which :class:`mjsense.Renderer` draws. A sequence of names gives cameras of the model their own names.
        sensors: Sensors over the environment's MuJoCo model, as for :func:`mjsense.attach`.
        camera_size: Height and width of the images of the model's cameras, pixels.
        decimation: Number of ``mj_step`` calls in a step of the environment; by default its ``frame_skip`` or ``n_substeps``.
        fps: Steps per second; by default ``1 / env.unwrapped.dt``, else ``env.unwrapped.control_freq``, else the metadata's
            ``render_fps``, else 30.

        Options:
        resume: Continue an interrupted recording; all settings that affect the data must be unchanged.
        house: Number of the ``house_N`` folder in the output directory. Each house of a task has its own random
            numbers.
        batches: Number of HDF5 files over which the episodes are distributed; 0: one per four episodes.
        gzip: Compression level of arrays, 0 to 9.
        ffmpeg: Path of the ffmpeg program; by default ``$MJSENSE_FFMPEG``, else the one in ``PATH``.
        crf: Quality of the videos, from 0 (lossless) to 51 (worst).
        preset: Speed preset of the video encoder, from ultrafast to veryslow; see the page on file formats.
        tune: Tuning of x264 for a purpose; empty: none. ``fastdecode`` halves the time of decoding, and files are a
            seventh larger.
        keyint: Maximum number of frames between key frames. A small value makes random access faster, a large value
            makes files smaller.
        molmospaces_depth: Add depth in the form that MolmoSpaces' loaders read: a lossy red-green video.
        Others:
        keep_partial: Keep episodes that ``reset()`` or ``close()`` cuts short; by default they are discarded.
        image_videos: Store RGB images in the observation, uint8 ``[H, W, 3]`` or ``[3, H, W]``, as videos, which exports contain
            and which are smaller, but not exact. By default they are stored exactly, as arrays.
        info_bytes: Maximum length of the JSON text of a step's infos.
        settings: Further settings that produced the data, as JSON: stored in every file, and equal when a recording is resumed.

    Raises:
        ValueError: If `out` has a recording and `resume` is False, or if a camera or sensor cannot be recorded.
        TypeError: If a space has no arrays, or if a camera or sensor needs a MuJoCo model that the environment does not show.
    """

    def __new__(cls, env: Any, *args: Any, **kwargs: Any) -> Any:
        return RecordVectorEpisodes(env, *args, **kwargs) if isinstance(env, VectorEnv) else super().__new__(cls)

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
class RecordVectorEpisodes(_Recorded, VectorWrapper):
    """:class:`RecordEpisodes` of a ``gymnasium.vector.VectorEnv``, with the same arguments, in all autoreset modes."""

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


RecordEpisodes.register(RecordVectorEpisodes)

# SPDX-License-Identifier: Apache-2.0
"""Recorded episodes with other cameras and sensors, as a new recording."""

from __future__ import annotations

import json
import time
from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from mjsense import _core
from mjsense.core.arguments import checked
from mjsense.core.counted import counted
from mjsense.core.declared_fields import declared_fields, given_options
from mjsense.core.old_names import old_argument
from mjsense.core.progress_line import line_of
from mjsense.dataset import bounded_json, render_cameras
from mjsense.dataset.archive import MAX_BYTES
from mjsense.dataset.dataset import Dataset, by_house, opened
from mjsense.dataset.episode_worlds import EpisodeWorlds, show_states
from mjsense.dataset.hdf5 import open_h5
from mjsense.dataset.limits import SCENE_BYTES
from mjsense.dataset.places import read_plain
from mjsense.dataset.playback import archive_of, inputs_of, where
from mjsense.dataset.render_cameras import RenderCamera
from mjsense.recording.existing import require_no_recording
from mjsense.recording.ffmpeg import use_installed_ffmpeg
from mjsense.recording.recorder import recorded_sensors
from mjsense.sensors.core_sensors import CoreSensor

if TYPE_CHECKING:
    from mjsense.dataset.episode import Episode

_STEP_FIELDS = ("rewards", "terminated", "truncated", "success")


@dataclass(frozen=True)
class RenderProgress:
    """Progress of a rendering."""

    finished: int
    """Number of episodes on disk."""
    wanted: int
    frames: int
    """Images that were rendered, of all cameras."""
    seconds: float
    """Wall-clock time."""


@dataclass(frozen=True)
class RenderSummary(RenderProgress):
    """Result of a rendering."""

    paths: list[Path]
    """Folders of the episodes."""


class _Progress:
    """Reports at most ten times per second."""

    def __init__(self, wanted: int, report: bool | Callable[[RenderProgress], None] | None) -> None:
        line = self._line = line_of(report)
        self._report = report if callable(report) else None if line is None else lambda now: line.show(_text(now))
        self._begun, self._reported = time.monotonic(), -1.0
        self.now = RenderProgress(0, wanted, 0, 0.0)

    def add(self, finished: int, frames: int, force: bool = False) -> None:
        seconds = time.monotonic() - self._begun
        self.now = RenderProgress(self.now.finished + finished, self.now.wanted, self.now.frames + frames, seconds)
        if self._report and (force or seconds - self._reported > 0.1):
            self._reported = seconds
            self._report(self.now)

    def end(self) -> None:
        """Reports the result."""
        self.add(0, 0, force=True)
        if self._line is not None:
            self._line.show(_text(self.now), last=True)


def _text(now: RenderProgress) -> str:
    return f"{now.finished}/{now.wanted} episodes  {now.frames} images  {now.frames / max(now.seconds, 1e-9):.0f} images/s"


@dataclass
class _Playing:
    """An episode in a world."""

    episode: Episode
    steps: dict[str, np.ndarray]
    t: int = 0


class _House:
    """Renders the episodes of one house."""

    def __init__(
        self, episodes: list[Episode], others: list[int], out: Path, options: dict[str, Any], progress: _Progress
    ) -> None:
        self._episodes, self._progress = episodes, progress
        first = episodes[0]
        archive_of(first)  # raises an error with the reason if the recording has no data for replay
        cameras, self._system, unchanged = render_cameras.choose(
            first,
            options["cameras"],
            options["add_cameras"] or {},
            options["camera_system"],
            **{key: options[key] for key in ("width", "height", "depth", "segmentation")},
        )
        settings = first._recording.settings
        images = render_cameras.recorded_images(settings, options)
        recorded = settings.get("render", {}).get("brightness", 1.0)
        brightness = recorded if options["brightness"] is None else options["brightness"]
        changes = {name for name in (*images, "brightness", *declared_fields("VideoCfg")) if options.get(name) is not None}
        as_recorded = options["copy"] and not options["edit"] and not changes - {"ffmpeg"}
        copied = unchanged if as_recorded else []
        new_cameras = [camera for camera in cameras if camera not in copied]
        self._frames = sum(1 + camera.depth for camera in new_cameras)
        handles = self._make_worlds(new_cameras, images, brightness, options)
        self._skip = _replaced_streams(first, copied)
        changed = {
            "cameras": [camera.settings() for camera in cameras],
            **images,
            "render": {
                "of": first._recording.provenance,
                "carried": _carried_streams(first, self._skip),
                "episodes": [episode.number for episode in episodes],
                "brightness": brightness,
                "camera_system": options["camera_system"],
            },
        }
        self._recorder = self._make_recorder(out, handles, settings | changed, options)
        self.path = Path(self._recorder.path)
        for number in () if self._recorder.enough else others:
            if not self._recorder.decided(number):
                self._recorder.skip_episode(number, "not in the rendering")

    def _make_worlds(
        self, cameras: list[RenderCamera], images: dict[str, Any], brightness: float, options: dict[str, Any]
    ) -> list[Any]:
        """Makes the simulation with the cameras and sensors. Returns the handles of the streams to record."""
        first, sensors = self._episodes[0], list(options["sensors"])
        suite_sensors = [sensor for sensor in sensors if isinstance(sensor, CoreSensor)]
        scene_sensors = [sensor for sensor in sensors if not isinstance(sensor, CoreSensor)]
        views = [camera.scene_sensor(images) for camera in cameras]
        self._worlds = EpisodeWorlds(
            first,
            min(options["num_worlds"], len(self._episodes)),
            [*views, *scene_sensors],
            edit=options["edit"],
            check=lambda model: render_cameras.check_frames(render_cameras.recorded_cameras(first, None), model, first),
            brightness=brightness,
            threads=options["threads"],
        )
        if self._system:
            self._system.bind(self._worlds)
        own = [self._worlds.scene[_key_of(sensor)] for sensor in scene_sensors]
        streams = [stream for camera in cameras for stream in camera.streams()]
        self._sensors, handles = recorded_sensors(self._worlds.sim, [*streams, *own, *suite_sensors])
        for handle in handles:
            # Between recorded states, the motion in images is interpolated.
            if handle.has_memory and handle.kind != "camera":
                raise ValueError(
                    f"sensor '{handle.name}' depends on the physics steps between observations (air time, history, delays); "
                    "render computes sensors from the recorded states only"
                )
        return handles

    def _make_recorder(self, out: Path, handles: list[Any], settings: dict[str, Any], options: dict[str, Any]) -> Any:
        """The recorder of the new recording, whose other options are those of the old one."""
        first, sim = self._episodes[0], self._worlds.sim
        description, archive, rate = first._recording, archive_of(first), Fraction(first.fps)
        recorded = {"gzip": description.gzip, **(description.video or {})}
        files = {
            **recorded,
            **given_options("FilesCfg", options),
            "episodes": len(self._episodes),
            "house": first.house or 0,
            "archive": (archive.name, read_plain(archive, MAX_BYTES)),
        }
        use_installed_ffmpeg()
        text = json.dumps(settings, sort_keys=True, separators=(",", ":"))
        return _core.Recorder(sim._core, sim.num_worlds, handles, str(out), rate.numerator, rate.denominator, text, files)

    def run(self) -> None:
        recorder, worlds = self._recorder, self._worlds
        pending = deque(episode for episode in self._episodes if not recorder.decided(episode.number))
        self._progress.add(len(self._episodes) - len(pending), 0)
        playing: list[_Playing | None] = [None] * worlds.sim.num_worlds
        while True:
            for w, busy in enumerate(playing):
                if busy is None and pending:
                    playing[w] = self._begin(w, pending.popleft())
            active = [(w, p) for w, p in enumerate(playing) if p is not None]
            if not active:
                break
            ids = [w for w, _ in active]
            show_states(worlds.sim, ids, [inputs_of(p.episode).state[p.t] for _, p in active])
            recorder.append(ids, *([p.steps[name][p.t].item() for _, p in active] for name in _STEP_FIELDS))
            if failed := worlds.sim.failures:
                raise RuntimeError(f"{where(playing[failed[0][0]].episode)}: {failed[0][1]}")  # pyright: ignore[reportOptionalMemberAccess]
            finished = 0
            for w, p in active:
                p.t += 1
                if p.t == p.episode.length:
                    self._finish(w, p.episode)
                    playing[w] = None
                    finished += 1
            self._progress.add(finished, self._frames * len(ids))
        recorder.complete()

    def _begin(self, world: int, episode: Episode) -> _Playing:
        self._worlds.begin(world, episode)
        steps = {name: episode[name] for name in _STEP_FIELDS}
        if self._system:
            show_states(self._worlds.sim, [world], [inputs_of(episode).state[0]])
            self._system.place(world, episode)
        self._recorder.begin_episode(world, episode.number, episode.seed or 0)
        return _Playing(episode, steps)

    def _finish(self, world: int, episode: Episode) -> None:
        with open_h5(episode.path) as file:
            scene = file[episode.trajectory]["obs_scene"].text()
            bounded_json.parse(scene, f"{episode.path} {episode.trajectory}/obs_scene", SCENE_BYTES, standard=True)
        self._recorder.carry_over(world, str(episode.path.absolute()), episode.trajectory, self._skip)
        self._recorder.finish_episode(world, scene, episode.outcome)


def _replaced_streams(episode: Episode, copied: list[RenderCamera]) -> list[str]:
    """Streams of the recorded cameras that are rendered again or left out, all but those of the copied cameras."""
    names = [camera.name for camera in render_cameras.recorded_cameras(episode, None) if camera not in copied]
    places = ("sensor_data/{}", "sensor_data/{}_depth", "sensor_data/{}_depth_16bit", "sensor_param/{}", "extra/{}_segmentation")
    return [f"obs/{place.format(name)}" for name in names for place in places]


def _carried_streams(episode: Episode, replaced: list[str]) -> list[str]:
    """Streams of the recording that are carried over, as its description lists them. ``verify`` reports one that is missing."""
    stated = episode._recording.provenance
    rendered = stated.get("settings", {}).get("render", {})
    listed = [*_texts(stated.get("streams")), *(_texts(rendered.get("carried")) if isinstance(rendered, dict) else ())]

    def is_replaced(entry: str) -> bool:
        # The name in "qpos uint8(2000,)".
        name = entry[: entry.rfind("(")].rpartition(" ")[0].replace("sensor_param_", "obs/sensor_param/", 1)
        places = [name] if name.startswith("obs/") else [f"obs/extra/{name}", f"obs/sensor_data/{name.replace('/', '_')}"]
        return any(place == prefix or place.startswith(f"{prefix}/") for place in places for prefix in replaced)

    return [entry for entry in listed if not is_replaced(entry)]


def _texts(value: Any) -> list[str]:
    return [text for text in value if isinstance(text, str)] if isinstance(value, list) else []


def _key_of(sensor: Any) -> str:
    return getattr(sensor, "prefixed_name", None) or getattr(sensor, "uuid", None) or sensor.name


@old_argument("worlds", "num_worlds")
@checked
def render(
    root: str | Path | Dataset,
    out: str | Path,
    *,
    cameras: Sequence[str] | None = None,
    add_cameras: Mapping[str, Mapping[str, Any]] | None = None,
    camera_system: str = "",
    # options of a recording
    width: int | None = None,
    height: int | None = None,
    depth: bool | None = None,
    segmentation: bool | None = None,
    shadows: bool | None = None,
    samples: int | None = None,
    shadow_samples: int | None = None,
    shading: Literal["classic", "pbr", "path"] | None = None,
    samples_per_pixel: int | None = None,
    exposure: float | None = None,
    exposure_mode: Literal["fixed", "auto"] | None = None,
    exposure_time_constant: float | None = None,
    imager: Literal["none", "d435", "zed_mini"] | None = None,
    motion_samples: int | None = None,
    tone_mapping: Literal["neutral", "filmic", "linear", "agx"] | None = None,
    white_balance: float | None = None,
    environment: str | None = None,
    environment_intensity: float | None = None,
    environment_rotation: float | None = None,
    ambient_occlusion: bool | None = None,
    brightness: float | None = None,
    num_worlds: int = 4,
    threads: int = 0,
    resume: bool = False,
    batches: int = 0,
    gzip: int | None = None,
    ffmpeg: str = "",
    crf: int | None = None,
    preset: str | None = None,
    tune: str | None = None,
    keyint: int | None = None,
    molmospaces_depth: bool | None = None,
    # end of options
    edit: Callable[[Any], None] | None = None,
    sensors: Callable[[], Iterable[Any]] | Iterable[Any] = (),
    copy: bool = True,
    episodes: Sequence[int] | None = None,
    progress: bool | Callable[[RenderProgress], None] | None = None,
) -> RenderSummary:
    """Renders recorded episodes again, with other or more cameras and sensors, into a new recording.

    Every number of the old recording is carried over unchanged: actions, rewards, states, data for replay, ``obs_scene`` and
    outcomes. Images and sensors are computed from the recorded states and the archived model; videos of recorded cameras that do
    not change are copied. Nothing is simulated, and neither the task nor the policy is needed. Ctrl-C keeps the finished
    episodes; call again with ``resume=True`` to continue.

    Args:
        root: Folder of a recording, or a :class:`Dataset`.
        out: Output directory.
        cameras: Names of the recorded cameras to render; by default all, or none with ``camera_system``.
        add_cameras: New cameras by name: a dict with ``pos`` (m) and either ``lookat`` (m) or ``quat`` (wxyz; x right, y up,
            looking along -z), all in the frame of ``body`` (full name; by default the world); and optionally ``up``, ``fovy``
            (degrees), ``width``, ``height`` (pixels), ``depth`` and ``segmentation``.
        camera_system: Name or file of a camera system of the robot.

        Options:
        width: Width of the images; by default each camera's. ``width`` or ``height`` alone keeps the aspect ratio.
            [pixels]
        height: Height of the images; by default each camera's. [pixels]
        depth: Add a lossless depth image for every camera. By default as recorded.
        segmentation: Add a lossless segmentation image for every camera: (id, mjtObj) of each pixel. By default as
            recorded.
        shadows: Draw shadows. By default as recorded.
        samples: Rays per pixel of rgb; more samples give smoother edges and take longer. By default as recorded.
        shadow_samples: Points of each light at which its shadows are computed, within the ball of its ``bulbradius``;
            more than 1 gives soft shadows and takes longer. A view has at most 32 lights and points. By default as
            recorded.
        shading: classic: MuJoCo's light model. pbr: physically based materials, lights and surroundings; depth,
            segmentation and the other images are the same. path: the same by path tracing, which is the reference for
            pbr and takes much longer. The options below belong to pbr and path. By default as recorded.
        samples_per_pixel: Paths per pixel with shading path; four times as many halve the noise. ``samples`` and
            ``shadow_samples`` are for the other kinds of shading. By default as recorded.
        exposure: Exposure in EV at ISO 100; 1 more halves the brightness. By default as recorded.
        exposure_mode: auto: a meter chooses the exposure of each world, instead of ``exposure``. By default as
            recorded.
        exposure_time_constant: Time in which the automatic exposure covers 63 % of a change; 0: it follows at once. By
            default as recorded. [s]
        imager: Colour sensor of a real camera: photon and read noise, vignetting, quantisation, motion blur and rolling
            shutter. By default as recorded.
        motion_samples: Instants of an exposure of which an image with ``imager`` is the mean, where something moves; 0:
            neither motion blur nor rolling shutter. By default as recorded.
        tone_mapping: From radiance to colours. neutral: keeps the colours of materials; filmic: soft contrast; linear:
            clips; agx: bright colours become white. By default as recorded.
        white_balance: Colour temperature of the light that appears white. By default as recorded. [K]
        environment: Light from the surroundings. model: the model's image light, else studio; auto: its image light,
            else its skybox, else studio; skybox: its skybox; studio: a neutral bright room; or the path of an .hdr or
            .exr file, which is also the background. By default as recorded.
        environment_intensity: Factor of the light from the surroundings. By default as recorded.
        environment_rotation: Rotation of the surroundings about the world's z axis; a skybox in the background does not
            rotate. By default as recorded. [degrees]
        ambient_occlusion: Darken the light from the surroundings where other geoms are near. By default as recorded.
        brightness: Factor of all lights. By default as recorded.
        num_worlds: Number of episodes that are rendered in parallel.
        threads: Number of threads; 0: one per available CPU.
        resume: Continue an interrupted recording; all settings that affect the data must be unchanged.
        batches: Number of HDF5 files over which the episodes are distributed; 0: one per four episodes.
        gzip: Compression level of arrays, 0 to 9. By default as recorded.
        ffmpeg: Path of the ffmpeg program; by default ``$MJSENSE_FFMPEG``, else the one in ``PATH``.
        crf: Quality of the videos, from 0 (lossless) to 51 (worst). By default as recorded.
        preset: Speed preset of the video encoder, from ultrafast to veryslow; see the page on file formats. By default
            as recorded.
        tune: Tuning of x264 for a purpose; empty: none. ``fastdecode`` halves the time of decoding, and files are a
            seventh larger. By default as recorded.
        keyint: Maximum number of frames between key frames. A small value makes random access faster, a large value
            makes files smaller. By default as recorded.
        molmospaces_depth: Add depth in the form that MolmoSpaces' loaders read: a lossy red-green video. By default as
            recorded.
        Others:
        edit: Function that edits the MjSpec before compilation: adds lights, replaces textures, hides geoms. Bodies, joints and
            geoms must stay as they are.
        sensors: Configurations of sensors, user-defined :class:`Sensor` objects, or sensors such as :class:`PoseSensor`; for a
            recording with several houses, a function that makes them for each house. One with the name of a recorded stream
            replaces it.
        copy: Copy the videos of recorded cameras of which no option changes the images. False: render them again, with the same
            result.
        episodes: Positions of episodes in the recording; by default all.
        progress: Show the progress on stderr, or a function that is called with it about ten times per second; by default shown
            where stderr is a terminal or a notebook.
    """
    options: dict[str, Any] = dict(locals())
    _core.check_options("RenderCfg", given_options("RenderCfg", {**options, "episodes": None}))
    dataset = opened(root, episodes)
    if not dataset.episodes:
        raise ValueError(f"{dataset.root} contains no episodes")
    houses = by_house(dataset.episodes)
    made = sensors if callable(sensors) else None
    given = () if callable(sensors) else list(sensors)
    if len(houses) > 1 and any(not hasattr(sensor, "kind") or isinstance(sensor, CoreSensor) for sensor in given):
        raise ValueError(
            f"{dataset.root} has {counted(len(houses), 'house')}: pass a function that makes the sensors, because each belongs "
            "to one simulation"
        )
    if Path(out).resolve() in {dataset.root.resolve(), *(chosen[0].path.resolve().parents[1] for chosen in houses)}:
        raise ValueError(f"the output directory '{out}' is that of the recording; choose another one")
    if not resume:
        for chosen in houses:
            require_no_recording(Path(out) / f"house_{chosen[0].house or 0}", "resume it")
    state = _Progress(len(dataset.episodes), progress)
    paths = []
    for chosen in houses:
        chosen.sort(key=lambda episode: episode.number)
        numbers = {episode.number for episode in chosen}
        others = [number for number in range(max(numbers)) if number not in numbers]
        house = _House(chosen, others, Path(out), options | {"sensors": made() if made else given}, state)
        house.run()
        paths.append(house.path)
    state.end()
    return RenderSummary(**vars(replace(state.now)), paths=paths)

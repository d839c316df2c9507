# SPDX-License-Identifier: Apache-2.0
"""The cameras of a rendering: those of the recording, added ones, and those of a camera system."""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from mjsense import _core
from mjsense.core import mujoco_names
from mjsense.core.declared_fields import declared_fields
from mjsense.core.errors import UnknownNameError, did_you_mean
from mjsense.core.rotations import quaternions_of
from mjsense.dataset.description import is_known_thing, printable
from mjsense.dataset.hdf5 import open_h5
from mjsense.dataset.playback import where
from mjsense.dataset.streams import VIDEOS
from mjsense.sensors.configs import CameraSensorCfg
from mjsense.sensors.core_sensors import CameraImageSensor, CameraParameterSensor

if TYPE_CHECKING:
    from mjsense.dataset.episode import Episode
    from mjsense.dataset.episode_worlds import EpisodeWorlds

ROBOT_PREFIX = "robot_0/"
_DEFAULT_SIZE = (640, 480)


@functools.cache
def image_options() -> dict[str, str]:
    """Fields of :class:`mjsense.CameraSensorCfg` by the option of a recording that sets them for all cameras, but for the size,
    which each camera has. The camera's name of a switch begins with ``use_``."""
    fields = declared_fields("CameraSensorCfg").keys() - {"width", "height"}
    return {name: field for name in declared_fields("ImageCfg") for field in (name, f"use_{name}") if field in fields}


def recorded_images(settings: Mapping[str, Any], given: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """Values of :func:`image_options`: those of `given` that are not None, otherwise of a recording with these settings. One that
    is older than an option has its default.

    Raises:
        ValueError: If the recording names a file as environment and `given` has none.
    """
    images = {name: settings.get(name, declared_fields("ImageCfg")[name]["default"]) for name in image_options()}
    own = {name: given[name] for name in images if given and given.get(name) is not None}
    if "environment" not in own and shows_file({**images, **own}):
        raise ValueError(
            f"environment '{printable(images['environment'][:100])}': the recording names a file, and files are not "
            "taken from a recording; "
            "pass the option environment"
        )
    return {**images, **own}


def shows_file(settings: Mapping[str, Any]) -> bool:
    """Whether the images of a recording with these settings show surroundings that are read from a file."""
    return settings.get("shading", "classic") != "classic" and not is_known_thing(settings.get("environment"))


@dataclass(frozen=True)
class RenderCamera:
    """A camera to render. If ``camera`` is empty, it is added to the model at ``pos``, ``quat`` in the frame of ``body``."""

    name: str
    width: int
    height: int
    depth: bool = False
    segmentation: bool = False
    camera: str = ""
    body: str = ""
    pos: tuple[float, ...] = ()
    quat: tuple[float, ...] = ()
    fovy: float | None = None

    @property
    def fields(self) -> list[str]:
        return ["rgb", *(["depth"] if self.depth else []), *(["segmentation"] if self.segmentation else [])]

    def scene_sensor(self, images: Mapping[str, Any]) -> CameraSensorCfg:
        """The camera as a sensor.

        Args:
            images: Values of the image options of a recording, by name.
        """
        about: dict[str, Any] = dict(name=self.name, width=self.width, height=self.height, data_types=tuple(self.fields))
        about |= {field: images[option] for option, field in image_options().items()}
        if self.camera:
            return CameraSensorCfg(camera_name=self.camera, **about)
        return CameraSensorCfg(parent_body=self.body or None, pos=self.pos, quat=self.quat, fovy=self.fovy, **about)

    def streams(self) -> list[Any]:
        """The sensors that a recording has of a camera, in its order."""
        parameters = CameraParameterSensor(self.camera or self.name, self.width, self.height, f"sensor_param_{self.name}")
        return [parameters, *(CameraImageSensor(self.name, field) for field in self.fields)]

    def settings(self) -> dict[str, Any]:
        """Its entry in ``cameras`` of the recording's settings."""
        return {
            key: value
            for key, value in asdict(self).items()
            if key not in ("segmentation", "camera", "body", "pos", "quat", "fovy") or value
        }


def recorded_cameras(episode: Episode, names: Sequence[str] | None) -> list[RenderCamera]:
    """Cameras of the recording, all or some, as they were recorded."""
    entries = {entry["name"]: entry for entry in episode._recording.settings.get("cameras", [])}
    chosen = list(entries) if names is None else list(names)
    cameras = []
    with open_h5(episode.path) as file:
        for name in chosen:
            if name not in entries:
                raise UnknownNameError(_core.unknown_name(str(episode.path), "camera", name, list(entries)))
            entry = entries[name]
            if "pos" not in entry and "camera" not in entry:
                frame = file[episode.trajectory][f"obs/sensor_data/{name}"].attrs.text("frame")
                entry = {**entry, "camera": frame.removeprefix("camera ")}
            about: dict[str, Any] = {key: tuple(value) if isinstance(value, list) else value for key, value in entry.items()}
            cameras.append(RenderCamera(**about))
    return cameras


def check_frames(cameras: Sequence[RenderCamera], model: Any, episode: Episode) -> None:
    """Raises UnknownNameError if the archived model does not have the camera or the body of a camera."""
    for camera in cameras:
        for kind, name in ((mujoco_names.Obj.CAMERA, camera.camera), (mujoco_names.Obj.BODY, camera.body)):
            if name:
                mujoco_names.known_id(model, kind, name, f"{episode.path}: camera '{camera.name}'")


_KEYS = ("pos", "lookat", "quat", "body", "up", "fovy", "width", "height", "depth", "segmentation")


def _vector(name: str, key: str, value: Any, size: int) -> np.ndarray:
    try:
        vector = np.asarray(value, np.float64)
    except (TypeError, ValueError):
        vector = np.zeros(0)
    if vector.shape != (size,) or not np.isfinite(vector).all():
        raise ValueError(f"camera '{name}': {key} is {value!r}; it must be {size} numbers")
    return vector


def _looking(name: str, pos: np.ndarray, target: np.ndarray, up: np.ndarray) -> np.ndarray:
    """Orientation (wxyz) of a camera at ``pos`` that looks at ``target``."""
    forward = target - pos
    if not np.linalg.norm(forward) > 1e-9:
        raise ValueError(f"camera '{name}': lookat is at the camera's position, so the viewing direction is undefined")
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, up)
    if np.linalg.norm(right) < 1e-6 * np.linalg.norm(up):  # straight up or down
        right = np.cross(forward, [0.0, 1.0, 0.0] if abs(forward[1]) < 0.9 else [1.0, 0.0, 0.0])
    if not np.linalg.norm(right) > 0:
        raise ValueError(f"camera '{name}': up is zero")
    right /= np.linalg.norm(right)
    return quaternions_of(np.stack([right, np.cross(right, forward), -forward], 1))


def added_camera(name: str, given: Mapping[str, Any], size: tuple[int, int]) -> RenderCamera:
    """A camera from ``{"pos": ..., "lookat": ...}`` or ``{"pos": ..., "quat": ...}``, and optionally ``body``, ``up``, ``fovy``,
    ``width``, ``height``, ``depth``, ``segmentation``."""
    for key in given:
        if key not in _KEYS:
            raise UnknownNameError(f"camera '{name}' has no '{key}'{did_you_mean(key, _KEYS, 'it has')}")
    if "pos" not in given or ("lookat" in given) == ("quat" in given):
        raise ValueError(f"camera '{name}' needs pos, and either lookat or quat; given: {', '.join(given) or 'nothing'}")
    pos = _vector(name, "pos", given["pos"], 3)
    if "quat" in given:
        quat = _vector(name, "quat", given["quat"], 4)
        if not np.linalg.norm(quat) > 1e-9:
            raise ValueError(f"camera '{name}': quat is zero")
    else:
        quat = _looking(
            name, pos, _vector(name, "lookat", given["lookat"], 3), _vector(name, "up", given.get("up", (0, 0, 1)), 3)
        )
    fovy = given.get("fovy")
    return RenderCamera(
        name,
        int(given.get("width", size[0])),
        int(given.get("height", size[1])),
        bool(given.get("depth", False)),
        bool(given.get("segmentation", False)),
        "",
        str(given.get("body") or ""),
        tuple(pos.tolist()),
        tuple(quat.tolist()),
        None if fovy is None else float(fovy),
    )


class CameraSystem:
    """A camera system of the recording's robot, by name or file. Its variation is that of a recording with the same seed."""

    def __init__(self, name: str, episode: Episode) -> None:
        robot = episode._recording.settings.get("robot")
        if not robot:
            raise ValueError(f"camera_system '{name}': {episode.path} was recorded without a robot; use add_cameras")
        if not is_known_thing(robot):
            raise ValueError(
                f"camera_system '{name}': {episode.path} names the robot '{robot}', a file, which is not taken from "
                "a recording; use add_cameras"
            )
        self._robot = _core.Robot(robot)
        self._system = _core.CameraSystem(name, self._robot.file, ROBOT_PREFIX, self._robot.base)
        self.cameras: list[RenderCamera] = []
        for m in self._system.mounts():
            about = {key: m[key] for key in ("name", "width", "height", "depth", "segmentation")}
            if m["is_new"]:
                about |= {"body": m["body"], "pos": tuple(m["pos"]), "quat": tuple(m["quat"]), "fovy": m["fovy"]}
            else:
                about |= {"camera": m["camera"]}
            self.cameras.append(RenderCamera(**about))

    def resize(self, width: int | None, height: int | None) -> None:
        """Gives the images another size, on which it depends whether a pose shows the objects well enough."""
        self.cameras = [sized(camera, width, height) for camera in self.cameras]
        for i, camera in enumerate(self.cameras):
            self._system.set_size(i, camera.width, camera.height)

    def bind(self, worlds: EpisodeWorlds) -> None:
        self._worlds = worlds
        self._system.initialize(worlds.sim._core)
        model = worlds.sim.model
        sites = [ROBOT_PREFIX + group["leaf_site"] for group in self._robot.groups if group["kind"] == "gripper"]
        self._sites = [mujoco_names.name2id(model, mujoco_names.Obj.SITE, site) for site in sites]

    def place(self, world: int, episode: Episode) -> None:
        """Places the cameras for an episode, of which the world shows the first state."""
        if not self._system.varies:
            return
        sim = self._worlds.sim
        objects = episode.obs_scene.get("objects", {})
        names = [role.get("body") for role in (objects.values() if isinstance(objects, dict) else ()) if isinstance(role, dict)]
        bodies = [mujoco_names.name2id(sim.model, mujoco_names.Obj.BODY, name) for name in names if isinstance(name, str)]
        points = [sim.data.xpos[world, body] for body in bodies if body >= 0]
        points += [sim.data.site_xpos[world, site] for site in self._sites if site >= 0]
        centre = sum(points, np.zeros(3)) * (1.0 / len(points)) if points else np.zeros(3)
        why = self._system.place(sim._core, world, episode.seed or 0, episode.number, list(centre), [b for b in bodies if b >= 0])
        if why:
            raise ValueError(f"{where(episode)}: {why}")


def sized(camera: RenderCamera, width: int | None, height: int | None) -> RenderCamera:
    """The camera with another size. One side alone keeps the aspect ratio, to an even number."""
    if width is None and height is None:
        return camera
    if width is None:
        assert height is not None
        width = max(2, 2 * round(0.5 * height * camera.width / camera.height))
    if height is None:
        height = max(2, 2 * round(0.5 * width * camera.height / camera.width))
    return replace(camera, width=width, height=height)


def choose(
    episode: Episode,
    cameras: Sequence[str] | None,
    add_cameras: Mapping[str, Mapping[str, Any]],
    camera_system: str,
    *,
    width: int | None,
    height: int | None,
    depth: bool | None,
    segmentation: bool | None,
) -> tuple[list[RenderCamera], CameraSystem | None, list[RenderCamera]]:
    """The cameras in the order of the new recording, the camera system, and those cameras whose videos are as recorded."""
    system = CameraSystem(camera_system, episode) if camera_system else None
    if cameras is None and system is not None:
        cameras = []
    if system is not None:
        system.resize(width, height)
    recorded = recorded_cameras(episode, cameras)
    chosen = [*recorded, *(system.cameras if system else [])]
    every = recorded or recorded_cameras(episode, None)
    size = (every[0].width, every[0].height) if every else _DEFAULT_SIZE
    chosen += [added_camera(name, given, size) for name, given in add_cameras.items()]
    chosen = [sized(camera, width, height) for camera in chosen]
    if depth is not None:
        chosen = [replace(camera, depth=depth) for camera in chosen]
    if segmentation is not None:
        chosen = [replace(camera, segmentation=segmentation) for camera in chosen]
    names = [camera.name for camera in chosen]
    twice = {name for name in names if names.count(name) > 1}
    if twice:
        raise ValueError(f"two cameras are named '{sorted(twice)[0]}'; a camera that is added needs a new name")
    unchanged = [camera for camera, before in zip(chosen, recorded) if camera == before]
    return chosen, system, [camera for camera in unchanged if VIDEOS + camera.name in episode.streams]

# SPDX-License-Identifier: Apache-2.0
"""Episodes of MolmoSpaces' benchmarks: a list of EpisodeSpec in ``benchmark.json``, or a file for each in ``house_*``.

Everything that is read is checked here. Names only serve to find bodies, joints and move groups of a model; task classes are
looked up in a table, and never imported.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mjsense.core.counted import counted
from mjsense.core.errors import did_you_mean
from mjsense.dataset import bounded_json
from mjsense.dataset.places import printable, read_plain
from mjsense.evaluation.benchmarks import IMAGE_OPTIONS, checked_recipe

FILE = "benchmark.json"
FILE_BYTES, EPISODE_BYTES, MAX_VALUES = 1 << 26, 1 << 22, 5_000_000
MAX_EPISODES = 100_000
_MAX_OBJECTS, _MAX_CAMERAS, _MAX_JOINTS, _MAX_PIXELS = 10_000, 32, 100, 8192
_FAR = 1e4  # m and rad, greatest magnitude of a number
_NAME, _TEXT = 200, 1000  # characters

TASKS = {
    "pick": "pick_task.PickTask",
    "pick_and_place": "pick_and_place_task.PickAndPlaceTask",
    "pick_and_place_next_to": "pick_and_place_next_to_task.PickAndPlaceNextToTask",
    "pick_and_place_color": "pick_and_place_color_task.PickAndPlaceColorTask",
    "packing": "packing_task.PackingTask",
    "open": "opening_tasks.OpeningTask",
    "door_opening": "opening_tasks.DoorOpeningTask",
    "nav_to_obj": "nav_task.NavToObjTask",
}
"""Task -> its class in ``molmo_spaces.tasks``; ``close`` is an OpeningTask of that ``task_type``."""
ROBOTS = {"franka": "franka_droid", "rby1": "rby1", "floating_rum": "floating_rum", "i2rt_yam": "i2rt_yam"}
"""Robot -> its name there."""
PLACING = ("pick_and_place", "pick_and_place_next_to", "pick_and_place_color", "packing")
_NEXT_TO = {"min_surface_to_surface_gap": 0.0, "max_surface_to_surface_gap": 0.05}
_PLACED = {"max_place_receptacle_pos_displacement": 0.15, "max_place_receptacle_rot_displacement": math.radians(60)}
_WEIGHT = {"receptacle_supported_weight_frac": 0.5}
THRESHOLDS: dict[str, dict[str, float]] = {
    "pick": {"succ_pos_threshold": 0.01},
    **{task: {**_PLACED, **_WEIGHT} for task in PLACING},
    "pick_and_place_next_to": {**_PLACED, **_WEIGHT, **_NEXT_TO},
    "open": {"task_success_threshold": 0.2, "any_inst_of_category": 0.0},
    "close": {"task_success_threshold": 0.2},
    "door_opening": {"door_openness_threshold": 0.67},
    "nav_to_obj": {"succ_pos_threshold": 1.5},
}
"""Task -> its thresholds with the defaults of MolmoSpaces' schema."""
FIXED = {"receptacle_supported_weight_frac": 0.5, "min_surface_to_surface_gap": 0.0}
"""Thresholds that mjsense cannot change, and the values that they have."""


@dataclass(frozen=True)
class MolmoSpacesEpisode:
    """One episode, checked."""

    dataset: str
    split: str
    house: int
    seed: int
    task: str
    robot: str
    size: tuple[int, int]
    """Width and height of the images. [pixels]"""
    cameras: dict[str, dict[str, Any]]
    """As ``obs_scene`` has them."""
    start: dict[str, Any]
    """As ``RolloutCfg::starts`` has it, without the cameras."""
    own: dict[str, Any]
    """What :func:`mjsense.evaluation.export_molmospaces` adds: the number of the episode, the horizon and the periods."""
    options: dict[str, Any]
    """Options of the images, and ``arm_controller``, which it adds too."""

    @property
    def where(self) -> str:
        return f"{self.dataset} ({self.split})"


def episodes_of(folder: Path) -> Iterator[tuple[str, Any]]:
    """(place, value) of each episode, not checked."""
    path = folder / FILE
    if path.is_file():
        table = bounded_json.parse(read_plain(path, FILE_BYTES), str(path), FILE_BYTES, MAX_VALUES)
        if not isinstance(table, list) or not 1 <= len(table) <= MAX_EPISODES:
            raise ValueError(f"{path} is {bounded_json.kind_of(table)}; expected a list of 1 to {MAX_EPISODES} episodes")
        yield from ((f"{path}: episode {number}", one) for number, one in enumerate(table))
        return
    for number, file in enumerate(files_of(folder)):
        if number >= MAX_EPISODES:
            raise ValueError(f"{folder} has more than {MAX_EPISODES} episodes")
        yield str(file), bounded_json.parse(read_plain(file, EPISODE_BYTES), str(file), EPISODE_BYTES)


def files_of(folder: Path) -> list[Path]:
    """``house_*/episode_*.json``, in MolmoSpaces' order."""
    houses = sorted(house for house in folder.glob("house_*") if house.is_dir() and not house.is_symlink())
    return [file for house in houses for file in sorted(house.glob("episode_*.json"))]


def read_episode(value: Any, place: str) -> MolmoSpacesEpisode:
    """Checks an episode. Raises ValueError that names the member, what was found, and what was expected."""
    spec = _Reader(value, place)
    task = spec.object("task")
    name = _task_of(task)
    robot = spec.object("robot")
    cameras = [_camera(camera) for camera in spec.objects("cameras", _MAX_CAMERAS)]
    names = [camera["name"] for camera in cameras]
    if len(set(names)) != len(names):
        raise ValueError(f"{place}: two cameras have the same name")
    size = spec.numbers("img_resolution", 2)
    if not all(number == int(number) and 1 <= number <= _MAX_PIXELS for number in size):
        raise ValueError(f"{place}: img_resolution is {size}; expected whole numbers between 1 and {_MAX_PIXELS}")
    groups = {group: at for group, at in _arrays(robot.object("init_qpos")).items() if at and group != "base"}
    own = spec.object("mjsense", optional=True)
    start = _start(name, task, spec.object("scene_modifications", optional=True))
    start |= {"robot": groups, "instruction": spec.object("language").text("task_description", _TEXT)}
    if "joints" in own.table:
        start["joints"] = {**_numbers(own.object("joints")), **start.get("joints", {})}
    return MolmoSpacesEpisode(
        dataset=spec.text("scene_dataset", _NAME),
        split=spec.text("data_split", _NAME, "val"),
        house=spec.whole("house_index"),
        seed=spec.whole("seed", 0, 1 << 64) if spec.table.get("seed") is not None else 0,
        task=name,
        robot=_robot_of(robot, groups, name),
        size=(int(size[0]), int(size[1])),
        cameras={camera.pop("name"): camera for camera in cameras},
        start=start,
        own={key: own.whole(key) for key in ("episode", "horizon", "policy_dt_ms") if key in own.table}
        | {key: own.number(key, 0) for key in ("max_penetration",) if key in own.table},
        options=_options(own, name),
    )


def _options(own: _Reader, task: str) -> dict[str, Any]:
    options = own.object("options", optional=True).table
    for name in options:
        if name not in ("arm_controller", *IMAGE_OPTIONS):
            raise ValueError(f"{own.place}: it has the option '{printable(name[:_NAME])}'{did_you_mean(name, IMAGE_OPTIONS)}")
    checked = checked_recipe({**options, "task": task}, Path(own.place))
    return {name: checked[name] for name in options}


def _task_of(task: _Reader) -> str:
    words = task.text("task_cls", _NAME).rpartition(".")[2]
    found = next((name for name, path in TASKS.items() if path.rpartition(".")[2] == words), None)
    if found is None:
        known = ", ".join(sorted({path.rpartition(".")[2] for path in TASKS.values()}))
        raise ValueError(f"{task.place}: task_cls is '{printable(words)}'; mjsense plays {known}")
    if found == "open" and task.table.get("task_type") is not None:
        found = task.text("task_type", _NAME)
        if found not in ("open", "close"):
            raise ValueError(f"{task.place}: task_type is '{printable(found)}'; expected open or close")
    return found


def _robot_of(robot: _Reader, groups: dict[str, Any], task: str) -> str:
    """The name here. It cannot be a file: a robot may be given by the path of one."""
    name = robot.text("robot_name", _NAME)
    checked_recipe({"robot": name, "task": task}, Path(robot.place))
    if name == "i2rt_yam" and any(group.startswith("left") for group in groups):
        return "bimanual_yam"
    return next((mine for mine, theirs in ROBOTS.items() if theirs == name), {"rby1m": "rby1"}.get(name, name))


def _start(name: str, task: _Reader, changes: _Reader) -> dict[str, Any]:
    poses = _arrays(changes.object("object_poses", optional=True), 7)
    changes.names("added_objects")
    removed = changes.table.get("removed_objects", [])
    if not isinstance(removed, list) or len(removed) > _MAX_OBJECTS:
        raise ValueError(f"{changes.place}: removed_objects is {bounded_json.kind_of(removed)}; expected a list of names")
    roles = {"pickup_obj": "pickup_obj_name"}
    if name in PLACING:
        roles["place_receptacle"] = "place_receptacle_name"
    elif name == "door_opening":
        roles = {"door_handle": "door_body_name"}
    objects = {role: task.text(key, _NAME) for role, key in roles.items()}
    if name not in ("open", "close"):  # what opens stands where the scene has it
        for role, key in (("pickup_obj", "pickup_obj_start_pose"), ("place_receptacle", "place_receptacle_start_pose")):
            if role in objects and task.table.get(key) is not None:
                poses.setdefault(objects[role], task.numbers(key, 7))
    if task.table.get("other_receptacle_start_poses") is not None:
        for other, pose in _arrays(task.object("other_receptacle_start_poses"), 7).items():
            poses.setdefault(other, pose)
    if task.table.get("object_colors") is not None:
        raise ValueError(f"{task.place}: it has object_colors; mjsense plays objects with the colours of the scene only")
    start: dict[str, Any] = {
        "bodies": poses,
        "absent": [_checked_name(one, changes.place) for one in removed],
        "objects": objects,
        "base": task.numbers("robot_base_pose", 7),
        "thresholds": _thresholds(name, task),
    }
    if name in ("open", "close"):
        at = task.table.get("joint_start_position")
        position = at[0] if isinstance(at, list) and len(at) == 1 else at
        start["joints"] = {task.text("joint_name", _NAME): _finite(position, f"{task.place}: joint_start_position")}
    return start


def _thresholds(name: str, task: _Reader) -> dict[str, float]:
    found = {}
    for key, default in THRESHOLDS[name].items():
        given = task.table.get(key)
        value = default if given is None else float(given) if isinstance(given, bool) else _finite(given, f"{task.place}: {key}")
        fixed = 1.5 if name == "nav_to_obj" else FIXED.get(key)
        if fixed is None:
            found[key] = value
        elif value != fixed:
            raise ValueError(f"{task.place}: {key} is {value:g}; mjsense plays {name} with {fixed:g} only")
    return found


def _camera(camera: _Reader) -> dict[str, Any]:
    name = camera.text("name", _NAME)
    lens = {"fovy": camera.number("fov", 0.1, 179.9), "depth": camera.flag("record_depth")}
    if not re.fullmatch(r"[A-Za-z0-9_-]{1,100}", name):
        raise ValueError(f"{camera.place}: name is '{printable(name)}'; expected letters, digits, - and _")
    kind = camera.text("type", _NAME, "exocentric" if "forward" in camera.table else "robot_mounted")
    if kind == "exocentric":
        views = {key: camera.numbers(key, 3) for key in ("pos", "forward", "up")}
        return {"name": name, **views, **lens}
    if kind != "robot_mounted":
        raise ValueError(f"{camera.place}: type is '{printable(kind)}'; expected robot_mounted or exocentric")
    bodies = camera.table.get("reference_body_names")
    if not isinstance(bodies, list) or not 1 <= len(bodies) <= _MAX_CAMERAS:
        raise ValueError(f"{camera.place}: reference_body_names is {bounded_json.kind_of(bodies)}; expected a list of names")
    quat = camera.numbers("camera_quaternion", 4)
    if not any(quat):
        raise ValueError(f"{camera.place}: camera_quaternion is 0")
    return {
        "name": name,
        "body": _checked_name(bodies[0], camera.place),
        "pos": camera.numbers("camera_offset", 3),
        "quat": quat,
        **lens,
    }


def _arrays(table: _Reader, count: int | None = None) -> dict[str, list[float]]:
    if len(table.table) > _MAX_OBJECTS:
        raise ValueError(f"{table.place} has more than {_MAX_OBJECTS} members")
    return {_checked_name(key, table.place): table.numbers(key, count) for key in table.table}


def _numbers(table: _Reader) -> dict[str, float]:
    return {_checked_name(key, table.place): table.number(key, -_FAR) for key in list(table.table)[:_MAX_OBJECTS]}


def _checked_name(name: Any, place: str) -> str:
    if not isinstance(name, str) or not 0 < len(name) <= _NAME or not name.isprintable():
        raise ValueError(f"{place}: {bounded_json.kind_of(name)} cannot be a name, which has 1 to {_NAME} printable characters")
    return name


def _finite(value: Any, place: str, low: float = -_FAR, high: float = _FAR) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not low <= value <= high:
        shown = f"{value!r:.40}" if isinstance(value, (int, float)) else bounded_json.kind_of(value)
        raise ValueError(f"{place} is {shown}; expected a number between {low:g} and {high:g}")
    return float(value)


class _Reader:
    """Members of a JSON object, with their checks."""

    def __init__(self, table: Any, place: str) -> None:
        if not isinstance(table, dict):
            raise ValueError(f"{place} is {bounded_json.kind_of(table)}; expected an object")
        self.table: dict[str, Any] = table
        self.place = place

    def object(self, key: str, optional: bool = False) -> _Reader:
        value = self.table.get(key)
        return _Reader({} if value is None and optional else value, f"{self.place}: {key}")

    def objects(self, key: str, most: int) -> list[_Reader]:
        value = self.table.get(key, [])
        if not isinstance(value, list) or len(value) > most:
            raise ValueError(f"{self.place}: {key} is {bounded_json.kind_of(value)}; expected a list of at most {most} objects")
        return [_Reader(one, f"{self.place}: {key}[{i}]") for i, one in enumerate(value)]

    def text(self, key: str, most: int, default: str | None = None) -> str:
        value = self.table.get(key, default)
        if not isinstance(value, str) or not 0 < len(value) <= most or not value.isprintable():
            found = "too long, empty or not printable" if isinstance(value, str) else bounded_json.kind_of(value)
            raise ValueError(f"{self.place}: {key} is {found}; expected a text of 1 to {most} printable characters")
        return value

    def names(self, key: str) -> None:
        for name, path in self.object(key, optional=True).table.items():
            _checked_name(name, f"{self.place}: {key}")
            _checked_name(path, f"{self.place}: {key}")

    def number(self, key: str, low: float, high: float = _FAR) -> float:
        return _finite(self.table.get(key), f"{self.place}: {key}", low, high)

    def whole(self, key: str, low: int = 0, high: int = 1 << 31) -> int:
        value = self.table.get(key)
        if isinstance(value, bool) or not isinstance(value, int) or not low <= value < high:
            raise ValueError(f"{self.place}: {key} is {bounded_json.kind_of(value)}; expected a whole number from {low} on")
        return value

    def numbers(self, key: str, count: int | None = None) -> list[float]:
        value = self.table.get(key)
        if not isinstance(value, list) or (len(value) != count if count is not None else len(value) > _MAX_JOINTS):
            wanted = counted(count, "number") if count is not None else f"at most {_MAX_JOINTS} numbers"
            raise ValueError(f"{self.place}: {printable(key[:_NAME])} is {bounded_json.kind_of(value)}; expected {wanted}")
        return [_finite(one, f"{self.place}: {printable(key[:_NAME])}") for one in value]

    def flag(self, key: str) -> bool:
        value = self.table.get(key, False)
        if not isinstance(value, bool):
            raise ValueError(f"{self.place}: {key} is {bounded_json.kind_of(value)}; expected true or false")
        return value

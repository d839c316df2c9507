# SPDX-License-Identifier: Apache-2.0
"""Frozen benchmarks: a folder that fixes the episodes of an evaluation, so that it can be repeated elsewhere and later.

``benchmark.json`` states the options of the recording, the numbers of the episodes, and the checksums of all files. ``starts/``
is a recording of the first observations of these episodes: their states, models, instructions and images. The episodes are
sampled again when the benchmark is played, and refused unless they are equal to the stored ones, bit for bit. A folder is only
data: it names things that mjsense contains, neither files nor code. The benchmarks of the package, such as ``benchmark:pick``,
are one file each, with checksums of the starts instead of their recording.
"""

from __future__ import annotations

import hashlib
import inspect
import json
import os
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from mjsense import _core
from mjsense.core.errors import UnknownNameError, did_you_mean
from mjsense.dataset import Dataset, Episode, bounded_json
from mjsense.dataset.places import is_plain_name, open_plain, read_plain
from mjsense.tasks.making import make_vec
from mjsense.tasks.recording import record
from mjsense.tasks.vector import TaskVectorEnv

FILE, STARTS = "benchmark.json", "starts"
PREFIX, _SHIPPED = "benchmark:", Path(__file__).parent / "shipped"
_FORMAT = 1
_FILE_BYTES = 1 << 24
_MAX_EPISODES, _MAX_FILES, _MAX_DEPTH = 100_000, 1_000_000, 4
_PARTS = ("task", "robot", "scene", "split", "arm_controller", "camera_system")
_IMAGES = ("cameras", "width", "height", "depth", "segmentation", "shadows", "samples", "shadow_samples", "meshes")
_COLOURS = (
    "shading",
    "exposure",
    "tone_mapping",
    "white_balance",
    "environment",
    "environment_intensity",
    "environment_rotation",
    "ambient_occlusion",
)
_PLAY = ("seed", "horizon", "policy_dt_ms", "perturb", "instructions", "terminate_upon_success", "max_penetration")
IMAGE_OPTIONS = tuple(name for name in (*_IMAGES, *_COLOURS) if name not in ("cameras", "width", "height", "depth"))
"""Options of the images, without their number and size."""
RECIPE = (*_PARTS, *_IMAGES, *_COLOURS, *_PLAY)
"""Options of a recording that a benchmark fixes."""
_NAME = re.compile(r"([A-Za-z0-9_+-]{1,100}(@[a-z]{1,20})?(:[0-9]{1,9})?)?")
_CAMERA = re.compile(r"[A-Za-z0-9_-]{1,100}(/[A-Za-z0-9_-]{1,100}){0,9}")


def benchmark_names() -> list[str]:
    """The benchmarks of the package: ``benchmark:pick``, ..."""
    return sorted(PREFIX + path.stem for path in _SHIPPED.glob("*.json"))


def is_benchmark(task: Any) -> bool:
    """Whether this is a folder or one of :func:`benchmark_names`, and not the name of a task."""
    if isinstance(task, str) and not task.startswith(PREFIX):
        return os.sep in task or os.path.isdir(task)
    return isinstance(task, (str, Path))


class Benchmark:
    """A benchmark that was read from its folder, or one of the package by its name: ``benchmark:pick``."""

    def __init__(self, folder: str | Path) -> None:
        self.folder, path = Path(folder), Path(folder) / FILE
        if isinstance(folder, str) and folder.startswith(PREFIX):
            if folder not in benchmark_names():
                raise UnknownNameError(f"there is no '{folder}'{did_you_mean(folder, benchmark_names(), 'there are')}")
            path = _SHIPPED / f"{folder.removeprefix(PREFIX)}.json"
        elif not path.is_file():
            raise FileNotFoundError(f"benchmark: '{self.folder}' has no {FILE}")
        text = path.read_bytes() if path.parent == _SHIPPED else read_plain(path, _FILE_BYTES)
        table = bounded_json.parse_object(text, str(path), _FILE_BYTES)
        if table.get("format") != _FORMAT:
            raise ValueError(f"{path}: format is {table.get('format')!r}; this version of mjsense reads {_FORMAT}")
        self.checksum = _checksum(table)
        """SHA-256 of everything that the benchmark fixes."""
        if table.get("checksum") != self.checksum:
            raise ValueError(f"{path}: the contents do not have the checksum that is stated: the file was changed")
        self.recipe: dict[str, Any] = checked_recipe(table.get("recipe"), path)
        """Options of the recording."""
        self.episodes: list[int] = _numbers(table.get("episodes"), path)
        self.version = str(table.get("version", ""))
        """Version of mjsense that made it."""
        self.name = str(self.recipe["task"])
        self._digests: dict[str, Any] | None = table.get("digests")
        self._files: dict[str, str] = {} if self._digests is not None else _files_of(table.get("files"), path)
        if self._digests is not None and self._digests.keys() != set(map(str, self.episodes)):
            raise ValueError(f"{path}: digests must be those of the episodes")

    def options(self, given: Mapping[str, Any]) -> dict[str, Any]:
        """The options of a recording of this benchmark. Raises ValueError for given ones that it fixes."""
        options = {name: value for name, value in given.items() if name != "task"}
        for name, default in {**DEFAULTS, "house": 0}.items():
            if name in options and options.pop(name) not in (default, self.recipe.get(name, default)):
                raise ValueError(f"benchmark '{self.folder}': it fixes {name}, which is given too; leave it out")
        return {**options, **self.recipe}

    def check_files(self) -> None:
        """Raises ValueError if a file of the benchmark is missing, was changed or was added."""
        if self._digests is not None:
            return
        found = dict(_checksums(self.folder / STARTS))
        for name in sorted(found.keys() ^ self._files.keys()):
            raise ValueError(
                f"benchmark '{self.folder}': {STARTS}/{name} {'is missing' if name in self._files else 'does not belong to it'}"
            )
        for name, checksum in found.items():
            if checksum != self._files[name]:
                raise ValueError(f"benchmark '{self.folder}': {STARTS}/{name} was changed: its checksum is not the stated one")

    def check_starts(self, num_worlds: int = 4) -> None:
        """Samples the starts of all episodes, and raises ValueError unless they are equal to the stored ones bit for bit."""
        self.check_files()
        stored: Mapping[int, Any] = {}
        if self._digests is not None:
            stored = {int(number): digests for number, digests in self._digests.items()}
        else:
            stored = {episode.number: episode for episode in Dataset(self.folder / STARTS).episodes}
        if missing := set(self.episodes) - stored.keys():
            raise ValueError(f"benchmark '{self.folder}': it has no start of episode {min(missing)}")
        compare = _difference if self._digests is None else _difference_of_digests
        env = make_vec(**_env_options(self.recipe, min(num_worlds, len(self.episodes))))
        try:
            for world, number in started(env, self.episodes):
                if difference := compare(env, world, stored[number]):
                    raise ValueError(
                        f"benchmark '{self.folder}': episode {number} does not start as when the benchmark was "
                        f"made: {difference}. It was "
                        f"made by mjsense {self.version}, and this is {_core.__version__}."  # pyright: ignore[reportAttributeAccessIssue]
                    )
        finally:
            env.close()


DEFAULTS: dict[str, Any] = {
    name: parameter.default for name, parameter in inspect.signature(record).parameters.items() if name in RECIPE
} | {"terminate_upon_success": True}  # as evaluate()
"""Options that a caller did not choose."""


def create_benchmark(
    task: str = "pick",
    *,
    out: str | Path,
    episodes: int = 50,
    progress: bool | Any = None,
    **options: Any,
) -> Benchmark:
    """Writes a benchmark: a folder that fixes the episodes of an evaluation.

    Args:
        task: A registered name (:func:`task_names`).
        out: Folder, which must not exist.
        episodes: Number of episodes. Attempts whose start cannot be played are left out.
        progress: As in :func:`mjsense.record`.
        options: Options of :func:`mjsense.evaluate` that affect the data, such as ``robot``, ``scene``, ``split``, ``seed``,
            ``cameras`` and ``horizon``.
    """
    folder = Path(out)
    if folder.exists():
        raise FileExistsError(f"benchmark: '{folder}' exists")
    for name in options:
        if name not in RECIPE:
            raise ValueError(f"benchmark: it cannot fix '{name}'{did_you_mean(name, RECIPE, 'it can fix')}")
    if not 1 <= episodes <= _MAX_EPISODES:
        raise ValueError(f"benchmark: episodes is {episodes}: must be between 1 and {_MAX_EPISODES}")
    recipe = checked_recipe({**DEFAULTS, **options, "task": task}, folder)
    parts = {name: recipe[name] for name in ("task", "robot", "scene", "split") if recipe[name] is not None}
    _, robot, scene, _, _ = _core.resolved_job({**parts, "out": "."})
    recipe |= {"robot": robot or None, "scene": scene, "split": ""}
    env = make_vec(**_env_options(recipe))
    recipe["horizon"] = env.horizon
    env.close()
    part = folder.with_name(f".{folder.name}.part")
    record(
        **{**recipe, "horizon": 1},
        policy=_still,
        out=part / STARTS,
        overwrite=True,
        episodes=episodes,
        max_attempts=6 * episodes,
        keep_failures=True,
        action_noise=False,
        progress=progress,
    )
    stored = Dataset(part / STARTS).episodes
    settings = stored[0].settings
    recipe |= {
        "cameras": [camera["name"] for camera in settings["cameras"]],
        "max_penetration": settings["max_penetration"],
        "policy_dt_ms": settings["policy_dt_ms"],
        "meshes": "real" if settings["meshes"] == "real" else "shapes",
    }
    table = {
        "format": _FORMAT,
        "version": _core.__version__,  # pyright: ignore[reportAttributeAccessIssue]  # stubs leave it out
        "recipe": checked_recipe(recipe, folder),
        "episodes": sorted(episode.number for episode in stored),
        "files": dict(_checksums(part / STARTS)),
    }
    (part / FILE).write_text(json.dumps({**table, "checksum": _checksum(table)}, indent=1) + "\n", encoding="utf-8")
    os.rename(part, folder)
    return Benchmark(folder)


def _still(obs: dict[str, Any]) -> dict[str, Any]:
    """Ends an episode after its first step."""
    return {"done": np.ones(len(next(iter(_leaves(obs)))), bool)}


def _leaves(obs: Mapping[str, Any]) -> Iterator[Any]:
    for value in obs.values():
        yield from _leaves(value) if isinstance(value, Mapping) else (value,)


def _env_options(recipe: dict[str, Any], num_envs: int = 1) -> dict[str, Any]:
    small = {"width": 16, "height": 16, "samples": 1, "shadow_samples": 1, "depth": False, "segmentation": False}
    options = {name: value for name, value in recipe.items() if name != "terminate_upon_success"}
    return {**options, **small, "num_envs": num_envs}


def digests_of(benchmark: Benchmark, num_worlds: int = 4) -> dict[str, Any]:
    """Contents of ``benchmark.json`` with checksums of the starts instead of their recording."""
    env = make_vec(**_env_options(benchmark.recipe, num_worlds))
    try:
        digests = {str(number): _digests(env, world) for world, number in started(env, benchmark.episodes)}
    finally:
        env.close()
    table = {
        "format": _FORMAT,
        "version": benchmark.version,
        "recipe": benchmark.recipe,
        "episodes": benchmark.episodes,
        "digests": digests,
    }
    return {**table, "checksum": _checksum(table)}


def _digests(env: TaskVectorEnv, world: int) -> dict[str, str]:
    """Checksums of what an episode starts with: what the task says of it, the state, and the model."""
    contents = {
        "episode": [json.dumps(json.loads(env._rollout.obs_scene(world)), sort_keys=True).encode()],
        "state": [env.sim.state[world].tobytes()],
        "model": [part for name, value in arrays_of(env.sim.model_of(world)) for part in (name.encode(), value.tobytes())],
    }
    return {name: hashlib.sha256(b"".join(parts)).hexdigest()[:16] for name, parts in contents.items()}


def _difference_of_digests(env: TaskVectorEnv, world: int, stored: Any) -> str:
    """The first part whose checksum is not the stored one; empty: none."""
    now = _digests(env, world)
    return next(
        (f"the checksum of its {name} differs" for name in now if not isinstance(stored, dict) or stored.get(name) != now[name]),
        "",
    )


def started(env: TaskVectorEnv, numbers: list[int]) -> Iterator[tuple[int, int]]:
    """(world, number) of each episode while it is at its start."""
    for first in range(0, len(numbers), env.num_envs):
        some = numbers[first : first + env.num_envs]
        env._rollout.start(list(range(len(some))), some)
        yield from enumerate(some)


def _difference(env: TaskVectorEnv, world: int, stored: Episode) -> str:
    """What is not as stored, with its values; empty: nothing."""
    scene, now = stored.obs_scene, json.loads(env._rollout.obs_scene(world))
    for name in sorted(scene.keys() | now.keys()):
        if scene.get(name) != now.get(name):
            return f"'{name}' was {json.dumps(scene.get(name))[:200]} and is {json.dumps(now.get(name))[:200]}"
    state, before = env.sim.state[world], stored.states[0]
    if state.shape != before.shape:
        return f"the state had {len(before)} numbers and has {len(state)}"
    if len(different := np.flatnonzero(state.view(np.uint64) != before.view(np.uint64))):
        i = different[0]
        return f"{len(different)} of {len(state)} numbers of the state differ, the first by {state[i] - before[i]:.3g}"
    now = dict(arrays_of(env.sim.model_of(world)))
    for name, old in arrays_of(stored.model()):
        if name not in now or old.tobytes() != now[name].tobytes():
            return f"the model's {name} differs"
    return ""


def arrays_of(model: Any) -> Iterator[tuple[str, np.ndarray]]:
    """Names and values of the arrays of an MjModel, by name."""
    for name in sorted(dir(model)):
        if not name.startswith("_") and isinstance(value := getattr(model, name), np.ndarray):
            yield name, value


def checked_recipe(recipe: Any, path: Path) -> dict[str, Any]:
    """The options of a recipe, checked: known options whose texts are names, not files or code."""
    if not isinstance(recipe, dict):
        raise ValueError(f"{path}: the recipe is {bounded_json.kind_of(recipe)}; expected an object")
    for name, value in recipe.items():
        if name not in RECIPE:
            raise ValueError(f"{path}: the recipe has the option '{name}'{did_you_mean(name, RECIPE, 'there are')}")
        texts, pattern = (value, _CAMERA) if isinstance(value, list) else ([value], _NAME)
        for text in texts:
            if isinstance(text, str) and not pattern.fullmatch(text):
                raise ValueError(f"{path}: {name} is '{text[:100]}'; a benchmark can only contain names of what mjsense contains")
            if not isinstance(text, (str, bool, int, float, type(None))) or (
                isinstance(value, list) and not isinstance(text, str)
            ):
                raise ValueError(f"{path}: {name} is {bounded_json.kind_of(text)}; expected a name, a number or true or false")
    if missing := {"task"} - recipe.keys():
        raise ValueError(f"{path}: the recipe has no {min(missing)}")
    return dict(recipe)


def _numbers(numbers: Any, path: Path) -> list[int]:
    if not isinstance(numbers, list) or not 1 <= len(numbers) <= _MAX_EPISODES:
        raise ValueError(f"{path}: episodes must be a list of 1 to {_MAX_EPISODES} numbers")
    for before, number in zip([-1, *numbers], numbers):
        if not isinstance(number, int) or isinstance(number, bool) or not before < number < 2**31:
            raise ValueError(f"{path}: episodes has {number!r} after {before}; expected ascending numbers from 0 on")
    return numbers


def _files_of(files: Any, path: Path) -> dict[str, str]:
    if not isinstance(files, dict) or len(files) > _MAX_FILES:
        raise ValueError(f"{path}: files must be an object with the checksum of each file")
    for name, checksum in files.items():
        if not all(map(is_plain_name, name.split("/"))) or not isinstance(checksum, str):
            raise ValueError(f"{path}: files has '{name[:100]}'; expected names inside the folder, and their checksums")
    return files


def _checksum(table: dict[str, Any]) -> str:
    text = json.dumps({name: value for name, value in table.items() if name != "checksum"}, sort_keys=True)
    return "sha256:" + hashlib.sha256(text.encode()).hexdigest()


def _checksums(folder: Path, depth: int = 0, prefix: str = "") -> Iterator[tuple[str, str]]:
    """(name, SHA-256) of each file of a folder. Raises ValueError for links and other special files."""
    if not folder.is_dir() or folder.is_symlink():
        raise ValueError(f"'{folder}' is not a folder")
    for entry in sorted(os.scandir(folder), key=lambda entry: entry.name):
        if entry.is_dir(follow_symlinks=False) and depth < _MAX_DEPTH:
            yield from _checksums(folder / entry.name, depth + 1, f"{prefix}{entry.name}/")
        elif entry.is_file(follow_symlinks=False):
            with open_plain(folder / entry.name) as file:
                yield f"{prefix}{entry.name}", hashlib.file_digest(file, "sha256").hexdigest()
        else:
            raise ValueError(f"'{entry.path}' is neither a file nor a folder of a benchmark")

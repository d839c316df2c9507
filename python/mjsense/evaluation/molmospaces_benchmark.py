# SPDX-License-Identifier: Apache-2.0
"""A benchmark of MolmoSpaces as recordings of mjsense: episodes with given starts, in groups that share a compiled model."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from mjsense import _core
from mjsense.core.counted import counted
from mjsense.core.errors import printable
from mjsense.dataset.places import open_plain
from mjsense.evaluation.benchmarks import DEFAULTS
from mjsense.evaluation.molmospaces_episodes import FILE, MolmoSpacesEpisode, episodes_of, files_of, read_episode

OWN = "mjsense/"
"""Beginning of ``scene_dataset`` for scenes of mjsense: ``mjsense/varied_table``."""
_SHOWN = 10  # houses in a message
_FIXED: dict[str, Any] = {"split": "", "seed": 0, "camera_system": "", "instructions": "varied", "perturb": 0.0, "house": 0}
"""Options that the episodes fix, with their defaults."""


def is_molmospaces(task: Any) -> bool:
    """Whether this is a folder with a benchmark of MolmoSpaces."""
    folder = Path(task)
    if not folder.is_dir():
        return False
    path = folder / FILE
    if not path.is_file():
        return bool(files_of(folder))
    with open_plain(path) as file:
        return file.read(100).lstrip()[:1] == b"["


class MolmoSpacesBenchmark:
    """A benchmark that was read from its folder."""

    def __init__(self, folder: str | Path, scene: str = "") -> None:
        """
        Args:
            scene: Name or file of the scene to play in, instead of that of the episodes; ``{house}`` is replaced by the house.
        """
        self.folder = Path(folder)
        self.name = self.folder.resolve().name
        values = list(episodes_of(self.folder))
        if not scene:
            _require_scenes(self.folder, [value for _, value in values])
        self.episodes: list[MolmoSpacesEpisode] = [read_episode(value, place) for place, value in values]
        text = json.dumps([value for _, value in values], sort_keys=True)
        self.checksum = "sha256:" + hashlib.sha256(text.encode()).hexdigest()
        """SHA-256 of the episodes."""
        self._scene = scene

    def jobs(self, given: Mapping[str, Any]) -> list[dict[str, Any]]:
        """Options of a recording for each group of episodes, with ``starts`` and ``attempts``.

        Args:
            given: Options of the caller, which replace those of the episodes.
        """
        for name, default in _FIXED.items():
            if given.get(name, default) not in (default, None):
                raise ValueError(f"benchmark '{self.folder}': its episodes fix {name}, which is given too; leave it out")
        kept = {name: value for name, value in given.items() if name not in ("task", "scene", *_FIXED) and value is not None}
        size = {name: given.get(name) for name in ("width", "height")}
        groups: dict[str, tuple[dict[str, Any], dict[int, Any]]] = {}
        for index, episode in enumerate(self.episodes):
            options = self._options(episode)
            bodies = {name: camera.get("body") for name, camera in episode.cameras.items()}
            options, starts = groups.setdefault(json.dumps([options, bodies], sort_keys=True), (options, {}))
            number = episode.own.get("episode", index)
            if number in starts:
                raise ValueError(f"benchmark '{self.folder}': two episodes have the number {number}")
            starts[number] = episode.start | ({"cameras": episode.cameras} if episode.cameras else {})
        jobs = []
        for options, starts in groups.values():
            chosen = {name: value for name, value in kept.items() if not (name in options and value == DEFAULTS.get(name))}
            made = options | chosen | (size if any(size.values()) else {})
            if not next(iter(starts.values())).get("cameras"):
                made["cameras"] = []
            text = json.dumps({str(number): starts[number] for number in sorted(starts)})
            jobs.append({**made, "house": len(jobs), "starts": text, "attempts": sorted(starts)})
        return jobs

    def _options(self, episode: MolmoSpacesEpisode) -> dict[str, Any]:
        scene = self._scene.replace("{house}", str(episode.house))
        if not scene:
            part = f"@{episode.split}" if episode.split in ("train", "test") else ""
            scene = episode.dataset.removeprefix(OWN) + part + (f":{episode.house}" if episode.house else "")
        more = {name: value for name, value in episode.own.items() if name != "episode"}
        return {
            "task": episode.task,
            "robot": episode.robot,
            "scene": scene,
            "seed": episode.seed,
            "width": episode.size[0],
            "height": episode.size[1],
            **more,
            **episode.options,
        }


def _require_scenes(folder: Path, episodes: list[Any]) -> None:
    """Raises one ValueError with all scenes that mjsense does not have."""
    known = {scene["name"] for scene in json.loads(_core.scenes_json())}  # pyright: ignore[reportAttributeAccessIssue]
    others = [
        episode
        for episode in episodes
        if not (isinstance(episode, dict) and str(episode.get("scene_dataset")).removeprefix(OWN) in known)
        or not str(episode.get("scene_dataset")).startswith(OWN)
    ]
    if others:
        raise ValueError(
            f"{folder} is a benchmark of MolmoSpaces, {houses_of(others)}. mjsense does not contain these scenes. If you have "
            "them as MJCF files, --scene 'houses/val_{house}.xml' plays the episodes in them"
        )


def houses_of(episodes: list[Any]) -> str:
    """The scenes of MolmoSpaces' episodes: ``3 episodes in the houses 1, 5 of procthor-10k (val)``."""
    houses: dict[str, set[int]] = {}
    for episode in episodes:
        about = episode if isinstance(episode, dict) else {}
        name, split, house = about.get("scene_dataset"), about.get("data_split", "val"), about.get("house_index")
        if isinstance(name, str) and isinstance(split, str) and type(house) is int:
            houses.setdefault(printable(f"{name:.60} ({split:.20})"), set()).add(house)
    texts = [f"{_first(map(str, sorted(numbers)), ', ')} of {name}" for name, numbers in sorted(houses.items())]
    return f"{counted(len(episodes), 'episode')} in the houses {_first(texts, '; ') or 'that it does not state'}"


def _first(texts: Iterable[str], comma: str) -> str:
    listed = list(texts)
    return comma.join([*listed[:_SHOWN], *["..."] * (len(listed) > _SHOWN)])


def dataset_of(scene: str) -> tuple[str, str, int]:
    """(scene_dataset, data_split, house_index) of a scene of mjsense: ``kitchen@train:3``."""
    found = re.fullmatch(r"([^@:]+)(?:@(\w+))?(?::(\d+))?", scene)
    if found is None:
        raise ValueError(f"benchmark: the scene '{scene}' is not one of mjsense")
    return OWN + found[1], found[2] or "val", int(found[3] or 0)

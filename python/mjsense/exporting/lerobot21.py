# SPDX-License-Identifier: Apache-2.0
"""LeRobot v2.1: one Parquet file and one MP4 file per episode, with GR00T's ``meta/modality.json``."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from mjsense.exporting.frame_statistics import image_histograms
from mjsense.exporting.images import video_file
from mjsense.exporting.lerobot_files import (
    FILES_PER_CHUNK,
    Statistics,
    check_columns,
    codec_of,
    columns_of,
    exported,
    features_of,
    image_key,
    in_folder,
    is_depth,
    key_of,
    number,
    print_rate,
    table_of,
    write_json,
)
from mjsense.exporting.mapping import Source, check_names
from mjsense.exporting.output import needs
from mjsense.exporting.remux import Concatenation

_DATA = "data/chunk-{episode_chunk:03d}/episode_{episode_index:06d}.parquet"
_VIDEO = "videos/chunk-{episode_chunk:03d}/{video_key}/episode_{episode_index:06d}.mp4"
_INSTRUCTION = "human.task_description"
"""GR00T's name of the instruction. It reads the number of the task from a column of its own."""


def write(source: Source, path: Path, progress: Callable[[int, int], None] | None = None) -> None:
    """Writes all episodes to the new folder ``path``."""
    print_rate(source)
    if depth := [camera for camera in source.cameras if is_depth(source, camera)]:
        raise ValueError(f"LeRobot v2.1 has no depth images; leave '{depth[0]}' out of the map, or export to LeRobot v3.0")
    check_columns(source, [f"annotation.{_INSTRUCTION}"])
    modality = modality_of(source)
    entries: list[dict[str, Any]] = []
    found: list[dict[str, Any]] = []
    codec: dict[str, Any] = {}
    statistics = Statistics()
    first = 0
    for position, episode in enumerate(source.each(progress)):
        place = {"episode_chunk": position // FILES_PER_CHUNK, "episode_index": position}
        columns = columns_of(source, episode, position, first, source.tasks.index(episode.task))
        columns[f"annotation.{_INSTRUCTION}"] = columns["task_index"]
        needs("pyarrow.parquet").write_table(table_of(columns), in_folder(path / _DATA.format(**place)))
        histograms = {}
        for camera in source.cameras:
            video = source.video(episode, camera)
            with video_file(video, path) as (file, frames):
                codec = codec or codec_of(file)
                copy = Concatenation(path / _VIDEO.format(video_key=image_key(camera), **place), source.fps)
                copy.add(file, video.fps, frames, episode.length - 1)
                copy.close()
            histograms[image_key(camera)] = image_histograms(episode, source.cameras[camera])
        entries.append(
            {
                "episode_index": position,
                "tasks": [episode.task],
                "length": episode.length - 1,
                "trimmed_steps": episode.trimmed_steps,
                "recorded_fps": float(source.recorded_fps),
            }
        )
        found.append({"episode_index": position, "stats": statistics.add(columns, histograms)})
        first += episode.length - 1
    _write_lines(path / "meta/episodes.jsonl", entries)
    _write_lines(path / "meta/episodes_stats.jsonl", found)
    _write_lines(path / "meta/tasks.jsonl", [{"task_index": i, "task": task} for i, task in enumerate(source.tasks)])
    # GR00T's loader takes the numbers of a move group out of every statistic, so each must have as many as the column.
    write_json(
        path / "meta/stats.json",
        {name: {key: value for key, value in found.items() if key != "count"} for name, found in statistics.all().items()},
    )
    write_json(path / "meta/modality.json", modality)
    count = len(source)
    info = {
        "codebase_version": "v2.1",
        "robot_type": source.robot or None,
        "total_episodes": count,
        "total_frames": first,
        "total_tasks": len(source.tasks),
        "total_videos": count * len(source.cameras),
        "total_chunks": -(-count // FILES_PER_CHUNK),
        "chunks_size": FILES_PER_CHUNK,
        "fps": number(source.fps),
        "splits": {"train": f"0:{count}"},
        "data_path": _DATA,
        "video_path": _VIDEO if source.cameras else None,
        "features": features_of(source, codec) | {f"annotation.{_INSTRUCTION}": {"dtype": "int64", "shape": [1], "names": None}},
    }
    write_json(path / "meta/info.json", info)


def modality_of(source: Source) -> dict[str, Any]:
    """The parts of state and action by move group, the cameras, and the instruction, as GR00T's loader expects them. Other
    features have their own names; one with several streams is followed by the name of the stream: ``velocity_arm``."""
    result: dict[str, Any] = {"state": {}, "action": {}}
    names: list[tuple[str, str]] = []
    for feature in exported(source):
        if feature.name in ("reward", "success"):
            continue
        kind = "action" if feature.of_step else "state"
        own = feature.name.removeprefix("observation.").removeprefix("next.").replace(".", "_")
        for part, place in feature.parts.items():
            name = part if feature.name in ("state", "action") else own if len(feature.parts) == 1 else f"{own}_{part}"
            names.append((f"{kind}.{name}", f"the feature '{feature.name}'"))
            result[kind][name] = {"start": place.start, "end": place.stop, "original_key": key_of(feature)}
    check_names(names)
    result["video"] = {camera: {"original_key": image_key(camera)} for camera in source.cameras}
    result["annotation"] = {_INSTRUCTION: {}}
    return result


def _write_lines(path: Path, entries: list[dict[str, Any]]) -> None:
    in_folder(path).write_text("".join(json.dumps(entry, ensure_ascii=False) + "\n" for entry in entries))

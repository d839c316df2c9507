# SPDX-License-Identifier: Apache-2.0
"""Reimplementation of MolmoSpaces' scripts that read recordings, from their documented behaviour.

Their order: repair_video_paths -> validate_trajectories -> calculate_stats, then training loaders.
"""

import json
import subprocess
from pathlib import Path

import h5py
import numpy as np


def rows(dataset):
    """The rows of a dict sensor, decoded from JSON."""
    return [json.loads(row.tobytes().decode("utf-8").rstrip("\x00")) for row in dataset[:]]


def file_name(dataset):
    return dataset[:].tobytes().decode("utf-8").rstrip("\x00")


def decode(path, pixel_format, shape):
    """All frames of a video: uint8 [T, H, W, 3] or uint16 [T, H, W]."""
    raw = subprocess.run(
        ["ffmpeg", "-v", "error", "-i", path, "-f", "rawvideo", "-pix_fmt", pixel_format, "-"], capture_output=True, check=True
    ).stdout
    return np.frombuffer(raw, np.uint16 if pixel_format == "gray16le" else np.uint8).reshape(-1, *shape)


def probe(path):
    keys = "codec_name,pix_fmt,width,height,r_frame_rate,nb_read_frames"
    command = ["ffprobe", "-v", "error", "-count_frames", "-select_streams", "v:0", "-show_entries", f"stream={keys}"]
    return json.loads(subprocess.run([*command, "-of", "json", path], capture_output=True, check=True).stdout)["streams"][0]


def validate(path: Path, visible=(), min_steps=3):
    """validate_trajectories: a list of errors for each trajectory, empty if it is valid."""
    result = []
    with h5py.File(path) as f:
        numbers = sorted(int(k.split("_")[-1]) for k in f if k.startswith("traj_"))
        assert numbers == list(range(len(numbers))), "trajectories are not consecutive"
        for n in numbers:
            result.append(list(complaints(path, f[f"traj_{n}"], visible, min_steps)))
    return result


def complaints(path, traj, visible, min_steps):
    lengths = {name: len(rows(d)) for name, d in traj["actions"].items()}
    if not lengths:
        yield "no actions"
    if len(set(lengths.values())) > 1 or min(lengths.values()) < min_steps:
        yield f"lengths of actions {lengths}"
    agent = traj["obs/agent"]
    for name in ("qpos", "qvel"):
        if name not in agent:
            yield f"no {name}"
        elif len(rows(agent[name])) not in lengths.values():
            yield f"length of {name}"
    for camera, role in visible:
        if traj[f"obs/extra/object_image_points/{role}/{camera}/num_points"][0, 0] <= 0:
            yield f"{role} is not seen by {camera}"
    if len(traj["obs/sensor_data"]) == 0:
        yield "no cameras"
    for camera, dataset in traj["obs/sensor_data"].items():
        video = path.parent / file_name(dataset)
        if not video.is_file():
            yield f"{camera}: {video.name} does not exist"
        elif int(probe(video)["nb_read_frames"]) != len(agent["qpos"]):
            yield f"{camera}: frames"


def missing_video_names(path: Path):
    """repair_video_paths: the missing names of videos."""
    with h5py.File(path) as f:
        for traj in (f[k] for k in f if k.startswith("traj_")):
            for camera in traj["obs/sensor_param"]:
                if camera not in traj["obs/sensor_data"]:
                    yield camera


def statistics(path: Path, keys=("actions", "obs/agent/qpos")):
    """calculate_stats: {"actions/joint_pos/arm": {mean, std, min, max, count}} over all trajectories of a file."""
    gathered: dict[str, list[np.ndarray]] = {}

    def gather(name, dataset, trim):
        assert np.issubdtype(dataset.dtype, np.integer) and dataset.ndim == 2, name  # integer data sets contain JSON rows
        decoded = rows(dataset)
        decoded = decoded[1:-1] if trim else decoded  # the first action is a placeholder, the last one the sentinel
        for group in decoded[0]:
            values = [row[group] for row in decoded]
            if len({len(v) for v in values}) == 1 and len(values[0]) > 0:
                gathered.setdefault(f"{name}/{group}", []).append(np.asarray(values, float))

    with h5py.File(path) as f:
        for traj in (f[k] for k in f if k.startswith("traj_")):
            for key in keys:
                if isinstance(traj[key], h5py.Group):
                    for name, dataset in traj[key].items():
                        gather(f"{key}/{name}", dataset, trim=key == "actions")
                else:
                    gather(key, traj[key], trim=False)
    result = {}
    for name, pieces in gathered.items():
        x = np.concatenate(pieces)
        mean = x.mean(0)
        std = np.sqrt(np.maximum((x**2).mean(0) - mean**2, 0))
        result[name] = dict(mean=mean, std=std, min=x.min(0), max=x.max(0), count=len(x))
    return result


def collect_episode_results(path: Path):
    """success = success[-1], oracle = any, steps = len(actions) - 2, text of obs_scene."""
    with h5py.File(path) as f:
        for traj in (f[k] for k in f if k.startswith("traj_")):
            scene = json.loads(traj["obs_scene"].asstr()[()])
            first = next(iter(traj["actions"].values()))
            yield dict(
                success=bool(traj["success"][-1]),
                oracle=bool(traj["success"][:].any()),
                steps=len(first) - 2,
                task_description=scene["task_description"],
                object_name=scene["object_name"],
            )


def training_samples(path: Path, action="joint_pos.arm"):
    """MolmoBot: sample s pairs state row s with action row s + 1, which gives T - 2 samples per trajectory."""
    name, group = action.split(".")
    with h5py.File(path) as f:
        for traj in (f[k] for k in f if k.startswith("traj_")):
            states, actions = rows(traj["obs/agent/qpos"]), rows(traj[f"actions/{name}"])
            for s in range(len(states) - 2):
                yield states[s], actions[s + 1][group]

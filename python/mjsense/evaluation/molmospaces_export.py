# SPDX-License-Identifier: Apache-2.0
"""Writes a benchmark as MolmoSpaces' ``benchmark.json``."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

from mjsense import _core
from mjsense.evaluation.benchmarks import DEFAULTS, IMAGE_OPTIONS, Benchmark, started
from mjsense.evaluation.molmospaces_benchmark import dataset_of
from mjsense.evaluation.molmospaces_episodes import FILE, PLACING, ROBOTS, TASKS
from mjsense.tasks.making import make_vec
from mjsense.tasks.vector import TaskVectorEnv


def export_molmospaces(benchmark: str | Path | Benchmark, out: str | Path, num_worlds: int = 4) -> int:
    """Writes the episodes of a benchmark as MolmoSpaces' ``benchmark.json``: robot, scene, poses of the objects, cameras, task,
    thresholds and instruction of each episode. Its member ``mjsense`` has what their schema has no member for.

    ``mjsense evaluate OUT`` plays them from the same starts. MolmoSpaces can read the file, but it plays the episodes only with
    scenes of these names, which it does not have.

    Args:
        benchmark: The benchmark: its folder, or ``benchmark:pick`` and similar.
        out: Folder, which must not exist.
        num_worlds: Number of worlds in which the starts are computed.

    Returns:
        Number of episodes.
    """
    folder = Path(out)
    if folder.exists():
        raise FileExistsError(f"benchmark: '{folder}' exists")
    made = benchmark if isinstance(benchmark, Benchmark) else Benchmark(benchmark)
    made.check_starts(num_worlds)
    recipe = {name: value for name, value in made.recipe.items() if name not in ("terminate_upon_success", "max_penetration")}
    if recipe["task"] not in (*TASKS, "close"):
        raise ValueError(f"benchmark: MolmoSpaces has no task '{recipe['task']}'; it has {', '.join(TASKS)} and close")
    if recipe.get("perturb"):
        raise ValueError("benchmark: MolmoSpaces' episodes cannot be perturbed, and this benchmark has perturb")
    env = make_vec(**recipe, num_envs=min(num_worlds, len(made.episodes)))
    try:
        episodes = [_spec(made, env, world, number) for world, number in started(env, made.episodes)]
    finally:
        env.close()
    part = folder.with_name(f".{folder.name}.part")
    part.mkdir(parents=True, exist_ok=True)
    (part / FILE).write_text(json.dumps(episodes, indent=1) + "\n", encoding="utf-8")
    os.rename(part, folder)
    return len(episodes)


def _spec(benchmark: Benchmark, env: TaskVectorEnv, world: int, number: int) -> dict[str, Any]:
    """The EpisodeSpec of a world's episode."""
    recipe, start = benchmark.recipe, json.loads(env._rollout.start_text(world))
    about = json.loads(env._rollout.obs_scene(world))
    dataset, split, house = dataset_of(recipe["scene"])
    sizes = {tuple(env.specs[name].shape[1::-1]) for name in start.get("cameras", ())}
    if len(sizes) != 1:
        what = "has none" if not sizes else f"has images of {' and '.join(f'{w}x{h}' for w, h in sorted(sizes))}"
        raise ValueError(f"benchmark: an episode of MolmoSpaces has cameras of one size, and this benchmark {what}")
    (size,) = sizes
    joints = start.get("joints", {})
    own = {
        "version": _core.__version__,  # pyright: ignore[reportAttributeAccessIssue]  # stubs leave it out
        "benchmark": benchmark.checksum,
        "episode": number,
        "horizon": env.horizon,
        "policy_dt_ms": recipe["policy_dt_ms"],
        "max_penetration": recipe["max_penetration"],
        "joints": joints,
        "options": {
            name: recipe[name]
            for name in ("arm_controller", *IMAGE_OPTIONS)
            if recipe.get(name, DEFAULTS[name]) != DEFAULTS[name]
        },
    }
    referrals = about.get("referral_expressions", {})
    return {
        "house_index": house,
        "scene_dataset": dataset,
        "data_split": split,
        "seed": recipe["seed"],
        "robot": {"robot_name": ROBOTS.get(recipe["robot"], recipe["robot"]), "init_qpos": start.get("robot", {})},
        "img_resolution": list(size),
        "cameras": [_camera(name, one, f"{name}_depth" in env.specs) for name, one in start["cameras"].items()],
        "scene_modifications": {
            "added_objects": {},
            "object_poses": start.get("bodies", {}),
            "removed_objects": start.get("absent", []),
        },
        "task": _task(recipe["task"], start, about, env, world),
        "task_relevant_objects": list(start.get("objects", {}).values()),
        "language": {
            "task_description": start["instruction"],
            "referral_expressions": {role: texts[0][0] for role, texts in referrals.items() if texts},
            "referral_expressions_priority": {},
        },
        "mjsense": {name: value for name, value in own.items() if value is not None},
    }


def _task(name: str, start: dict[str, Any], about: dict[str, Any], env: TaskVectorEnv, world: int) -> dict[str, Any]:
    objects, thresholds = start["objects"], dict(start.get("thresholds", {}))
    if "any_inst_of_category" in thresholds:
        thresholds["any_inst_of_category"] = bool(thresholds["any_inst_of_category"])
    task: dict[str, Any] = {
        "task_cls": f"molmo_spaces.tasks.{TASKS['open' if name == 'close' else name]}",
        "task_type": about["task_type"],
        "robot_base_pose": start["base"],
        **thresholds,
    }
    if name == "door_opening":
        return {**task, "door_body_name": objects["door_handle"]}
    target = objects["pickup_obj"]
    pose = start.get("bodies", {}).get(target)
    if pose is None:  # a part of the scene
        pose = [float(number) for number in env.rows["obj_start"][world]]
    task |= {"pickup_obj_name": target, "pickup_obj_start_pose": pose}
    if name in PLACING:
        receptacle = objects["place_receptacle"]
        task |= {"place_receptacle_name": receptacle, "place_receptacle_start_pose": start["bodies"][receptacle]}
    if name in ("open", "close"):
        model = env.sim.model
        joint = model.joint(int(model.body_jntadr[model.body(target).id])).name
        task |= {"joint_name": joint, "joint_start_position": [start["joints"][joint]]}
    return task


def _camera(name: str, camera: dict[str, Any], depth: bool) -> dict[str, Any]:
    if "body" not in camera:
        views = {key: camera[key] for key in ("pos", "up", "forward")}
        return {"name": name, "type": "exocentric", **views, "fov": camera["fovy"], "record_depth": depth}
    return {
        "name": name,
        "type": "robot_mounted",
        "reference_body_names": [camera["body"]],
        "camera_offset": camera["pos"],
        "lookat_offset": [0.0, 0.0, 0.0],
        "camera_quaternion": camera["quat"],
        "fov": camera["fovy"],
        "record_depth": depth,
    }

# SPDX-License-Identifier: Apache-2.0
"""Measures the differences between episodes and writes their table in docs/tasks.md.

    python tools/variety.py [--episodes 100] [--played 40] [--only SCENE]

Starts episodes of one recording in each scene of CASES like `mjsense record` with a randomised camera system, and plays
some with `--perturb 0.5` to measure the share of retries. Results are stored in .cache/variety.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
for build in ("release", "dev"):
    if (ROOT / "build" / build / "python").exists():
        sys.path.insert(0, str(ROOT / "build" / build / "python"))
        break
sys.path.insert(0, str(ROOT / "tools"))

import task_table

import mjsense as mjs

PAGE, RESULTS = ROOT / "docs" / "tasks.md", ROOT / ".cache" / "variety"
BEGIN, END = "<!-- variety -->", "<!-- end of variety -->"
# (task, scene, robot, camera system, policy). Policy "": the task has no grasp, so no approach direction is measured.
TABLES = tuple(
    ("pick", scene, "franka", "randomized_droid", "planner")
    for scene in ("table", "varied_table", "tableware", "clutter", "shelf")
)
CASES = (
    *TABLES,
    ("open", "kitchen", "franka", "randomized_droid", "planner"),
    ("door_opening", "room_with_door", "rby1", "gopro_d455", ""),
    ("nav_to_obj", "floor", "rby1", "gopro_d455", ""),
)
AWAY = 50.0  # m; absent objects are farther from the origin


def size(model: Any, aabb: Any, body: int) -> float:
    """Longest edge (m) of the bounding boxes of a body's geoms; `aabb` [ngeom, 6] are the boxes of a world."""
    geoms = [g for g in range(model.ngeom) if model.body_rootid[model.geom_bodyid[g]] == body]
    return float(max((2 * aabb[g, 3:].max() for g in geoms), default=0.0))


def starts(task: str, scene: str, robot: str, system: str, policy: str, episodes: int) -> dict[str, list[Any]]:
    """The randomised quantities at the start of each episode, by name."""
    worlds = 10
    found: dict[str, list[Any]] = {
        name: [] for name in ("x", "y", "turn", "count", "size", "light", "colour", "camera", "tilt", "factor", "furniture")
    }
    env = mjs.make_vec(
        task,
        robot,
        scene=scene,
        num_envs=worlds,
        camera_system=system,
        width=32,
        height=24,
        policy=policy or None,
        observations=["grasp_pose"] if policy else ["qpos"],
    )
    model = env.sim.model
    free = [int(b) for b in range(1, model.nbody) if model.body_jntnum[b] == 1 and model.jnt_type[model.body_jntadr[b]] == 0]
    sizes = {b: size(model, model.geom_aabb, b) for b in free}
    still = [b for b in range(1, model.nbody) if model.body_treeid[b] < 0 and not model.body(b).name.startswith("robot_0/")]
    for first in range(0, episodes, worlds):
        # A reset without a seed starts the next episodes of the same recording.
        env.reset(seed=0) if first == 0 else env.reset()
        pos, quat, boxes = env.sim.data.xpos, env.sim.data.xquat, env.sim.model_field("geom_aabb")
        for w in range(min(worlds, episodes - first)):
            here = [b for b in free if abs(pos[w, b, 1]) < AWAY]
            found["count"].append(len(here))
            for b in here:
                found["x"].append(float(pos[w, b, 0]))
                found["y"].append(float(pos[w, b, 1]))
                qw, _, _, qz = quat[w, b]
                found["turn"].append(float(np.degrees(2 * np.arctan2(qz, qw))))
                found["size"].append(size(model, boxes[w], b))
                found["factor"].append(found["size"][-1] / sizes[b])
            found["furniture"].append(pos[w, still].ravel().tolist())
            light = env.sim.model_field("light_diffuse")
            found["light"].append(float(np.broadcast_to(light, (worlds, *light.shape[-2:]))[w].sum()))
            colour = env.sim.model_field("mat_rgba")
            found["colour"].append(np.broadcast_to(colour, (worlds, *colour.shape[-2:]))[w, :, :3].ravel().tolist())
            cameras = env.sim.data.cam_xpos
            found["camera"].append(cameras[w].ravel().tolist())
            grasp = env.rows["grasp_pose"][w] if policy else np.zeros(7)
            if any(grasp[:3]):  # the identity means: no grasp
                qw, qx, qy, qz = grasp[3:]
                approach = qw * qw - qx * qx - qy * qy + qz * qz
                found["tilt"].append(float(np.degrees(np.arccos(np.clip(-approach, -1, 1)))))
    env.close()
    return found


def spread(values: list[float], digits: int) -> str:
    if not values:
        return ""
    return f"{min(values):.{digits}f} to {max(values):.{digits}f} ({np.std(values):.{digits}f})"


def measure(task: str, scene: str, robot: str, system: str, policy: str, episodes: int, played: int) -> dict[str, Any]:
    found = starts(task, scene, robot, system, policy, episodes)
    retried: list[bool] = []
    if policy:
        with tempfile.TemporaryDirectory() as out:
            made = mjs.record(
                task,
                robot,
                out=out,
                scene=scene,
                episodes=played,
                max_attempts=played,
                keep_failures=True,
                num_worlds=8,
                cameras=[],
                perturb=0.5,
                policy=policy,
            )
            retried = [e["retries"] > 0 for e in task_table.episodes_of(made.path)]
    colours, cameras = np.array(found["colour"]), np.array(found["camera"])
    furniture = np.array(found["furniture"])
    return {
        "task": task,
        "scene": scene,
        "episodes": episodes,
        "played": len(retried),
        "x": spread(found["x"], 2),
        "y": spread(found["y"], 2),
        "turn": float(np.std(found["turn"])) if found["turn"] else 0.0,
        "count": f"{min(found['count'])} to {max(found['count'])}",
        "size": spread([100 * s for s in found["size"]], 1),
        "factor": spread([100 * s for s in found["factor"]], 0),
        "furniture": int((furniture.std(0).reshape(-1, 3).max(1) > 1e-3).sum()),
        "moved": float(100 * furniture.std(0).max()) if furniture.size else 0.0,
        "light": spread(found["light"], 2),
        "colours": int((colours.std(0).reshape(-1, 3).max(1) > 0.01).sum()),
        "materials": colours.shape[1] // 3,
        "camera": float(100 * cameras.std(0).max()),
        "tilt": spread(found["tilt"], 0),
        "slanted": float(np.mean(np.array(found["tilt"]) > 30)) if found["tilt"] else None,
        "retried": float(np.mean(retried)) if retried else 0.0,
    }


def table(results: list[dict[str, Any]]) -> str:
    rows = [
        ("task, episodes", lambda r: f"`{r['task']}`, {r['episodes']}"),
        ("number of objects", lambda r: r["count"]),
        ("x of objects, m", lambda r: r["x"]),
        ("y of objects, m", lambda r: r["y"]),
        ("rotation of objects, standard deviation, degrees", lambda r: f"{r['turn']:.0f}"),
        ("size of objects, cm", lambda r: r["size"]),
        ("size relative to the model, %", lambda r: r["factor"]),
        ("furniture that moves, count; standard deviation, cm", lambda r: f"{r['furniture']}; {r['moved']:.1f}"),
        ("light, sum of the lamps' colours", lambda r: r["light"]),
        ("materials with other colours", lambda r: f"{r['colours']} of {r['materials']}"),
        ("cameras, standard deviation, cm", lambda r: f"{r['camera']:.0f}"),
        ("approach, degrees from vertical", lambda r: r["tilt"]),
        ("approaches more than 30 degrees from vertical", lambda r: "" if r["slanted"] is None else f"{r['slanted']:.0%}"),
        ("retried, `--perturb 0.5`", lambda r: f"{r['retried']:.0%} of {r['played']}" if r["played"] else ""),
    ]
    head = ["| | " + " | ".join(f"`{r['scene']}`" for r in results) + " |", "| --- |" + " --- |" * len(results)]
    return "\n".join(head + [f"| {name} | " + " | ".join(cell(r) for r in results) + " |" for name, cell in rows])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--episodes", type=int, default=100)
    parser.add_argument("--played", type=int, default=40)
    parser.add_argument("--only", default="", help="SCENE")
    arguments = parser.parse_args()
    RESULTS.mkdir(parents=True, exist_ok=True)
    results = []
    for task, scene, robot, system, policy in CASES:
        kept = RESULTS / f"{scene}.json"
        if arguments.only in ("", scene):
            kept.write_text(json.dumps(measure(task, scene, robot, system, policy, arguments.episodes, arguments.played)))
        if kept.exists():
            results.append(json.loads(kept.read_text()))
            print(results[-1], flush=True)
    text = PAGE.read_text()
    before, rest = text.split(BEGIN, 1)
    PAGE.write_text(f"{before}{BEGIN}\n{table(results)}\n{END}{rest.split(END, 1)[1]}")


if __name__ == "__main__":
    main()

# SPDX-License-Identifier: Apache-2.0
"""Record picks of a planner, then meet the same task as a gymnasium environment."""

import sys
import tempfile

import mjsense as mjs

out = sys.argv[1] if len(sys.argv) > 1 else tempfile.mkdtemp()
summary = mjs.record("pick", "franka", out=out, episodes=2, num_worlds=2, width=160, height=92)
print(f"{summary.kept} episodes, {summary.frames} frames in {summary.seconds:.1f} s: {summary.path}")

dataset = mjs.Dataset(summary.path)
sample = dataset[10]
print("observed:", ", ".join(name for name in sample if name.startswith("obs/")))
print(
    "image:", sample["obs/sensor_data/wrist_camera"].shape, "joints:", sample["obs/agent/qpos/arm"].shape, "task:", sample["task"]
)
print("success at step", int(dataset.episodes[0]["success"].argmax()))

env = mjs.make_vec("pick", num_envs=2, policy="planner", cameras=[], seed=7)
observation, _ = env.reset()
print("observation:", {"arm": observation["qpos"]["arm"].shape, "tool": observation["tcp_pose"].shape})
picked = [False, False]
for step in range(150):
    observation, reward, terminated, truncated, info = env.step(env.expert_action())
    picked = [a or bool(b) for a, b in zip(picked, info["success"])]
    if all(picked):
        break
print("the planner picked", sum(picked), "of 2 objects in", step + 1, "steps")
env.close()

# SPDX-License-Identifier: Apache-2.0
"""Tasks open and close in a kitchen: observations and success rates, and independence of the number of worlds."""

import numpy as np
import pytest

import mjsense as mjs


def play(task, num_envs, episodes, horizon=200, **options):
    """Rows of every step by episode, and how each ended."""
    env = mjs.make_vec(task, "franka", num_envs=num_envs, policy="planner", cameras=[], seed=4, autoreset_mode="disabled",
                       horizon=horizon, action_noise=True, **options)  # fmt: skip
    rows, success = {}, {}
    for first in range(0, episodes, num_envs):
        env.reset(options={"reset_mask": np.ones(num_envs, bool)})
        running = np.ones(num_envs, bool)
        while running.any():
            actions = env.expert_action()
            _, reward, terminated, truncated, info = env.step(actions, done=env.expert_done.copy())
            for w in np.flatnonzero(running):
                row = np.concatenate([np.ravel(env.rows[name][w]).astype(float) for name in env.rows] + [[reward[w]]])
                rows.setdefault(first + w, []).append(row)
                success[first + w] = bool(info["success"][w])
            running &= ~(terminated | truncated)
    env.close()
    return rows, success


@pytest.mark.parametrize("task", ["open", "close"])
def test_most_episodes_succeed(task):
    rows, success = play(task, 8, 8, observations=["policy_phase"])
    assert sum(success.values()) >= 7, success
    phases = {row[0] for episode in rows.values() for row in episode}
    assert {2.0, 3.0, 4.0, 5.0} <= phases


def test_other_worlds_change_nothing():
    alone, _ = play("close", 1, 3, horizon=60)
    beside, _ = play("close", 3, 3, horizon=60)
    for episode in range(3):
        np.testing.assert_array_equal(np.array(alone[episode]), np.array(beside[episode]))


def test_the_suite():
    env = mjs.make_vec("open", "franka", policy="planner", cameras=[])
    names = list(dict.fromkeys(name.split("/")[0] for name in env.rows))
    assert [n for n in names if n in ("obj_start", "grasp_state_pickup_obj", "obj_end")] == [
        "obj_start", "grasp_state_pickup_obj", "obj_end"]  # fmt: skip
    env.reset(seed=0)
    start, end = env.rows["obj_start"][0], env.rows["obj_end"][0]
    assert np.linalg.norm(start - end) > 0.01


def test_starts_differ_and_the_shoulder_camera_sees_the_target():
    seen, bases, targets, lights = 0, [], [], []
    env = mjs.make_vec("open", "franka", num_envs=12, camera_system="droid", width=160, height=96, seed=5,
                       observations=["exo_camera_1", "object_image_points", "obj_start", "robot_base_pose"])  # fmt: skip
    env.reset()
    points = {
        name: array
        for name, array in env.rows.items()
        if "exo_camera_1" in name and "num_points" in name and "pickup_obj" in name
    }
    (count,) = points.values()
    for w in range(12):
        seen += bool(count[w] > 0)
        bases.append(env.rows["robot_base_pose"][w][:2].copy())
        targets.append(env.rows["obj_start"][w][:3].copy())
        lights.append(env.rows["exo_camera_1"][w].mean())
    env.close()
    assert seen >= 11, f"the target is in {seen} of 12 pictures"
    assert len(np.unique(np.round(targets, 3), axis=0)) >= 4
    assert len(np.unique(np.round(bases, 4), axis=0)) == 12
    assert np.std(lights) > 2

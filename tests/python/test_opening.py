# SPDX-License-Identifier: Apache-2.0
"""Tasks open and close in a kitchen: what they observe, that they succeed, and that a world does not know how many others there are."""

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


def test_worlds_beside_it_change_nothing():
    alone, _ = play("close", 1, 3, horizon=60)
    beside, _ = play("close", 3, 3, horizon=60)
    for episode in range(3):
        np.testing.assert_array_equal(np.array(alone[episode]), np.array(beside[episode]))


def test_the_suite():
    env = mjs.make_vec("open", "franka", policy="planner", cameras=[])
    names = list(dict.fromkeys(name.split("/")[0] for name in env.rows))
    assert [n for n in names if n in ("obj_start", "grasp_state_pickup_obj", "obj_end")] == [
        "obj_start", "grasp_state_pickup_obj", "obj_end"]  # fmt: skip
    env.reset()
    start, end = env.rows["obj_start"][0], env.rows["obj_end"][0]
    assert np.linalg.norm(start - end) > 0.01

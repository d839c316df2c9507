# SPDX-License-Identifier: Apache-2.0
"""What tasks observe, against plain MuJoCo: at the first, a middle and the last step, in one world and in eight that are at different
points of their episodes; and an episode in one world equals the episode of the same number among other worlds, bit for bit."""

import json

import h5py
import mujoco
import numpy as np
import pytest
from world_model import model_of

import mjsense as mjs

TASKS = [
    ("pick", "franka", 60),
    ("pick_and_place", "franka", 90),
    ("pick_and_place_next_to", "franka", 20),
    ("pick_and_place_color", "franka", 20),
    ("packing", "floating_rum", 60),
    ("open", "franka", 90),
    ("close", "rby1", 40),
    ("door_opening", "rby1", 60),
    ("nav_to_obj", "mobile_franka", 20),
]
TOOLS = {
    "franka": {"tcp_pose": "gripper/grasp_site"},
    "mobile_franka": {"tcp_pose": "gripper/grasp_site"},
    "floating_rum": {"tcp_pose": "grasp_site"},
    "rby1": {
        "left_tcp_pose": "ee_site_l",
        "tcp_pose_left": "ee_site_l",
        "right_tcp_pose": "ee_site_r",
        "tcp_pose_right": "ee_site_r",
    },
}
GRIPPERS = {
    "franka": {"gripper": "gripper/base"},
    "mobile_franka": {"gripper": "gripper/base"},
    "floating_rum": {"gripper": "base"},
    "rby1": {"left_gripper": "link_left_arm_6", "right_gripper": "link_right_arm_6"},
}


def matrix(quat):
    out = np.zeros(9)
    mujoco.mju_quat2Mat(out, np.asarray(quat, float))
    return out.reshape(3, 3)


def below(model, body, root):
    while body > 0 and body != root:
        body = model.body_parentid[body]
    return body == root


def world_of(env, w):
    """Plain MuJoCo's data for what a world stands at."""
    model = model_of(env.sim, w)
    data = mujoco.MjData(model)
    data.qpos, data.qvel = env.sim.qpos[w], env.sim.qvel[w]
    if env.sim.model.nmocap:
        data.mocap_pos, data.mocap_quat = env.sim.mocap_pos[w], env.sim.mocap_quat[w]
    mujoco.mj_forward(model, data)
    return data


def grasp_state(model, data, target, gripper):
    """(held, touching) from the contacts with exactly one side in the object."""
    touching, foreign = False, False
    everybody = [model.body(f"robot_0/{name}").id for name in gripper["all"]]
    mine = model.body(f"robot_0/{gripper['own']}").id
    for contact in data.contact:
        bodies = [model.geom_bodyid[g] for g in contact.geom]
        inside = [below(model, b, target) for b in bodies]
        if contact.exclude or inside[0] == inside[1]:
            continue
        other = bodies[1] if inside[0] else bodies[0]
        touching |= below(model, other, mine)
        foreign |= not any(below(model, other, root) for root in everybody)
    return touching and not foreign, touching


def check(env, robot, targets, w):
    model, data = env.sim.model, world_of(env, w)
    base = model.body("robot_0/base").id
    turn, place = data.xmat[base].reshape(3, 3), data.xpos[base]
    compared = set()
    for name, site in TOOLS[robot].items():
        if name not in env.rows:
            continue
        row, tool = env.rows[name][w], data.site("robot_0/" + site)
        np.testing.assert_allclose(row[:3], turn.T @ (tool.xpos - place), atol=2e-6)
        np.testing.assert_allclose(matrix(row[3:]), turn.T @ tool.xmat.reshape(3, 3), atol=2e-6)
        compared.add(name)
    assert compared, "no tool's pose is observed"
    names = GRIPPERS[robot]
    for role in {name.split("/")[0] for name in env.rows if name.startswith("grasp_state_pickup_obj/")}:
        for gripper, root in names.items():
            held, touching = grasp_state(model, data, targets[w], {"all": names.values(), "own": root})
            assert bool(env.rows[f"{role}/{gripper}/touching"][w]) == touching, (role, gripper)
            assert bool(env.rows[f"{role}/{gripper}/held"][w]) == held, (role, gripper)


def at_start(env, targets, worlds):
    """The body that an episode is about: the nearest to where obj_start says."""
    if "obj_start" not in env.rows:
        return
    for w in worlds:
        far = np.linalg.norm(world_of(env, w).xpos - env.rows["obj_start"][w][:3], axis=1)
        targets[w] = int(np.argmin(far))
        assert far[targets[w]] < 1e-5


@pytest.mark.parametrize("num_envs", [1, 8])
@pytest.mark.parametrize("task,robot,steps", TASKS)
def test_against_plain_mujoco(task, robot, steps, num_envs):
    env = mjs.make_vec(task, robot, num_envs=num_envs, policy="planner", cameras=[], seed=2, horizon=steps, autoreset_mode="disabled")
    targets = np.zeros(num_envs, int)
    env.reset()
    at_start(env, targets, range(num_envs))
    moved, over = False, np.zeros(num_envs, bool)
    for step in range(steps + 1):
        if step in (0, steps // 2, steps):
            for w in range(num_envs):
                check(env, robot, targets, w)
        if step == steps:
            break
        if step == 10:  # from here on half of the worlds are ten steps behind
            mask = np.arange(num_envs) % 2 == 1
            if mask.any():
                env.reset(options={"reset_mask": mask})
                at_start(env, targets, np.flatnonzero(mask))
        before = env.sim.qpos.copy()
        _, _, terminated, truncated, _ = env.step(env.expert_action(), done=env.expert_done.copy())
        over = terminated | truncated
        moved |= bool(np.abs(env.sim.qpos - before).max() > 1e-4)
    env.close()
    assert moved and over.tolist() == [w % 2 == 0 for w in range(num_envs)], "the last step is terminal where nothing began anew"


@pytest.mark.parametrize("task,robot", [(task, robot) for task, robot, _ in TASKS if task not in ("pick", "open")])
def test_other_worlds_change_nothing(task, robot):
    def play(num_envs):
        env = mjs.make_vec(task, robot, num_envs=num_envs, policy="planner", cameras=[], seed=4, autoreset_mode="disabled")
        rows = []
        for _ in range(0, 2, num_envs if num_envs < 2 else 2):
            env.reset(options={"reset_mask": np.ones(num_envs, bool)})
            steps = []
            for _ in range(15):
                env.step(env.expert_action(), done=env.expert_done.copy())
                steps.append([np.concatenate([np.ravel(array[w]).astype(float) for array in env.rows.values()])
                              for w in range(min(num_envs, 2))])  # fmt: skip
            rows.append(np.array(steps))
        env.close()
        return np.concatenate(rows, axis=1)

    np.testing.assert_array_equal(play(1), play(8))


def test_door_state_is_of_this_step(tmp_path):
    """Joint angle, hinge, handle and poses, from the recorded state of the door's joints: not one step old."""
    made = mjs.record(
        "door_opening", "rby1", out=tmp_path / "door", episodes=1, max_attempts=1, keep_failures=True, cameras=[], horizon=230
    )
    env = mjs.make_vec("door_opening", "rby1", cameras=[])
    model = env.sim.model
    data = mujoco.MjData(model)
    (file,) = made.path.glob("*.h5")
    with h5py.File(file) as recorded:
        (episode,) = recorded.values()
        states = np.array(episode["env_states/articulations/room_door"])
        texts = {name: [json.loads(bytes(row).split(b"\0")[0]) for row in episode[f"obs/extra/{name}"][:]]
                 for name in ("door_state", "object_poses")}  # fmt: skip
        bases = np.array(episode["obs/extra/robot_base_pose"], float)
    door = model.body("room/door").id
    joints = [j for j in range(model.njnt) if below(model, model.jnt_bodyid[j], door)]
    assert np.ptp(states[:, 0]) > 0.3, "the door never moved"
    for step in (0, len(states) // 2, len(states) - 1):
        for joint, value in zip(joints, states[step], strict=False):
            data.qpos[model.jnt_qposadr[joint]] = value
        mujoco.mj_kinematics(model, data)
        state, poses = texts["door_state"][step], texts["object_poses"][step]
        assert state["joint_angle"][0] == pytest.approx(states[step, 0], abs=1e-6)
        np.testing.assert_allclose(state["door_position"], data.xanchor[joints[0]], atol=1e-5)
        for name, body in (("door", door), ("door_handle", model.body("room/door_handle").id)):
            pose = np.array(poses[name])
            turn = matrix(bases[step, 3:])  # poses are in the robot's frame
            np.testing.assert_allclose(pose[:3, 3], turn.T @ (data.xpos[body] - bases[step, :3]), atol=1e-4)
            np.testing.assert_allclose(pose[:3, :3], turn.T @ data.xmat[body].reshape(3, 3), atol=1e-4)
        assert state["is_open"][0] == (state["opening_percentage"][0] >= 0.67) or 0.6 < state["opening_percentage"][0] < 0.7
    env.close()

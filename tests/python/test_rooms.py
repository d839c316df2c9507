# SPDX-License-Identifier: Apache-2.0
"""Doors and floors: every sensor of their tasks against MuJoCo's own numbers, in one world and in eight, and recordings of them."""

import itertools
import json

import h5py
import mujoco
import numpy as np
import pytest

import mjsense as mjs

DOOR, LEVER = "room/door_hinge", "room/door_handle_hinge"


def rows(row):
    return json.loads(bytes(np.asarray(row, np.uint8)).rstrip(b"\0"))


def fresh(env, world):
    """The world's state in data of its own, brought up to date by MuJoCo."""
    model = env.sim.model
    data = mujoco.MjData(model)
    for name in ("qpos", "qvel", "ctrl", "mocap_pos", "mocap_quat"):
        getattr(data, name)[:] = np.asarray(getattr(env.sim.data, name)[world]).reshape(getattr(data, name).shape)
    mujoco.mj_forward(model, data)
    return model, data


def pose(data, body):
    out = np.eye(4)
    out[:3, :3], out[:3, 3] = data.xmat[body].reshape(3, 3), data.xpos[body]
    return out


def flat(action_space):
    return np.zeros(action_space.shape, action_space.dtype)


@pytest.mark.parametrize("worlds", [1, 8])
def test_rows_of_a_door(worlds):
    env = mjs.make_vec(
        "door_opening",
        "rby1",
        num_envs=worlds,
        scene="room_with_door:2",
        cameras=[],
        horizon=4,
        autoreset_mode="disabled",
        observations=[
            "door_state",
            "object_poses",
            *(f"{s}_tcp_pose" for s in ("left", "right")),
            *(f"rby1_{s}_grasp_state" for s in ("left", "right")),
        ],
    )
    env.reset(seed=3)
    model = env.sim.model
    hinge, lever = (mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, n) for n in (DOOR, LEVER))
    bodies = {"door": "room/door", "door_handle": "room/door_handle"}
    seen = set()
    for step in range(5):
        for w in range(worlds):
            _, data = fresh(env, w)
            state = rows(env.rows["door_state"][w])
            low, high = model.jnt_range[hinge]
            angle = data.qpos[model.jnt_qposadr[hinge]]
            assert high == 0, "this house's hinge turns by negative angles"
            assert state["joint_angle"] == pytest.approx([angle], abs=1e-9)
            assert state["opening_percentage"] == pytest.approx([np.clip(angle / low, 0, 1)], abs=1e-9)
            assert state["is_open"] == [bool(angle / low >= 0.67)]
            np.testing.assert_allclose(state["door_position"], data.xanchor[hinge], atol=1e-9)
            base = np.linalg.inv(pose(data, model.body("robot_0/base").id))
            for name, matrix in rows(env.rows["object_poses"][w]).items():
                np.testing.assert_allclose(matrix, base @ pose(data, model.body(bodies[name]).id), atol=1e-9)
            for side in ("left", "right"):
                site = model.site(f"robot_0/ee_site_{side[0]}").id
                np.testing.assert_allclose(
                    env.rows[f"{side}_tcp_pose"][w][:3], (base @ np.append(data.site_xpos[site], 1))[:3], atol=1e-5
                )
                assert env.rows[f"rby1_{side}_grasp_state"][w] == 0
            seen.add(round(angle, 2))
        if step == 1:  # open the door by a different angle in every world
            for w in range(worlds):
                env.sim.data.qpos[w, model.jnt_qposadr[hinge]] = -0.3 - 0.1 * w
                env.sim.data.qpos[w, model.jnt_qposadr[lever]] = 0.7
        if step < 4:
            _, _, _, truncated, _ = env.step(flat(env.action_space))
    assert truncated.all()
    assert len(seen) > worlds
    env.close()


@pytest.mark.parametrize("worlds", [1, 8])
def test_rows_of_a_floor(worlds):
    env = mjs.make_vec(
        "nav_to_obj",
        "rby1",
        num_envs=worlds,
        scene="floor:1",
        cameras=[],
        horizon=2,
        autoreset_mode="disabled",
        observations=["pickup_obj_pose", "task_info"],
    )
    env.reset(seed=1)
    model = env.sim.model
    for step in range(3):
        for w in range(worlds):
            _, data = fresh(env, w)
            robot = pose(data, model.body("robot_0/base").id)
            distances = []
            for name, matrix in rows(env.rows["pickup_obj_pose"][w]).items():
                at = pose(data, model.body(name).id)
                np.testing.assert_allclose(matrix, np.linalg.inv(robot) @ at, atol=1e-9)
                distances.append(np.hypot(*(at[:2, 3] - robot[:2, 3])))
            info = rows(env.rows["task_info"][w])
            assert info == {"position_error": pytest.approx(min(distances), abs=1e-6), "success": False}
        if step < 2:
            env.step(flat(env.action_space))
    env.close()


@pytest.mark.parametrize("task", ["nav_to_obj", "door_opening"])
def test_a_recording_is_the_same_in_one_world_and_in_three(task, tmp_path):
    streams = []
    for worlds, threads in ((1, 1), (3, 2)):
        out = tmp_path / str(worlds)
        mjs.record(
            task,
            "rby1",
            out=out,
            episodes=3,
            max_attempts=3,
            num_worlds=worlds,
            threads=threads,
            cameras=[],
            horizon=6,
            keep_failures=True,
        )
        with h5py.File(next(out.rglob("*.h5"))) as file:
            found = {}
            file.visititems(
                lambda name, item, found=found: found.update({name: item[()]}) if isinstance(item, h5py.Dataset) else None
            )
        streams.append(found)
    assert streams[0].keys() == streams[1].keys()
    for name, value in streams[0].items():
        np.testing.assert_array_equal(value, streams[1][name], err_msg=name)
    phases = json.loads(streams[0]["traj_0/obs_scene"])["policy_phases"]
    assert phases["navigate" if task == "nav_to_obj" else "OPEN_DOOR"] == (0 if task == "nav_to_obj" else 4)


def test_any_of_several_tasks():
    env = mjs.make_vec(
        "nav_to_obj+pick", "rby1", num_envs=2, cameras=[], horizon=2, observations=["task_info", "pickup_obj_pose", "obj_start"]
    )
    env.reset(seed=0)
    info = rows(env.rows["task_info"][1])
    assert set(info) == {"success", "tasks"} and set(info["tasks"]) == {"nav_to_obj", "pick"}
    env.step(flat(env.action_space))
    assert rows(env.rows["task_info"][1])["tasks"]["pick"]["episode_step"] == 1
    env.close()
    with pytest.raises(KeyError, match="did you mean 'pick'"):
        mjs.make_vec("nav_to_obj+pik", "rby1", num_envs=1, cameras=[])


def test_nav_and_pick_drives_and_then_picks(tmp_path):
    made = mjs.record("nav_and_pick", out=tmp_path, num_attempts=2, num_worlds=2, cameras=[])
    assert made.succeeded == 2, made.failures
    episode = mjs.Dataset(tmp_path).episodes[1]
    assert episode.settings["robot"] == "mobile_franka" and episode.task.endswith((" it", " it up", " it?", " it up?"))
    numbers = episode.obs_scene["policy_phases"]
    phases = episode["obs/extra/policy_phase"].ravel()
    order = [int(number) for number, _ in itertools.groupby(phases)]
    assert order[0] == numbers["navigate"] and order[-1] == numbers["lift"] and order.count(numbers["navigate"]) == 1
    base = episode["obs/extra/robot_base_pose"]
    driven = np.linalg.norm(base[phases == numbers["navigate"]][-1, :2] - base[0, :2])
    assert driven > 1


@pytest.mark.parametrize("name", ["nav_to_obj+pick", "open+pick"])
def test_a_recording_of_several_tasks(name, tmp_path):
    robot = "rby1" if name.startswith("nav") else "franka"
    mjs.record(name, robot, out=tmp_path, episodes=1, max_attempts=1, cameras=[], horizon=4, keep_failures=True)
    with h5py.File(next(tmp_path.rglob("*.h5"))) as file:
        scene = json.loads(file["traj_0/obs_scene"][()])
    assert scene["task_type"] == "multi_task"
    first, second = scene["task_description"].split(" OR ")
    assert first.startswith("Navigate" if robot == "rby1" else "Open") and second.startswith("Pick up the ")
    assert scene["policy_phases"]

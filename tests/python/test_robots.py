# SPDX-License-Identifier: Apache-2.0
"""Robots are data: in Python, recordings and environments. No code depends on a robot's name."""

import contextlib
import json
import re
from pathlib import Path

import h5py
import mujoco
import numpy as np
import pytest
from world_model import model_of

import mjsense as mjs

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize("name", mjs.robot_names())
def test_robot_attributes(name):
    robot = mjs.Robot(name)
    assert robot.name == name and robot.description.endswith(".") and repr(robot).startswith(f"<robot '{name}'")
    assert robot.policy_dt >= robot.ctrl_dt >= robot.sim_dt > 0
    model = mujoco.MjModel.from_xml_string(robot.xml)
    for group in robot.groups.values():
        assert all(mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, j) >= 0 for j in group.joints)
        assert all(mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_ACTUATOR, a) >= 0 for a in group.actuators)
        assert len(group.command_low) == len(group.command_high) == group.num_commands
        assert len(group.init) in (0, group.num_qpos)
    assert all(mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_CAMERA, c.camera) >= 0 for c in robot.cameras)


@pytest.mark.parametrize("name", [n for n in mjs.robot_names() if any(g.kind == "arm" for g in mjs.Robot(n).groups.values())])
def test_kinematics(name):
    robot = mjs.Robot(name)
    for group in (g for g in robot.groups.values() if g.kind == "arm"):
        rng, solved = np.random.default_rng(0), 0
        for _ in range(20):
            goal = group.low + rng.random(group.num_qpos) * (group.high - group.low)
            pose = robot.fk(group.name, **{group.name: goal})
            if (found := robot.ik(group.name, pose)) is not None:
                solved += 1
                np.testing.assert_allclose(robot.fk(group.name, **{group.name: found})[:3], pose[:3], atol=2e-4)
        assert solved >= 19
        assert robot.ik(group.name, [9, 9, 9, 1, 0, 0, 0]) is None


def test_wrong_input_is_one_clear_line():
    with pytest.raises(KeyError, match="no robot named 'frnka'; did you mean 'franka'"):
        mjs.Robot("frnka")
    with pytest.raises(ValueError, match=r"nowhere\.toml: no such file"):
        mjs.Robot("nowhere.toml")
    robot = mjs.Robot("franka")
    with pytest.raises(KeyError, match="no move group named 'leg'"):
        robot.fk("arm", leg=[0])
    with pytest.raises(ValueError, match="2 positions for move group 'arm', which has 7"):
        robot.fk("arm", arm=[0, 0])
    with pytest.raises(ValueError, match="must be x, y, z and w, x, y, z"):
        robot.ik("arm", [0, 0, 0])


@pytest.mark.parametrize("name", mjs.robot_names())
def test_every_robot_runs_an_episode(name):
    """In the room of the pick task: its suite's names, shapes and dtypes, and a step with every group commanded."""
    robot = mjs.Robot(name)
    with contextlib.closing(mjs.make_vec("pick", robot=name, num_envs=2, cameras=[])) as env:
        observation, _ = env.reset(seed=3)
        rows = env.rows
        shapes = {"qpos": "num_qpos", "qvel": "num_qvel", "actions/commanded_action": "num_commands"}
        for group in robot.groups.values():
            for sensor, size in shapes.items():
                # An environment leaves out what has no numbers; a recording has its empty list.
                if n := getattr(group, size):
                    assert rows[f"{sensor}/{group.name}"].shape == (2, n), sensor
                    assert rows[f"{sensor}/{group.name}"].dtype == np.float32
            assert rows[f"actions/ee_pose/{group.name}"].shape == (2, 7)
        whole = rows[f"env_states/articulations/{name}"]
        joints = sum(g.num_qpos + g.num_qvel for g in robot.groups.values())
        assert whole.dtype == np.float64 and whole.shape[1] >= joints
        assert rows["env_states/articulations/panda"].shape[1] >= 31
        assert observation["robot_base_pose"].shape == (2, 7)
        grippers = [g for g in robot.groups.values() if g.kind == "gripper"]
        tools = ["tcp_pose"] if len(grippers) == 1 else [f"tcp_pose_{g.name.split('_')[0]}" for g in grippers]
        assert all(observation[tool].shape == (2, 7) and np.isfinite(observation[tool]).all() for tool in tools)
        # A floating base takes a pose, everything else may be told 0.
        command = [
            [0, 0, 0.5, 1, 0, 0, 0] if g.command_unit == "m, wxyz" else [0] * g.num_commands for g in robot.groups.values()
        ]
        action = np.tile(np.concatenate(command), (2, 1)).astype(np.float32)
        assert env.action_space.shape == action.shape
        observation, *_ = env.step(action)
        assert np.isfinite(observation["env_states"]["articulations"][name]).all()


def test_a_robots_state_can_be_restored(tmp_path):
    """The row of a recording, written into the same model, is the state that was recorded."""
    mjs.record("pick", robot="franka", policy="planner", out=tmp_path, episodes=1, cameras=[], horizon=5, keep_failures=True)
    with h5py.File(next(tmp_path.rglob("*.h5"))) as file:
        row = file["traj_0/env_states/articulations/franka"][3]
        group = json.loads(bytes(file["traj_0/obs/agent/qpos"][3]).rstrip(b"\0"))
        peer = file["traj_0/env_states/articulations/panda"]
        assert peer.shape[1:] == (31,) and peer.dtype == np.float32
    model = mujoco.MjModel.from_xml_string(mjs.Robot("franka").xml)
    assert row.dtype == np.float64 and len(row) == model.nq + model.nv
    qpos = dict(zip([model.joint(j).name for j in range(model.njnt)], row))
    np.testing.assert_allclose([qpos[f"fr3_joint{k}"] for k in range(1, 8)], group["arm"], rtol=1e-6)
    assert "gripper/left_follower_joint" in qpos  # a passive one


def test_no_code_knows_a_robot_by_its_name():
    """Outside the robots' folders: but for the defaults of what is recorded, and an example in a sentence of help."""
    names = re.compile("|".join(mjs.robot_names()), re.IGNORECASE)
    known = {
        ("task_defaults.cc", 'constexpr std::string_view kUsualRobot = "franka";'),
        ("task_defaults.cc", '{"door_opening", "rby1", 400, 0, 0, 0},'),
        ("task_defaults.cc", '{"nav_to_obj", "rby1", 500, 200, 2, 2},'),
        ("task_defaults.cc", '{"nav_and_pick", "mobile_franka", 1200, 0, 0, 0},'),
        ("rollout.h", '"the meshes if the robot\'s environment variable (``MJSENSE_FRANKA_MESHES``) names their "'),
    }
    for path in (ROOT / "src").rglob("*"):
        if path.suffix not in (".h", ".cc") or path.name.endswith(("_test.cc", "_bench.cc")) or "testing" in path.parts:
            continue
        for line in path.read_text().splitlines():
            code = line.split("//")[0]
            example = '{"mjsense ' in code  # of a command, in its help
            assert not names.search(code) or example or (path.name, code.strip()) in known, f"{path}: {line}"


def test_an_episode_with_a_deep_contact_is_no_success(tmp_path):
    """Fingers press into what they hold by some 0.1 mm: with a bound below that, no pick is a success; without one, all are."""
    options = {"scene": "table", "policy": "top_down_planner", "num_attempts": 3, "cameras": [], "keep_failures": True}
    made = mjs.record("pick", "franka", out=tmp_path / "bound", max_penetration=2e-5, **options)
    assert made.succeeded == 0 and made.failures == {"no success: a contact was too deep": 3}
    for episode in mjs.Dataset(made.path).episodes:
        assert re.fullmatch(r"no success: a contact was too deep \(\d\.\d mm in step \d+: '.+' and '.+'; max_penetration is 0\.02 mm\)",
                            episode.outcome)  # fmt: skip
        assert not episode["success"][-1]
    assert mjs.record("pick", "franka", out=tmp_path / "any", max_penetration=0, **options).succeeded == 3


def test_discs_that_are_wider_than_the_hand_are_not_targets():
    """A YAM opens its fingers by 75 mm. A lying disc of 78 mm is flat enough, but would need a finger below it."""
    with contextlib.closing(mjs.make_vec("pick_and_place", "i2rt_yam", num_envs=24, policy=None, cameras=[])) as env:
        env.reset(seed=0)
        widths = [[], []]
        for world in range(24):
            model = model_of(env.sim, world)
            target = json.loads(env._rollout.obs_scene(world))["objects"]["pickup_obj"]["body"]
            disc = model.body("yellow_puck/yellow_puck")
            widths[target == disc.name].append(2000 * model.geom_size[disc.geomadr[0], 0])
    other, chosen = widths
    assert max(other) > 71 and chosen and max(chosen) < 71, widths


@pytest.mark.parametrize(
    ("task", "robot", "system", "outer", "wrist", "few"),
    [("pick", "rby1", "", "camera_follower", "", 2), ("pick", "i2rt_yam", "", "exo_camera_1", "wrist_camera", 0),
     ("pick", "franka", "gopro_d405_d455", "exo_camera_1", "wrist_camera", 0), ("pick", "franka", "", "exo_camera_1", "wrist_camera", 0)],
)  # fmt: skip
def test_cameras_show_the_target_at_the_start(task, robot, system, outer, wrist, few):
    """A disc of the area of the target is at least 20 pixels wide at 640x480 in one outer camera, except in a few episodes in which a
    hand hides it; and in the wrist camera in most episodes."""
    cameras = [outer, wrist] if wrist else [outer]
    with contextlib.closing(
        mjs.make_vec(task, robot, num_envs=8, policy=None, camera_system=system, segmentation=True, cameras=cameras)
    ) as env:
        observation, _ = env.reset(seed=940300)
        model = env.sim.model
        wide = dict.fromkeys(cameras, 0)
        for world in range(8):
            target = model.body(json.loads(env._rollout.obs_scene(world))["objects"]["pickup_obj"]["body"]).id
            geoms = [g for g in range(model.ngeom) if model.body_rootid[model.geom_bodyid[g]] == target]
            for camera in cameras:
                pixels = observation[f"{camera}_segmentation"][world]
                area = (np.isin(pixels[..., 0], geoms) & (pixels[..., 1] == 5)).sum()
                wide[camera] += 2 * np.sqrt(area / np.pi) >= 20
    assert wide[outer] >= 8 - few, wide
    assert not wrist or wide[wrist] >= 6, wide

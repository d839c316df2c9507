# SPDX-License-Identifier: Apache-2.0
"""The sensors of the core suite as classes of their own."""

import gymnasium
import h5py
import mujoco
import numpy as np
import pytest
from scenes import ARM, ball_scene

import mjsense as mjs

ROOM = """
<mujoco>
  <worldbody>
    <light pos="0 0 3"/>
    <geom name="floor" type="plane" size="2 2 .1"/>
    <camera name="eye" pos="0 -1 .5" xyaxes="1 0 0 0 .3 1" fovy="50"/>
    <body name="cube" pos="0 0 .1"><freejoint/><geom type="box" size=".1 .1 .1" rgba="1 0 0 1"/><site name="top" pos="0 0 .1"/></body>
  </worldbody>
</mujoco>
"""


def room(*sensors):
    camera = mjs.CameraSensorCfg(name="front", camera_name="room/eye", width=48, height=32, data_types=("rgb", "depth", "segmentation"))
    return mjs.Scene(
        mjs.SceneCfg(
            entities={"room": mjs.EntityCfg(model=ROOM), "arm": mjs.EntityCfg(model=ARM)}, sensors=(camera, *sensors)
        )
    )


def test_in_a_suite_of_a_plain_simulation():
    sim = mjs.Simulation(room(), num_worlds=3)
    suite = mjs.SensorSuite([
        mjs.sensors.JointPositionSensor({"arm": ["arm/shoulder", "arm/elbow"], "none": []}),
        mjs.sensors.JointVelocitySensor(uuid="all_qvel"),
        mjs.sensors.PoseSensor("top", site="room/top"),
        mjs.sensors.PoseSensor("hand", site="arm/hand", reference_body="room/cube"),
        mjs.sensors.EnvStatesSensor({"arm": ["arm/elbow"]}, articulation="peers", length=4, robot=""),
        mjs.sensors.CameraParameterSensor("room/eye", 48, 32, uuid="camera"),
        mjs.sensors.CameraImageSensor("front"),
        mjs.sensors.CameraImageSensor("front", "depth"),
        mjs.sensors.ImagePointsSensor({"cube": "room/cube"}, ["front"]),
        mjs.sensors.GraspStateSensor("room/cube", {"arm": "arm/fore"}, uuid="held"),
        mjs.sensors.FunctionSensor("elbow", lambda env, world: np.array([env.qpos[world, -1]]), gymnasium.spaces.Box(-9, 9, (1,), np.float64)),
        mjs.sensors.FunctionSensor("words", lambda env, world: {"world": world}, is_dict=True, str_max_len=32),
    ])  # fmt: skip
    names = ["qpos", "all_qvel", "top", "hand", "env_states", "camera", "front", "front_depth", "object_image_points", "held", "elbow", "words"]
    rng = np.random.default_rng(0)
    for _ in range(3):
        sim.qvel[:] = rng.normal(size=sim.qvel.shape)
        sim.forward()
        sim.step(3)
        now = suite.get_observations(sim)
        assert list(now) == names
        data = sim.data
        joints = [sim.model.joint(name).qposadr[0] for name in ("arm/shoulder", "arm/elbow")]
        np.testing.assert_array_equal(now["qpos"]["arm"], sim.qpos[:, joints].astype(np.float32))
        assert now["qpos"]["none"].shape == (3, 0)
        np.testing.assert_array_equal(now["all_qvel"]["joints"], sim.qvel.astype(np.float32))
        np.testing.assert_array_equal(now["top"][:, :3], data.site_xpos[:, sim.model.site("room/top").id].astype(np.float32))
        cube = sim.model.body("room/cube").id
        for w in range(3):
            relative = np.empty(3)
            mujoco.mju_rotVecQuat(
                relative, data.site_xpos[w, sim.model.site("arm/hand").id] - data.xpos[w, cube], data.xquat[w, cube] * [1, -1, -1, -1]
            )
            np.testing.assert_allclose(now["hand"][w, :3], relative, atol=1e-6)
        fields = suite.get("env_states").fields
        assert set(fields) == {"actors/cube", "articulations/peers"} and fields["articulations/peers"].shape == (3, 4)
        np.testing.assert_array_equal(fields["actors/cube"][:, :7], sim.qpos[:, :7].astype(np.float32))
        np.testing.assert_allclose(now["camera"]["cam2world_gl"][:, :3, 3], data.cam_xpos[:, sim.model.camera("room/eye").id])
        assert now["front"].dtype == np.uint8 and now["front"].shape == (3, 32, 48, 3)
        np.testing.assert_array_equal(now["front"], sim.scene["front"].data.rgb)
        assert now["front_depth"].shape == (3, 32, 48)
        assert (suite.get("object_image_points").fields["cube/front/num_points"] > 0).all()
        assert not suite.get("held").fields["arm/held"].any()
        np.testing.assert_array_equal(now["elbow"][:, 0], sim.qpos[:, -1])
        assert now["words"] == [{"world": w} for w in range(3)]
    one = suite.get_observations(sim, None, 1)
    np.testing.assert_array_equal(one["qpos"]["arm"], now["qpos"]["arm"][1])
    assert one["words"] == {"world": 1}


def test_rows_in_an_environment_equal_the_suite():
    same = {
        "qpos": mjs.sensors.JointPositionSensor(uuid="my_qpos"),
        "qvel": mjs.sensors.JointVelocitySensor(uuid="my_qvel"),
        "tcp_pose": mjs.sensors.TcpPoseSensor(uuid="my_tcp"),
        "robot_base_pose": mjs.sensors.RobotBasePoseSensor("my_base"),
        "sensor_param_wrist_camera": mjs.sensors.CameraParameterSensor("wrist_camera", 48, 32, uuid="my_camera"),
        "wrist_camera": mjs.sensors.CameraImageSensor("wrist_camera", uuid="my_wrist"),
        "env_states": mjs.sensors.EnvStatesSensor(articulation="panda", length=31, robot="franka", uuid="my_states"),
    }
    env = mjs.make_vec(
        num_envs=2, policy="planner", cameras=["wrist_camera"], width=48, height=32, seed=2, sensors=same.values(),
        observations=[name for pair in same.items() for name in (pair[0], pair[1].uuid)],
    )  # fmt: skip
    env.reset()
    for _ in range(3):
        env.step(env.expert_action())
        for name, sensor in same.items():
            for stream, rows in env.rows.items():
                if stream == name or stream.startswith(name + "/"):
                    np.testing.assert_array_equal(env.rows[sensor.uuid + stream[len(name) :]], rows, err_msg=stream)
            sensor.data
    np.testing.assert_array_equal(same["qpos"].data["arm"], env.rows["qpos/arm"])
    env.close()


def test_in_a_recording(tmp_path):
    summary = mjs.record(
        out=tmp_path, episodes=1, horizon=3, keep_failures=True, cameras=[], seed=2,
        sensors=[mjs.sensors.PoseSensor("hand", site="robot_0/gripper/grasp_site"), mjs.sensors.GraspStateSensor("robot_0/base", uuid="touch")],
    )  # fmt: skip
    with h5py.File(next(summary.path.rglob("*.h5"))) as file:
        assert file["traj_0/obs/extra/hand"].shape == (4, 7)
        assert file["traj_0/obs/extra/touch/gripper/held"].shape == (4,)


def test_names_are_resolved_with_the_nearest():
    sim = mjs.Simulation(room(), num_worlds=1)
    for sensor, error, text in [
        (mjs.sensors.JointPositionSensor({"arm": ["arm/shulder"]}), KeyError, "sensor 'qpos': group 'arm': no joint named 'arm/shulder'; did you mean 'arm/shoulder'"),
        (mjs.sensors.PoseSensor("p", body="room/cub"), KeyError, "'p'.*did you mean 'room/cube'"),
        (mjs.sensors.CameraParameterSensor("room/ey"), KeyError, "no camera named 'room/ey'; did you mean 'room/eye'"),
        (mjs.sensors.CameraImageSensor("fromt"), KeyError, "no camera sensor named 'fromt'; did you mean 'front'"),
        (mjs.sensors.CameraImageSensor("front", "rgbb"), KeyError, "did you mean 'rgb'"),
        (mjs.sensors.TcpPoseSensor(), ValueError, "needs a robot"),
    ]:  # fmt: skip
        with pytest.raises(error, match=text):
            sim.add(sensor)
    with pytest.raises(ValueError, match="needs a body or a site"):
        mjs.sensors.PoseSensor("p")
    with pytest.raises(ValueError, match="has no uuid"):
        mjs.sensors.PoseSensor("", body="x")
    pose = mjs.sensors.PoseSensor("p", body="room/cube")
    with pytest.raises(RuntimeError, match="'p' has no data yet"):
        pose.data
    sim.add(pose)
    with pytest.raises(RuntimeError, match="'p' belongs to a simulation already"):
        sim.add(pose)
    with pytest.raises(TypeError, match="belongs to a scene"):
        mjs.Simulation(ball_scene()).add(ball_scene()["ball/acc"])

# SPDX-License-Identifier: Apache-2.0
"""Configurations written for mjlab: its own task files build with the import changed, and their values equal those of plain MuJoCo."""

import math

import mjlab_files
import mujoco
import numpy as np
import pytest
from wheels import wheel

from mjsense.compat.mjlab import sensor as ml
from mjsense.compat.mjlab._tensors import HAS_TORCH
from mjsense.compat.mjlab._tensors import tensor as ml_tensor
from mjsense.compat.mjlab.actuator import BuiltinPositionActuatorCfg
from mjsense.compat.mjlab.entity import EntityArticulationInfoCfg, EntityCfg
from mjsense.compat.mjlab.scene import Scene, SceneCfg
from mjsense.compat.mjlab.sim import Simulation, SimulationCfg
from mjsense.compat.mjlab.terrains import TerrainEntityCfg

WORLDS = 3
TASKS = {
    "go1_rough": ("tasks.velocity.config.go1.env_cfgs", "unitree_go1_rough_env_cfg", {}),
    "go1_flat": ("tasks.velocity.config.go1.env_cfgs", "unitree_go1_flat_env_cfg", {}),
    "g1_rough": ("tasks.velocity.config.g1.env_cfgs", "unitree_g1_rough_env_cfg", {}),
    "g1_flat": ("tasks.velocity.config.g1.env_cfgs", "unitree_g1_flat_env_cfg", {"play": True}),
    "yam": ("tasks.manipulation.config.yam.env_cfgs", "yam_lift_cube_env_cfg", {}),
    "yam_camera": ("tasks.manipulation.config.yam.env_cfgs", "yam_lift_cube_vision_env_cfg", {"cam_type": "rgb"}),
    "yam_masks": ("tasks.manipulation.config.yam.env_cfgs", "yam_multi_cube_seg_env_cfg", {}),
}


OBJECTS = {"geom": mujoco.mjtObj.mjOBJ_GEOM, "body": mujoco.mjtObj.mjOBJ_BODY, "subtree": mujoco.mjtObj.mjOBJ_XBODY}
BITS = {"found": 1, "force": 2, "torque": 4, "dist": 8, "pos": 16, "normal": 32, "tangent": 64}
REDUCE = {"none": 0, "mindist": 1, "maxforce": 2, "netforce": 3}


def plain_contacts(cfg):
    """Adds MuJoCo's own contact sensors, one for each primary and field, to the scene's spec; as mjlab does."""
    names = Scene(cfg)

    def add(spec):
        for sensor in cfg.sensors:
            if not isinstance(sensor, ml.ContactSensorCfg):
                continue
            one, other = sensor.primary, sensor.secondary
            entity = f"{one.entity}/" if one.entity else ""
            there = {"reftype": OBJECTS[other.mode], "refname": f"{other.entity}/{other.pattern}" if other.entity else other.pattern}
            for name in names[sensor.name].primary_names:
                for field in sensor.fields:
                    spec.add_sensor(
                        name=f"plain_{sensor.name}_{name}_{field}", type=mujoco.mjtSensor.mjSENS_CONTACT, objtype=OBJECTS[one.mode],
                        objname=entity + name, intprm=[BITS[field], REDUCE[sensor.reduce], sensor.num_slots], **there)  # fmt: skip

    return add


def array(value):
    """NumPy array that shares the memory of a tensor or an array."""
    return np.from_dlpack(value) if HAS_TORCH else value


@pytest.fixture(params=TASKS)
def worlds(request, monkeypatch):
    """(scene, simulation) of a task of mjlab's, in its start pose above the ground, and plain MuJoCo in the same states."""
    module, function, options = TASKS[request.param]
    cfg = getattr(mjlab_files.load(monkeypatch, wheel("mjlab"), module), function)(**options)
    cfg.scene.spec_fn = plain_contacts(cfg.scene)
    scene = Scene(cfg.scene, device="cpu")
    sim = Simulation(WORLDS, cfg.sim, scene.compile(), device="cpu", threads=2)
    scene.initialize(sim.mj_model, None, sim.data)
    model = sim.mj_model
    assert (model.opt.timestep, model.opt.iterations) == (cfg.sim.mujoco.timestep, cfg.sim.mujoco.iterations)
    plain = [mujoco.MjData(model) for _ in range(WORLDS)]
    qpos, ctrl = array(sim.data.qpos), array(sim.data.ctrl)
    for world, data in enumerate(plain):
        mujoco.mj_resetDataKeyframe(model, data, 0)
        rng = np.random.default_rng(world)
        if model.joint(0).type == mujoco.mjtJoint.mjJNT_FREE:
            data.qpos[:3] += array(scene.env_origins)[world]
        data.qpos[7:] += rng.uniform(-0.1, 0.1, model.nq - 7)
        data.ctrl += rng.uniform(-0.2, 0.2, model.nu)
        qpos[world], ctrl[world] = data.qpos, data.ctrl
    sim.forward()
    scene.reset()
    yield scene, sim, plain
    sim.close()


def own(model, data, name):
    sensor = model.sensor(name)
    return np.float32(data.sensordata[sensor.adr[0] : sensor.adr[0] + sensor.dim[0]])


def test_a_task_of_mjlabs(worlds):
    scene, sim, plain = worlds
    model, dt = sim.mj_model, sim.mj_model.opt.timestep
    contacts = [s for s in scene.sensors.values() if isinstance(s, ml.ContactSensor)]
    air = {s.name: np.zeros((WORLDS, len(s.primary_names)), np.float32) for s in contacts}
    forces = {s.name: [] for s in contacts}
    touched = False
    for _ in range(24):
        sim.step()
        scene.update(dt)
        for data in plain:
            mujoco.mj_step(model, data)
        np.testing.assert_array_equal(array(sim.data.qpos), [d.qpos for d in plain])
        for sensor in contacts:
            for field in sensor.cfg.fields:
                expected = [np.concatenate([own(model, d, f"plain_{sensor.name}_{p}_{field}") for p in sensor.primary_names]) for d in plain]
                actual = array(getattr(sensor.data, field))
                np.testing.assert_allclose(actual.reshape(WORLDS, -1), expected, rtol=2e-6, atol=1e-6, err_msg=f"{sensor.name} {field}")
            found = array(sensor.data.found) > 0
            touched |= bool(found.any())
            air[sensor.name] = np.where(found, 0, air[sensor.name] + np.float32(dt))
            forces[sensor.name].insert(0, np.array(array(sensor.data.force)))
            if sensor.cfg.track_air_time:
                np.testing.assert_allclose(array(sensor.data.current_air_time), air[sensor.name], atol=1e-6)
            if length := sensor.cfg.history_length:
                history = array(sensor.data.force_history)
                for age, force in enumerate(forces[sensor.name][:length]):
                    np.testing.assert_array_equal(history[:, :, age], force)
    assert touched or "robot/imu_ang_vel" not in scene.sensors
    sim.forward()
    sim.sense()
    for data in plain:
        mujoco.mj_forward(model, data)
    for name, sensor in scene.sensors.items():
        if type(sensor) is ml.BuiltinSensor and name in {s.name for s in scene.spec.sensors}:
            np.testing.assert_array_equal(array(sensor.data), [own(model, d, name) for d in plain], name)
        elif isinstance(sensor, ml.RayCastSensor):
            check_rays(sensor, model, plain)
        elif isinstance(sensor, ml.CameraSensor):
            check_camera(scene, sensor, model, plain)


def check_rays(sensor, model, plain):
    """Against mj_ray, from frames turned by their heading, as all of these tasks have them."""
    assert sensor.cfg.ray_alignment == "yaw"
    data = sensor.data
    frames = (sensor.cfg.frame,) if isinstance(sensor.cfg.frame, ml.ObjRef) else sensor.cfg.frame
    offsets = np.array(sensor.native.cfg.pattern.generate_rays()[0], float)
    assert (sensor.num_frames, sensor.num_rays_per_frame) == (len(frames), len(offsets))
    groups = np.array([group in sensor.cfg.include_geom_groups for group in range(6)], np.uint8)
    hit = np.zeros(1, np.int32)
    for world, d in enumerate(plain):
        for f, frame in enumerate(frames):
            element = d.site(frame.prefixed_name()) if frame.type == "site" else d.body(frame.prefixed_name())
            body = model.site(frame.prefixed_name()).bodyid[0] if frame.type == "site" else element.id
            place, turn = (element.xpos, element.xmat.reshape(3, 3))
            heading = math.atan2(turn[1, 0], turn[0, 0])
            c, s = math.cos(heading), math.sin(heading)
            np.testing.assert_allclose(array(data.frame_pos_w)[world, f], place, rtol=1e-6, atol=1e-6)
            heights = []
            for ray in range(len(offsets)):
                x, y, z = offsets[ray]
                start = place + (c * x - s * y, s * x + c * y, z)
                distance = mujoco.mj_ray(model, d, start, np.array([0.0, 0, -1]), groups, 1, body, hit)
                distance = distance if 0 <= distance <= sensor.cfg.max_distance else -1
                ours = array(data.distances)[world, f * len(offsets) + ray]
                assert ours == pytest.approx(distance, abs=1e-5), (sensor.name, world, frame, ray)
                inside = array(data.normals_w)[world, f * len(offsets) + ray, 2] < 0  # the ray starts inside a box and leaves it
                heights.append(0 if inside else distance)
            if isinstance(sensor, ml.TerrainHeightSensor) and min(heights) >= 0:
                assert array(data.heights)[world, f] == pytest.approx(min(heights), abs=2e-5)


def check_camera(scene, sensor, model, plain):
    data, cfg = sensor.data, sensor.cfg
    for kind, channels in (("rgb", 3), ("depth", 1), ("segmentation", 2)):
        image = getattr(data, kind)
        assert (image is not None) == (kind in cfg.data_types)
        if image is not None:
            assert tuple(image.shape) == (WORLDS, cfg.height, cfg.width, channels)
            np.testing.assert_array_equal(array(image), array(getattr(scene.sensor_context, f"get_{kind}")(sensor.camera_idx)))
    if data.depth is None:
        return
    groups = np.array([group in cfg.enabled_geom_groups for group in range(6)], np.uint8)
    hit = np.zeros(1, np.int32)
    checked = 0
    for world, d in enumerate(plain):
        camera = d.camera(sensor.camera_name)
        focal = cfg.height / 2 / math.tan(math.radians(model.cam_fovy[camera.id]) / 2)
        for row in range(0, cfg.height, 5):
            for column in range(0, cfg.width, 5):
                ray = np.array([(column + 0.5 - cfg.width / 2) / focal, -(row + 0.5 - cfg.height / 2) / focal, -1])
                depth = mujoco.mj_ray(model, d, camera.xpos, camera.xmat.reshape(3, 3) @ ray, groups, 1, -1, hit)
                if array(data.segmentation)[world, row, column, 0] == hit[0]:  # not at an edge
                    assert array(data.depth)[world, row, column, 0] == pytest.approx(max(depth, 0), abs=1e-4)
                    checked += 1
    assert checked > 100


def test_configurations_are_checked_when_the_scene_is_made():
    height = ml.TerrainHeightSensorCfg(name="height", frame=(), viz=ml.TerrainHeightSensorCfg.VizCfg(show_rays=True))
    with pytest.raises(ValueError, match="sensor 'height': frame is empty"):
        height.native()
    ref = ml.ObjRef(type="body", name="", entity="box")
    height.frame = (ref,)
    ref.name = "box"
    assert height.native().frame[0].full_name == "box/box" and height.native().viz.show_rays
    scene = Scene(SceneCfg())
    with pytest.raises(ValueError, match="device is 'cuda:0'"):
        Simulation(1, SimulationCfg(), scene.compile(), device="cuda:0", backend="cpu")
    with pytest.raises(ValueError, match=r"must be what scene\.compile"):
        Simulation(1, SimulationCfg(), mujoco.MjModel.from_xml_string("<mujoco/>"))


def box():
    spec = mujoco.MjSpec()
    body = spec.worldbody.add_body(name="box")
    body.add_freejoint(name="free")
    body.add_geom(name="geom", type=mujoco.mjtGeom.mjGEOM_BOX, size=(0.1, 0.1, 0.1), mass=2)
    return spec


def test_user_defined_scene():
    match = ml.ContactMatch("geom", "g.*", "box")
    touch = ml.ContactSensorCfg("touch", match, ml.ContactMatch("body", "terrain"), reduce="netforce")
    cfg = SceneCfg(
        num_envs=4, env_spacing=3.0, terrain=TerrainEntityCfg(), sensors=(touch,),
        entities={"box": EntityCfg(spec_fn=box, init_state=EntityCfg.InitialStateCfg(pos=(0, 0, 0.1)))})  # fmt: skip
    scene = Scene(cfg)
    assert scene["touch"].primary_names == ["geom"]
    sim = Simulation(scene.num_envs, SimulationCfg(), scene.compile())
    assert (scene.num_envs, sim.num_envs, sim.device, scene.device) == (4, 4, "cpu", "cpu")
    origins = array(scene.env_origins)
    assert origins.shape == (4, 3) and np.ptp(origins[:, 0]) == 3
    array(sim.data.qpos)[:] = sim.mj_model.key_qpos[0]
    sim.forward()
    for _ in range(100):
        sim.step()
        scene.update(sim.mj_model.opt.timestep)
    np.testing.assert_allclose(array(scene["touch"].data.force)[:, 0], np.tile([0, 0, -2 * 9.81], (4, 1)), atol=0.05)
    assert scene.entities["box"].find_geoms(".*") == ([0], ["geom"]) and not scene["box"].is_fixed_base
    sim.reset([1])
    assert array(sim.data.qpos)[1, 2] == 0 and array(sim.data.qpos)[0, 2] > 0.09
    assert scene.sensor_context is None and scene["terrain"] is scene.terrain
    with pytest.raises(KeyError, match="no sensor or entity named 'tuch'; did you mean 'touch'"):
        scene["tuch"]


def test_light_and_colours_of_the_ground_are_kept():
    class Lamp:
        def edit_spec(self, spec):
            spec.worldbody.add_light(name="lamp")

    def looks(**given):
        model = Scene(SceneCfg(terrain=TerrainEntityCfg(**given), spec_fn=lambda spec: spec.worldbody.add_site(name="mark"))).compile()
        assert model.site("mark").id >= 0
        return model.nlight, model.ntex, model.nmat

    assert looks() == (1, 2, 1)  # a sun, a sky and squares
    assert looks(lights=(Lamp(),)) == (1, 0, 0)
    assert looks(lights=(), textures=(), materials=()) == (0, 0, 0)


@pytest.mark.skipif(not HAS_TORCH, reason="no torch")
def test_tensors_share_memory():
    import torch

    scene = Scene(SceneCfg(num_envs=2, entities={"box": EntityCfg(spec_fn=box)}, sensors=(
        ml.BuiltinSensorCfg("place", "framepos", ml.ObjRef("body", "box", "box")),)))  # fmt: skip
    sim = Simulation(2, SimulationCfg(), scene.compile())
    place = scene["box/place"].data
    assert isinstance(place, torch.Tensor) and place is scene["box/place"].data
    sim.data.qpos[:, 0] = torch.tensor([1.0, 2.0])
    sim.forward()
    assert scene["box/place"].data is place and place[:, 0].tolist() == [1, 2]
    sim.reset(torch.tensor([0]))
    assert scene["box/place"].data[:, 0].tolist() == [0, 2]


ARM = """<mujoco><worldbody><body name="base" pos="0 0 1"><freejoint name="root"/><geom size=".1 .2 .05" type="box" pos=".03 0 .01"/>
<body name="link" pos=".2 0 0"><joint name="hinge" axis="0 1 0"/><joint name="slide" type="slide" axis="1 0 0"/>
<geom type="capsule" size=".02" fromto="0 0 0 .3 0 0"/></body></body></worldbody>
<actuator><motor name="motor" joint="hinge"/></actuator></mujoco>"""


def two_entities():
    """A scene with an arm that comes after another entity, so that its places in qpos and qvel are not the first ones."""
    from_string = mujoco.MjSpec.from_string
    scene = Scene(SceneCfg(num_envs=WORLDS, entities={name: EntityCfg(spec_fn=lambda: from_string(ARM)) for name in ("first", "arm")}))
    return scene, Simulation(WORLDS, SimulationCfg(), scene.compile())


def test_the_initial_keyframe_commands_its_joint_positions():
    joints = """<mujoco><worldbody><body><joint name="a" axis="0 1 0"/><geom size=".1"/>
        <body><joint name="b"/><joint name="c" axis="1 0 0"/><geom size=".1"/></body></body></worldbody></mujoco>"""
    actuators = BuiltinPositionActuatorCfg(target_names_expr=("[bc]",), stiffness=1.0, damping=0.1)
    cfg = EntityCfg(spec_fn=lambda: mujoco.MjSpec.from_string(joints), articulation=EntityArticulationInfoCfg(actuators=(actuators,)),
                    init_state=EntityCfg.InitialStateCfg(joint_pos={"a": 0.1, "b": 0.2, "c": 0.3}))  # fmt: skip
    key = Scene(SceneCfg(num_envs=1, entities={"arm": cfg})).compile().key(0)
    np.testing.assert_array_equal(key.qpos, [0.1, 0.2, 0.3])
    np.testing.assert_array_equal(key.ctrl, [0.2, 0.3])


def like_tensor(values):
    return ml_tensor(np.ascontiguousarray(values, np.float32))


def test_entities_are_written_and_read_as_in_mjlab():
    """The state, in the frames that mjlab defines, against mj_objectVelocity of plain MuJoCo."""
    scene, sim = two_entities()
    arm, rng = scene["arm"], np.random.default_rng(0)
    before = array(sim.data.qpos).copy()
    state = rng.normal(size=(2, 13))
    state[:, 3:7] /= np.linalg.norm(state[:, 3:7], axis=1)[:, None]
    joints, speeds = rng.uniform(-1, 1, (2, 2)), rng.uniform(-1, 1, (2, 2))
    worlds = [0, 2]
    model = mujoco.MjModel.from_xml_string(scene.native.to_xml())
    plain = mujoco.MjData(model)
    body, found = model.body("arm/base").id, np.zeros(6)

    def velocity(world, kind, local):
        plain.qpos[:], plain.qvel[:] = array(sim.data.qpos)[world], array(sim.data.qvel)[world]
        mujoco.mj_forward(model, plain)
        mujoco.mj_objectVelocity(model, plain, kind, body, found, local)
        return np.concatenate([found[3:], found[:3]])

    origin, mass = mujoco.mjtObj.mjOBJ_XBODY, mujoco.mjtObj.mjOBJ_BODY
    arm.write_root_state_to_sim(like_tensor(state), like_tensor(worlds).long() if HAS_TORCH else np.array(worlds))
    arm.write_joint_state_to_sim(like_tensor(joints), like_tensor(speeds), env_ids=worlds)
    arm.write_ctrl_to_sim(like_tensor([[0.5]]), env_ids=[1])
    sim.forward()
    np.testing.assert_array_equal(array(sim.data.ctrl), [[0, 0], [0, 0.5], [0, 0]])
    np.testing.assert_array_equal(array(sim.data.qpos)[1], before[1])
    np.testing.assert_array_equal(array(sim.data.qpos)[:, :9], before[:, :9])  # the other entity
    np.testing.assert_allclose(array(arm.data.root_link_pose_w)[worlds], state[:, :7], atol=1e-6)
    np.testing.assert_allclose(array(arm.data.root_link_vel_w)[worlds], state[:, 7:], atol=1e-6)
    np.testing.assert_allclose(array(arm.data.joint_pos)[worlds], joints, atol=1e-6)
    np.testing.assert_allclose(array(arm.data.joint_vel)[worlds], speeds, atol=1e-6)
    for world, wanted in zip(worlds, state[:, 7:], strict=True):
        np.testing.assert_allclose(velocity(world, origin, 0), wanted, atol=1e-6)
        in_body = np.concatenate([array(v)[world] for v in (arm.data.root_link_lin_vel_b, arm.data.root_link_ang_vel_b)])
        np.testing.assert_allclose(in_body, velocity(world, origin, 1), atol=1e-6)
        down = plain.xmat[body].reshape(3, 3).T @ [0, 0, -1]
        np.testing.assert_allclose(array(arm.data.projected_gravity_b)[world], down, atol=1e-9)
        np.testing.assert_allclose(array(arm.data.body_link_pos_w)[world, 1], plain.body("arm/link").xpos, atol=1e-9)
    given = rng.normal(size=(WORLDS, 6))
    arm.write_root_com_velocity_to_sim(like_tensor(given))
    for world in range(WORLDS):
        np.testing.assert_allclose(velocity(world, mass, 0), given[world], atol=1e-6)
    arm.write_root_link_velocity_b_to_sim(like_tensor(given))
    np.testing.assert_allclose(velocity(1, origin, 1), given[1], atol=1e-6)
    with pytest.raises(ValueError, match="root_state has 7 columns, not 13"):
        arm.write_root_state_to_sim(like_tensor(state[:, :7]))
    with pytest.raises(ValueError, match="entity 'arm': 3 numbers of qpos for each world, and it has 2"):
        arm.write_joint_position_to_sim(like_tensor(np.zeros((WORLDS, 3))))
    with pytest.raises(AttributeError, match=r"Entity\.data of mjsense\.compat\.mjlab has no 'heading_w'"):
        _ = arm.data.heading_w


HAND = """<mujoco><worldbody><body name="base" pos="0 0 .1"><geom size=".1"/>
<body name="arm" pos=".2 0 0"><joint name="ball" type="ball"/><geom type="capsule" size=".02" fromto="0 0 0 .3 0 0"/>
<body name="tip" pos=".3 0 0"><joint name="hinge" axis="0 1 0"/><joint name="slide" type="slide" axis="1 0 0"/>
<joint name="turn" axis="0 0 1"/><geom size=".03"/><site name="end"/></body></body></body></worldbody>
<tendon><fixed name="both"><joint joint="hinge" coef="1"/><joint joint="slide" coef="-1"/></fixed></tendon>
<actuator><position name="servo" joint="hinge" kp="20" kv="1"/><velocity name="speed" joint="slide" kv="3"/><motor name="motor" joint="turn"/>
<position name="length" tendon="both" kp="5"/><motor name="thrust" site="end" gear="0 0 1 0 0 0"/></actuator></mujoco>"""


def test_wrenches_mocap_poses_and_targets_are_written_as_in_mjlab():
    scene = Scene(SceneCfg(num_envs=WORLDS, entities={
        "arm": EntityCfg(spec_fn=lambda: mujoco.MjSpec.from_string(ARM)),
        "hand": EntityCfg(spec_fn=lambda: mujoco.MjSpec.from_string(HAND))}))  # fmt: skip
    sim = Simulation(WORLDS, SimulationCfg(), scene.compile())
    arm, hand, rng = scene["arm"], scene["hand"], np.random.default_rng(0)
    model = mujoco.MjModel.from_xml_string(scene.native.to_xml())
    plain = mujoco.MjData(model)
    of = [model.body(f"hand/{name}").id for name in hand.body_names]
    assert hand.body_names == ("mocap_base", "base", "arm", "tip")

    # Wrenches.
    forces, torques = rng.normal(size=(2, 2, WORLDS, 4, 3))[:, 0]
    hand.write_external_wrench_to_sim(like_tensor(forces), like_tensor(torques))
    hand.write_external_wrench_to_sim(like_tensor(2 * forces[:2, 3:]), None, env_ids=[2, 0], body_ids=[3])
    forces[[2, 0], 3] = 2 * forces[:2, 3]
    sim.forward()
    np.testing.assert_allclose(array(sim.data.xfrc_applied)[:, of], np.concatenate([forces, torques], -1), rtol=1e-6)
    for world in range(WORLDS):
        plain.xfrc_applied[of] = np.concatenate([forces, torques], -1)[world]
        plain.qpos[:], plain.mocap_pos[:], plain.mocap_quat[:] = (array(getattr(sim.data, name))[world] for name in ("qpos", "mocap_pos", "mocap_quat"))
        mujoco.mj_forward(model, plain)
        np.testing.assert_allclose(array(sim.data.qacc)[world], plain.qacc, rtol=1e-5, atol=1e-5)
    with pytest.raises(ValueError, match=r"entity 'hand': a wrench of the shape \(3, 2, 3\) is for 4 bodies"):
        hand.write_external_wrench_to_sim(like_tensor(forces[:, :2]), None)

    # The pose of an entity without a free joint.
    pose = np.array([[1, 2, 3, 0, 0, 0, 1.0], [0, 0, 1, 1, 0, 0, 0]])
    hand.write_mocap_pose_to_sim(like_tensor(pose), env_ids=[0, 2])
    sim.forward()
    base = model.body("hand/base").id
    np.testing.assert_allclose(array(sim.data.xpos)[:, base], [[1, 2, 3.1], [0, 0, 0.1], [0, 0, 1.1]], atol=1e-6)
    np.testing.assert_allclose(array(sim.data.xquat)[0, base], [0, 0, 0, 1], atol=1e-6)
    with pytest.raises(ValueError, match="entity 'arm' has no mocap body as its root"):
        arm.write_mocap_pose_to_sim(like_tensor(pose[:1]))
    with pytest.raises(ValueError, match="6 numbers of a mocap pose, not 7"):
        hand.write_mocap_pose_to_sim(like_tensor(pose[:, :6]))

    # Targets: the names of the joints are ball, hinge, slide and turn.
    hand.set_joint_position_target(like_tensor(np.full((WORLDS, 4), 0.25)))
    hand.set_joint_velocity_target(like_tensor([[0.5]]), joint_ids=[2], env_ids=[1])
    hand.set_joint_effort_target(like_tensor([[7.0, 8.0]]), joint_ids=[1, 3], env_ids=[0])
    hand.set_tendon_len_target(like_tensor([[0.1], [0.2], [0.3]]))
    hand.set_site_effort_target(like_tensor([[3.0]]), env_ids=[2])
    arm.set_joint_effort_target(like_tensor([[-1.0, 9.0]]), env_ids=[1])
    assert not array(sim.data.ctrl).any()
    scene.write_data_to_sim()
    wanted = [[0, 0.25, 0, 8, 0.1, 0], [-1, 0.25, 0.5, 0, 0.2, 0], [0, 0.25, 0, 0, 0.3, 3]]
    np.testing.assert_allclose(array(sim.data.ctrl), wanted, rtol=1e-6)
    assert array(hand.data.joint_pos_target).shape == (WORLDS, 4)
    with pytest.raises(ValueError, match="entity 'hand': 3 numbers of joint_vel_target for 4 elements"):
        hand.set_joint_velocity_target(like_tensor(np.zeros((WORLDS, 3))))
    scene.reset([1])
    scene.write_data_to_sim()
    np.testing.assert_allclose(array(sim.data.ctrl), [wanted[0], [0] * 6, wanted[2]], rtol=1e-6)

    # A ball joint has four numbers in qpos and three in qvel.
    position = rng.normal(size=(WORLDS, 7))
    position[:, :4] /= np.linalg.norm(position[:, :4], axis=1)[:, None]
    speed = rng.normal(size=(WORLDS, 6))
    hand.write_joint_state_to_sim(like_tensor(position), like_tensor(speed))
    np.testing.assert_allclose(array(sim.data.qpos)[:, -7:], position, rtol=1e-6)
    np.testing.assert_allclose(array(hand.data.joint_vel), speed, rtol=1e-6)


def test_velocities_of_an_entity_with_two_trees_of_bodies():
    text = ARM.replace("</worldbody>", "<body name='lever' pos='0 2 0'><joint name='lever' axis='1 0 0'/><geom size='.1' pos='0 .4 0'/></body></worldbody>")
    scene = Scene(SceneCfg(num_envs=1, entities={"arm": EntityCfg(spec_fn=lambda: mujoco.MjSpec.from_string(text))}))
    sim = Simulation(1, SimulationCfg(), scene.compile())
    model = mujoco.MjModel.from_xml_string(scene.native.to_xml())
    plain, found = mujoco.MjData(model), np.zeros(6)
    plain.qvel[:] = np.random.default_rng(0).normal(size=model.nv)
    mujoco.mj_forward(model, plain)
    sim.data.qvel[:] = like_tensor(plain.qvel[None])
    sim.forward()
    for i, name in enumerate(("base", "link", "lever")):
        mujoco.mj_objectVelocity(model, plain, mujoco.mjtObj.mjOBJ_XBODY, model.body(f"arm/{name}").id, found, 0)
        np.testing.assert_allclose(array(scene["arm"].data.body_link_vel_w)[0, i], [*found[3:], *found[:3]], atol=1e-5)


def test_expanded_fields_of_the_model_are_applied_by_forward():
    _, sim = two_entities()
    mass = sim.mj_model.body_mass.copy()
    sim.expand_model_fields(("body_mass",))
    sim.model.body_mass[1] *= 2
    sim.forward()
    np.testing.assert_array_equal(sim.native.model_field("body_mass"), [mass, 2 * mass, mass])
    assert sim.model.nbody == len(mass)


@pytest.mark.parametrize(("kind", "obj", "text"), (
    ("gyro", None, "requires obj with type='site'"), ("gyro", "body", "requires obj.type='site', not 'body'"),
    ("jointpos", "site", "requires obj.type='joint', not 'site'"), ("framepos", "joint", "requires obj.type=one of"),
))  # fmt: skip
def test_built_in_sensors_are_checked_when_they_are_written(kind, obj, text):
    with pytest.raises(ValueError, match=f"sensor 's': the type '{kind}' {text}"):
        ml.BuiltinSensorCfg("s", kind, None if obj is None else ml.ObjRef(obj, "name"))
    with pytest.raises(ValueError, match="'subtreecom' does not support ref specification"):
        ml.BuiltinSensorCfg("s", "subtreecom", ml.ObjRef("body", "a"), ml.ObjRef("body", "b"))

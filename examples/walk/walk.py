# SPDX-License-Identifier: Apache-2.0
"""The task of train.py: a quadruped follows a commanded velocity over rough ground, and feels it with its feet and a height
scan."""

import gymnasium
import mujoco
import numpy as np

import mjsense as mjs

STAND = {".*_hip_joint": 0.0, ".*_thigh_joint": 0.9, ".*_calf_joint": -1.8}


class Walk(mjs.Task):
    """Walk with the commanded velocity."""

    horizon = 500  # 10 s
    policy_dt_ms = 20
    sim_dt_ms = 5
    robot_entity = "robot"

    def __init__(self, model="embedded:robots/quadruped.xml", rough=True):
        """`model`: of a quadruped with a Unitree Go1's names; servos are added where it has none. `rough`: waves and bumps, else
        a plane."""
        self.model, self.rough = model, rough

    def with_servos(self):
        """Unitree's Go1 comes without motors, and without what they do to its joints: legs without inertia of a rotor tremble at
        every command."""
        spec = mujoco.MjSpec.from_file(str(self.model))
        for joint in [j for j in spec.joints if j.type == mujoco.mjtJoint.mjJNT_HINGE]:
            joint.armature, joint.damping[0], joint.frictionloss = 0.01, 0.5, 0.2
            torque = 35.55 if "calf" in joint.name else 23.7
            motor = spec.add_actuator(name=joint.name, target=joint.name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
            motor.set_to_position(kp=60, kv=1.5)
            motor.ctrlrange, motor.forcerange = joint.range, (-torque, torque)
        return spec

    def scene(self):
        ours = str(self.model).startswith("embedded:")
        robot = mjs.EntityCfg(model=self.model if ours else self.with_servos, pos=(0, 0, 0.3), joint_pos=STAND)
        tiles = {
            "flat": mjs.SubTerrainCfg(kind="flat", proportion=0.3),
            "rough": mjs.SubTerrainCfg(kind="rough", amplitude=(0.0, 0.03), proportion=0.4),
            "waves": mjs.SubTerrainCfg(kind="waves", amplitude=(0.0, 0.06), proportion=0.3),
        }
        ground = (
            mjs.TerrainCfg(terrain_type="generator", sub_terrains=tiles, levels=4, types=6) if self.rough else mjs.TerrainCfg()
        )
        imu = mjs.ObjRef(type="site", name="imu", entity="robot")
        return mjs.SceneCfg(
            terrain=ground,
            spec_fn=self.hide_from_scan,
            entities={"robot": robot},
            options=mjs.MujocoCfg(iterations=10, ls_iterations=20),
            sensors=(
                mjs.BuiltinSensorCfg(name="turn", sensor_type="gyro", obj=imu),
                mjs.BuiltinSensorCfg(name="speed", sensor_type="velocimeter", obj=imu),
                mjs.ContactSensorCfg(
                    name="feet",
                    primary=mjs.ContactMatch(mode="geom", pattern=".*_foot(_collision)?", entity="robot"),
                    track_air_time=True,
                    secondary=mjs.ContactMatch(mode="body", pattern="terrain"),
                ),
                mjs.RayCastSensorCfg(
                    name="scan",
                    frame=mjs.ObjRef(type="body", name="trunk", entity="robot"),
                    ray_alignment="yaw",
                    max_distance=2,
                    pattern=mjs.GridPatternCfg(size=(1.6, 1.0), resolution=0.1),
                    include_geom_groups=(0,),
                ),
            ),
        )

    def hide_from_scan(self, spec):
        """Group 2 for the robot: cameras see it, the scan does not."""
        for body in spec.bodies:
            for geom in body.geoms if body.name.startswith("robot/") else ():
                geom.group = 2

    def initialize(self, sim):
        self.stand = np.array(sim.model.key_qpos[0, 7:])
        self.places = sim.scene.env_origins(sim.num_worlds)
        self.command = np.zeros((sim.num_worlds, 3))
        self.before = np.tile(self.stand, (sim.num_worlds, 1))

    def sample(self, rng, world):
        turn = rng.uniform(-np.pi, np.pi)
        world.qpos[:3] += self.places[world.id]
        world.qpos[3:7] = np.cos(turn / 2), 0, 0, np.sin(turn / 2)
        world.qpos[7:] += rng.uniform(-0.05, 0.05, 12)
        world.ctrl[:] = self.stand
        # Forwards, left, turn: m/s, rad/s.
        self.command[world.id] = (
            rng.uniform(0.3, 0.8),
            rng.uniform(-0.2, 0.2),
            rng.uniform(-0.5, 0.5),
        )

    def begin(self, ids):
        self.before[ids] = self.stand

    def up(self, sim):
        """The world's up in the trunk, ``[B, 3]``."""
        w, x, y, z = sim.qpos[:, 3:7].T
        return np.stack([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)], 1)

    def evaluate(self, sim):
        sensors, up = sim.scene, self.up(sim)
        speed, turn = sensors["robot/speed"].data, sensors["robot/turn"].data
        error = np.square(self.command[:, :2] - speed[:, :2]).sum(1), np.square(self.command[:, 2] - turn[:, 2])
        steps = sensors["feet"].compute_first_contact(0.02)
        air = (np.minimum(sensors["feet"].data.last_air_time - 0.15, 0.15) * steps).sum(1)
        good = 1.5 * np.exp(-error[0] / 0.25) + 0.75 * np.exp(-error[1] / 0.25) + 5 * air
        bad = (
            1.0 * np.square(speed[:, 2])
            + 2.0 * np.square(up[:, :2]).sum(1)
            + 0.02 * np.square(turn[:, :2]).sum(1)
            + 0.03 * np.square(sim.ctrl - self.before).sum(1)
            + 0.02 * np.square(sim.qpos[:, 7:] - self.stand).sum(1)
        )
        reward = 0.02 * np.maximum(good - bad, 0)  # never below 0: to fall must not be a way out
        self.before[:] = sim.ctrl
        fallen = (up[:, 2] < 0.5) | (sim.qpos[:, 2] - self.places[:, 2] < -1)
        return {
            "reward": reward,
            "success": (error[0] < 0.04) & ~fallen,
            "terminated": fallen,
            "info": {"error": np.sqrt(error[0])},
        }

    def sensors(self):
        return [Feeling(self)]


class Feeling(mjs.Sensor):
    """Observation of the policy: velocities, commanded velocity, joints, feet in contact, terrain heights around the robot."""

    uuid = "feeling"
    observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (3 + 3 + 3 + 3 + 3 * 12 + 4 + 187,), np.float32)

    def __init__(self, task):
        super().__init__()
        self.task = task

    def compute(self, sim):
        scene, task = sim.scene, self.task
        scan = scene["scan"].data.distances
        return np.concatenate(
            [
                scene["robot/speed"].data,
                0.25 * scene["robot/turn"].data,
                task.up(sim),
                task.command,
                sim.qpos[:, 7:] - task.stand,
                0.05 * sim.qvel[:, 6:],
                sim.ctrl - task.stand,
                scene["feet"].data.found > 0,
                5 * (np.where(scan < 0, 0.5, scan) - 0.3),
            ],
            axis=1,
            dtype=np.float32,
        )

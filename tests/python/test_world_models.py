# SPDX-License-Identifier: Apache-2.0
"""The model of one world: plain MuJoCo computes with it what the world contains."""

import copy

import mujoco
import numpy as np
import pytest

import mjsense as mjs

ROOM = """
<mujoco>
  <worldbody>
    <geom name="floor" type="plane" size="5 5 .1"/>
    <geom name="shelf" type="box" size=".3 .1 .2" pos="1 0 .2"/>
    <light name="lamp" pos="0 0 3"/>
    <body name="box" pos="0 0 .05"><freejoint/><geom name="box" type="box" size=".05 .05 .05"/></body>
    <body name="ball" pos="0 .13 .05"><freejoint/><geom name="ball" size=".05"/></body>
    <body name="eye" pos="0 0 2"><site name="eye"/><geom size=".01" contype="0" conaffinity="0"/></body>
  </worldbody>
</mujoco>
"""
RAYS = mjs.RayCastSensorCfg(
    name="rays",
    frame=mjs.ObjRef("site", "eye"),
    pattern=mjs.GridPatternCfg(size=(2.4, 1.0), resolution=0.1, direction=(0.1, 0.2, -1)),
)


def contacts(data):
    return sorted((int(c.geom1), int(c.geom2), round(float(c.dist), 9)) for c in data.contact[: data.ncon])


class Peer:
    """Written for MolmoSpaces: a distance and the contacts by plain MuJoCo, on the model and data that it is given."""

    def __init__(self):
        self.uuid = "peer"
        self.observation_space = None
        self.models = {}

    def measure(self, env, world):
        model, data = env.current_model, env.mj_datas[world]
        self.models.setdefault(world, model)
        own = mujoco.MjData(model)
        own.qpos[:] = data.qpos
        mujoco.mj_forward(model, own)
        return own.ncon, mujoco.mj_ray(
            model, data, np.array([0, 0, 1.9]), np.array([0, 0, -1.0]), None, 1, -1, np.zeros(1, np.int32)
        )


@pytest.fixture
def sim():
    sim = mjs.Simulation(mjs.Scene(mjs.SceneCfg(base=ROOM, sensors=(RAYS,))), num_worlds=3)
    sizes = np.repeat(sim.model.geom_size[None], 3, 0)
    sizes[1, 2] = 0.09, 0.09, 0.09  # touches the ball
    sizes[2, 1] = 0.4, 0.2, 0.3
    sim.randomize("geom_size", sizes)
    places = np.repeat(sim.model.geom_pos[None], 3, 0)
    places[2, 1] = 0.8, 0.1, 0.3
    sim.randomize("geom_pos", places)
    sim.randomize("light_pos", np.array([[[0, 0, 3]], [[1, 0, 3]], [[0, 1, 2]]]))
    return sim


def test_plain_rays_equal_the_sensors(sim):
    env = sim.env
    distances = sim.scene["rays"].data.distances
    hits = sim.scene["rays"].data.hit_pos_w
    direction = np.array([0.1, 0.2, -1]) / np.linalg.norm([0.1, 0.2, -1])
    different = set()
    for world in range(3):
        model, data = env.mj_models[world], env.mj_datas[world]
        eye = model.body("eye").id
        for distance, hit in zip(distances[world], hits[world], strict=True):
            origin = hit - distance * direction
            geom = np.zeros(1, np.int32)
            found = mujoco.mj_ray(model, data, origin.astype(float), direction, None, 1, eye, geom)
            assert found == pytest.approx(distance, abs=2e-6)
        different.add(distances[world].tobytes())
    assert len(different) == 3


def test_contacts_and_lights(sim):
    counts = []
    for world, model in enumerate(sim.env.mj_models):
        data = mujoco.MjData(model)
        mujoco.mj_setState(model, data, sim.state[world], mujoco.mjtState.mjSTATE_INTEGRATION)
        mujoco.mj_forward(model, data)
        assert contacts(data) == contacts(sim.env.mj_datas[world])
        np.testing.assert_array_equal(data.light_xpos, sim.data.light_xpos[world])
        counts.append(data.ncon)
    assert counts[1] > counts[0]


def test_copies_stay_synchronised(sim):
    models = [sim.model_of(world) for world in range(3)]
    assert sim.env.mj_models[1] is models[1] and len(sim.env.mj_models) == 3
    assert sim.env.mj_models[-1] is models[2] and sim.env.mj_models[:2] == models[:2]
    assert models[1].geom_size[2, 0] == 0.09 and sim.model.geom_size[2, 0] == models[0].geom_size[2, 0] == 0.05
    sim.randomize("body_mass", np.full(sim.model.nbody, 3.0), world_ids=[1])
    assert models[1].body_mass[2] == 3 and models[0].body_mass[2] != 3
    sim.model_field("geom_rgba")[2, 1] = 0.25
    assert sim.model_of(2) is models[2] and models[2].geom_rgba[1, 0] == 0.25
    sim.reset()
    assert models[1].geom_size[2, 0] == 0.09
    models[0].geom_size[2, 0] = 9  # changes no simulation
    assert sim.model_field("geom_size")[0, 2, 0] == 0.05
    with pytest.raises(ValueError, match=r"world id 3: must be in \[0, 3\)"):
        sim.model_of(3)
    with pytest.raises(IndexError):
        sim.env.mj_models[3]


def test_peer_sensors_receive_the_model_of_their_world(sim):
    peer = Peer()
    found = []
    for world in range(3):
        sim.env.current_batch_index = world
        assert sim.env.mj_model is sim.env.current_model is sim.model_of(world)
        found.append(peer.measure(sim.env, world))
    assert [count for count, _ in found] == [sim.env.mj_datas[world].ncon for world in range(3)]
    np.testing.assert_allclose([distance for _, distance in found], [1.8, 1.76, 1.8])


@pytest.mark.parametrize("task", ["pick", "open"])
def test_model_of_an_episode_is_the_simulated_one(task):
    """Sizes, furniture and lights of a task's worlds, midphase on: plain MuJoCo finds the world's contacts and poses."""
    env = mjs.make_vec(task, num_envs=3, cameras=[], seed=5, policy="planner")
    sim = env.sim
    held = [sim.model_of(world) for world in range(3)]
    seen, touching = set(), 0
    for seed in (5, 6):
        env.reset(seed=seed)
        for _ in range(5):
            env.step(env.expert_action())
        for world in range(3):
            model = sim.env.mj_models[world]
            assert model is held[world]
            data = mujoco.MjData(model)
            mujoco.mj_setState(model, data, sim.state[world], mujoco.mjtState.mjSTATE_INTEGRATION)
            mujoco.mj_forward(model, data)
            shown = sim.env.mj_datas[world]
            assert contacts(data) == contacts(shown)
            np.testing.assert_array_equal(data.geom_xpos, shown.geom_xpos)
            touching += data.ncon
            seen.add((model.geom_size.tobytes(), model.body_pos.tobytes(), model.light_diffuse.tobytes()))
    assert touching and len(seen) == 6
    env.close()


def test_simulated_model_bounds_every_size():
    """Collisions are looked for in boxes that hold an object in all of its sizes. They are in sim.model, too: with a world's fields
    plain MuJoCo finds the same contacts as without those boxes."""
    env = mjs.make_vec("pick", num_envs=2, cameras=[], seed=5, policy="planner")
    env.reset()
    for _ in range(6):
        env.step(env.expert_action())
    sim = env.sim
    for world in range(2):
        model, own = copy.copy(sim.model), sim.model_of(world)
        for field in dir(model):
            value = getattr(own, field)
            if isinstance(value, np.ndarray) and value.size and not np.array_equal(value, getattr(model, field)):
                getattr(model, field)[...] = value
        found = []
        for flags in (0, int(mujoco.mjtDisableBit.mjDSBL_MIDPHASE)):
            model.opt.disableflags |= flags
            data = mujoco.MjData(model)
            mujoco.mj_setState(model, data, sim.state[world], mujoco.mjtState.mjSTATE_INTEGRATION)
            mujoco.mj_forward(model, data)
            found.append(contacts(data))
        assert found[0] == found[1] == contacts(sim.env.mj_datas[world]) != []
    assert np.abs(sim.model.bvh_aabb - sim.scene.model.bvh_aabb).max() > 1e-3
    env.close()


def test_another_mesh_has_its_own_contacts():
    cube, wedge = "-1 -1 -1 1 -1 -1 -1 1 -1 1 1 -1 -1 -1 1 1 -1 1 -1 1 1 1 1 1", "0 0 0 1 0 0 0 1 0 0 0 1.2 .5 .6 1"
    xml = f"""<mujoco><asset><mesh name="small" vertex="{cube}" scale=".1 .1 .1"/><mesh name="large" vertex="{cube}" scale=".5 .5 .5"/>
      <mesh name="wedge" vertex="{wedge}"/></asset><worldbody><body name="box" pos="0 0 1"><freejoint/><geom name="box" type="mesh" mesh="{{}}"/></body>
      <geom name="target" type="sphere" size=".1" pos=".55 0 1"/></worldbody></mujoco>"""
    sim, model = mjs.Simulation(mjs.Scene(mjs.SceneCfg(base=xml.format("small"))), 3), mujoco.MjModel.from_xml_string(xml.format("large"))
    ids = sim.model.geom_dataid.copy()
    ids[sim.model.geom("box").id] = 1
    sim.randomize("geom_dataid", ids, [1])
    sim.randomize("body_gravcomp", 1.0)  # keeps what the meshes have
    assert [data.ncon > 0 for data in sim.env.mj_datas] == [False, True, False]
    for field in ("geom_aabb", "geom_rbound", "geom_size"):
        np.testing.assert_allclose(sim.model_field(field)[1], getattr(model, field), rtol=1e-6, atol=1e-7)
        np.testing.assert_array_equal(sim.model_field(field)[2], getattr(sim.model, field))
    ids[sim.model.geom("box").id] = 2
    sim.randomize("geom_dataid", ids, [0])
    wedge = mujoco.MjModel.from_xml_string(xml.format("wedge"))
    np.testing.assert_allclose(sim.model_field("geom_aabb")[0], wedge.geom_aabb, rtol=1e-6, atol=1e-7)
    np.testing.assert_allclose(sim.model_field("geom_rbound")[0], wedge.geom_rbound, rtol=1e-6)

# SPDX-License-Identifier: Apache-2.0
"""Worlds that are stepped from the arrays of another program, as those of mujoco_warp are."""

import os
import threading

import mujoco
import numpy as np
import pytest

from mjsense import _core

WORLDS = 5
STEP, FORWARD, STEP1, STEP2, RESET = range(5)
XML = """
<mujoco><option timestep=".004" integrator="implicitfast"/><worldbody>
  <geom name="floor" type="plane" size="0 0 1"/>
  <body name="box" pos="0 0 .3"><freejoint/><geom name="box" type="box" size=".1 .1 .1"/>
    <body pos=".1 0 .1"><joint name="hinge" axis="0 1 0" damping=".1"/>
      <geom type="capsule" fromto="0 0 0 .3 0 0" size=".03" contype="0" conaffinity="0"/><site name="tip" pos=".3 0 0"/></body></body>
  </worldbody><actuator><motor joint="hinge"/></actuator><sensor><accelerometer site="tip"/><jointpos joint="hinge"/></sensor></mujoco>"""
STATE = ("qpos", "qvel", "ctrl", "qfrc_applied", "xfrc_applied", "qacc_warmstart", "time")
DERIVED = ("xpos", "xmat", "sensordata", "qacc", "cvel")


class Program:
    """The arrays of a program."""

    def __init__(self, threads=1, contacts=20 * WORLDS, constraints=100):
        self.model = mujoco.MjModel.from_xml_string(XML)
        self.worlds = _core.ForeignArrays(self.model._address, WORLDS, threads)
        self.worlds.clear(contacts, constraints)
        self.kept = []  # the worlds use the memory of arrays
        start = mujoco.MjData(self.model)
        for name in (*STATE, *DERIVED):
            array = np.tile(np.ravel(getattr(start, name)).astype(np.float32), (WORLDS, 1))
            setattr(self, name, array)
            assert self.add("data", name, array, name in STATE)
        self.efc_force = np.zeros((WORLDS, constraints), np.float32)
        self.efc_id = np.zeros((WORLDS, constraints), np.int32)
        self.nefc = np.zeros((WORLDS, 1), np.int32)
        for name in ("efc_id", "efc_force"):
            assert not constraints or self.add("data", name, getattr(self, name))
        assert self.add("data", "nefc", self.nefc)
        floats, ints = {"dist": 1, "pos": 3, "frame": 9, "friction": 5}, {"geom": 2, "dim": 1, "worldid": 1, "geomcollisionid": 1}
        self.contact = {name: np.zeros((contacts, n), np.float32) for name, n in floats.items()}
        self.contact |= {name: np.zeros((contacts, n), np.int32) for name, n in {**ints, "efc_address": 10}.items()}
        self.count = np.zeros((1, 1), np.int32)
        for name, array in {**self.contact, "count": self.count}.items():
            assert not array.size or self.add("contact", name, array)

    def add(self, kind, name, array, state=False):
        return self.worlds.add(kind, name, array.ctypes.data, array.dtype.name, *array.shape, state)

    def plain(self):
        """Plain MuJoCo's data in the states of the arrays, by world."""
        datas = [mujoco.MjData(self.model) for _ in range(WORLDS)]
        for world, data in enumerate(datas):
            for name in STATE:
                value = getattr(self, name)[world]
                setattr(data, name, value[0] if name == "time" else value.reshape(np.shape(getattr(data, name))))
        return datas

    def run_both(self, datas, call=STEP):
        """The same call of the worlds and of plain MuJoCo."""
        self.worlds.run(call)
        for data in datas:
            (mujoco.mj_forward if call == FORWARD else mujoco.mj_step)(self.model, data)

    def add_model(self, name, rows=WORLDS):
        """A field of the model with this number of rows, which the worlds use from now on."""
        array = np.tile(np.ravel(getattr(self.model, name)).astype(np.float32), (rows, 1))
        assert self.add("model", name, array)
        self.kept.append(array)
        return array

    def throw(self):
        """Writes a state for each world."""
        rng = np.random.default_rng(0)
        self.qpos[:, 2] += rng.uniform(-0.25, 0.1, WORLDS)
        self.qvel[:] = rng.normal(0, 0.5, self.qvel.shape)
        self.ctrl[:] = rng.normal(0, 0.1, self.ctrl.shape)

    def worldids(self):
        """The worlds of the contacts."""
        return self.contact["worldid"][: self.count[0, 0], 0].tolist()

    def expect_ids(self):
        """The constraints name the rows of their contacts."""
        for row, world in enumerate(self.worldids()):
            rows = self.contact["efc_address"][row]
            assert (self.efc_id[world, rows[rows >= 0]] == row).all()

    def expect(self, datas, message=""):
        """The arrays are exactly the float32 numbers of these data."""
        for name in (*STATE, *DERIVED):
            expected = np.array([np.ravel(getattr(data, name)) for data in datas]).astype(np.float32)
            np.testing.assert_array_equal(getattr(self, name), expected, err_msg=f"{name} {message}")


@pytest.mark.parametrize("threads", [1, 3])
def test_states_keep_double_precision_and_equal_plain_mujoco(threads):
    program = Program(threads)
    program.throw()
    datas = program.plain()
    for step in range(200):
        program.run_both(datas)
        program.expect(datas, f"step {step}")
    assert program.count[0, 0] == sum(data.ncon for data in datas) > WORLDS


def test_what_the_program_writes_is_taken_and_nothing_else():
    program = Program()
    program.throw()
    datas = program.plain()
    for step in range(60):
        if step % 7 == 3:
            program.qpos[2, 7] = datas[2].qpos[7] = np.float32(0.1 * step)
            program.time[1] = 3.0
            datas[1].time = 3.0
        for world, data in enumerate(datas):
            program.ctrl[world, 0] = data.ctrl[0] = np.float32(np.sin(step + world))
            program.xfrc_applied[world, 8] = data.xfrc_applied[1, 2] = world
        program.run_both(datas)
        program.expect(datas, f"step {step}")


def test_steps_after_forward_equal_those_without_and_stages_may_be_divided():
    """A step after forward() computes positions and velocities no second time, unless something was written."""
    program, divided = Program(), Program()
    for one in (program, divided):
        one.throw()
    datas = program.plain()
    for step in range(40):
        divided.worlds.run(STEP1)
        program.run_both(datas, FORWARD)
        program.expect(datas, f"forward {step}")
        for world, data in enumerate(datas):
            program.ctrl[world, 0] = divided.ctrl[world, 0] = data.ctrl[0] = np.float32(0.1 * step)
        if step % 5 == 4:
            program.qvel[0, 2] = datas[0].qvel[2] = 1
            divided.qvel[0, 2] = 1
            divided.worlds.run(STEP1)
        divided.worlds.run(STEP2)
        program.run_both(datas)
        program.expect(datas, f"step {step}")
        divided.expect(datas, f"divided step {step}")


def test_stages_after_a_step_show_no_older_results():
    program, plain = Program(), Program()
    for one in (program, plain):
        one.throw()
        one.worlds.run(FORWARD)
        one.qvel[:, 0] += 1
        for _ in range(20):
            one.worlds.run(STEP)
    qacc, sensors = program.qacc.copy(), program.sensordata.copy()
    program.worlds.run(STEP1)
    np.testing.assert_array_equal(program.qacc, qacc)
    np.testing.assert_array_equal(program.sensordata[:, :3], sensors[:, :3])  # of accelerations
    np.testing.assert_array_equal(program.sensordata[:, 3], program.qpos[:, 7])
    program.worlds.run(STEP2)
    for _ in range(3):  # without step1()
        program.worlds.run(STEP)
        program.worlds.run(STEP2)
    for _ in range(7):
        plain.worlds.run(STEP)
    np.testing.assert_array_equal(program.qpos, plain.qpos)
    program.expect_ids()


def test_contacts_are_in_the_order_of_the_worlds():
    program = Program()
    program.throw()
    datas = program.plain()
    for _ in range(120):
        program.run_both(datas)
    program.run_both(datas, FORWARD)
    contacts = [(world, contact) for world, data in enumerate(datas) for contact in data.contact]
    assert program.count[0, 0] == len(contacts) > 2 * WORLDS
    for row, (world, contact) in enumerate(contacts):
        found = {name: array[row] for name, array in program.contact.items()}
        assert found["worldid"] == world
        assert found["geom"].tolist() == contact.geom.tolist()
        np.testing.assert_array_equal(found["dist"][0], np.float32(contact.dist))
        np.testing.assert_array_equal(found["frame"], contact.frame.astype(np.float32))
        np.testing.assert_array_equal(found["friction"], contact.friction.astype(np.float32))
        rows = [contact.efc_address + k for k in range(4)] if contact.efc_address >= 0 else []
        assert found["efc_address"].tolist() == rows + [-1] * (10 - len(rows))
        assert (program.efc_id[world, rows] == row).all()
    numbers = program.contact["geomcollisionid"][: len(contacts), 0]
    for world in range(WORLDS):
        own = numbers[program.contact["worldid"][: len(contacts), 0] == world]
        assert own.tolist() == list(range(len(own)))
    for world, data in enumerate(datas):
        assert program.nefc[world] == data.nefc
        np.testing.assert_array_equal(program.efc_force[world, : data.nefc], data.efc_force.astype(np.float32))


def test_models_differ_between_worlds_from_the_next_step_on():
    program = Program()
    mass, ipos, friction = (program.add_model(*field) for field in (("body_mass",), ("body_ipos",), ("geom_friction", 1)))
    gravity = program.model.opt.gravity[None].astype(np.float32)
    assert program.add("model", "opt.gravity", gravity)
    for name in ("body_invweight0", "dof_invweight0"):  # the program's own, which stay until it computes them itself
        program.add_model(name, 1)
    program.throw()
    datas, models = program.plain(), [mujoco.MjModel.from_xml_string(XML) for _ in range(WORLDS)]
    for step in range(60):
        program.worlds.run(FORWARD)  # whose positions and velocities a step may not use after a change
        if step == 10:
            mass[3, 1] = models[3].body_mass[1] = 2.5
        if step == 20:  # MuJoCo computes poses of bodies anew only because body_sameframe follows
            ipos[1, 3:6] = models[1].body_ipos[1] = np.float32((0.05, 0, 0.02))
            mujoco.mj_setConst(models[1], mujoco.MjData(models[1]))
            models[1].body_invweight0[:] = program.model.body_invweight0
            models[1].dof_invweight0[:] = program.model.dof_invweight0
        if step == 30:
            friction[0, 3] = gravity[0, 0] = 0.25
            for model in models:
                model.geom_friction[1, 0] = model.opt.gravity[0] = 0.25
        program.worlds.run(STEP)
        for model, data in zip(models, datas, strict=True):
            mujoco.mj_step(model, data)
        for name in ("qpos", "xpos"):
            expected = np.array([np.ravel(getattr(data, name)) for data in datas])
            np.testing.assert_allclose(getattr(program, name), expected, atol=2e-6, err_msg=f"{name} step {step}")


@pytest.mark.parametrize("rows", [2, 3, WORLDS + 2])
def test_worlds_share_the_rows_of_the_model_in_turn(rows):
    program = Program()
    mass = program.add_model("body_mass", rows)
    gravity = np.tile(program.model.opt.gravity.astype(np.float32), (rows, 1))
    assert program.add("model", "opt.gravity", gravity)
    program.throw()
    datas, models = program.plain(), [mujoco.MjModel.from_xml_string(XML) for _ in range(WORLDS)]
    program.worlds.run(STEP)
    mass[1:, 1] = 2.5
    gravity[:, 0] = np.arange(rows)
    program.worlds.run(STEP)
    for world, (model, data) in enumerate(zip(models, datas, strict=True)):
        mujoco.mj_step(model, data)
        row = world % rows
        model.body_mass[1], model.opt.gravity[0] = 2.5 if row else model.body_mass[1], row
        if row:
            mujoco.mj_setConst(model, mujoco.MjData(model))
        mujoco.mj_step(model, data)
    np.testing.assert_allclose(program.qvel, [data.qvel for data in datas], atol=2e-6)


def test_one_row_for_all_worlds_replaces_the_values_of_each():
    program = Program()
    program.ctrl[:] = 1
    mass = program.add_model("body_mass")
    mass[3, 1] = 2.5
    program.worlds.run(FORWARD)
    assert np.ptp(program.qacc[:, 6]) > 0
    shared = mass[:1].copy()  # equals the first world's values
    program.worlds.clear(20 * WORLDS, 100)
    for name in (*STATE, *DERIVED):
        assert program.add("data", name, getattr(program, name), name in STATE)
    assert program.add("model", "body_mass", shared)
    program.worlds.run(FORWARD)
    assert np.ptp(program.qacc[:, 6]) == 0


@pytest.mark.parametrize("name", ["geom_bodyid", "geom_type"])
def test_values_that_were_refused_are_not_used(name):
    program = Program()
    mass = program.add_model("body_mass")
    array = np.array(getattr(program.model, name)[None])
    assert program.add("model", name, array)
    program.throw()
    datas = program.plain()
    old = mass[2, 1], array[0, 1]
    mass[2, 1], array[0, 1] = 9, 99
    for _ in range(2):
        with pytest.raises(ValueError, match=name):
            program.worlds.run(STEP)
    mass[2, 1], array[0, 1] = old
    for _ in range(30):
        program.run_both(datas)
        program.expect(datas)


def test_reset_is_of_the_worlds_of_the_mask():
    program = Program()
    first = program.qpos.copy()
    program.throw()
    for _ in range(30):
        program.worlds.run(STEP)
    before, poses = program.qpos.copy(), program.xpos.copy()
    mask = np.array([True, False, False, True, False])
    program.worlds.run(RESET, mask.ctypes.data)
    np.testing.assert_array_equal(program.qpos[mask], first[mask])
    np.testing.assert_array_equal(program.qpos[~mask], before[~mask])
    np.testing.assert_array_equal(program.xpos, poses)  # until forward()
    assert (program.time[mask] == 0).all()
    assert (program.time[~mask] > 0.1).all()
    assert not program.ctrl[mask].any()
    program.worlds.run(RESET)
    np.testing.assert_array_equal(program.qpos, first)


@pytest.mark.parametrize("call", [FORWARD, STEP])
def test_reset_leaves_the_worlds_outside_the_mask(call):
    program = Program()
    program.qpos[:, 2] = 0.099
    program.worlds.run(FORWARD)
    program.qvel[:, 0] += 1
    program.worlds.run(STEP)
    program.worlds.run(call)
    assert program.worldids() == sorted([*range(WORLDS)] * 4)
    program.expect_ids()
    names = (*STATE, *DERIVED, "nefc", "efc_force")
    before = {name: getattr(program, name).copy() for name in names}
    program.ctrl[1, 0] = before["ctrl"][1, 0] = 7  # stays, and is taken by the next step
    mask = np.array([True, False, False, True, False])
    for _ in range(2):
        program.worlds.run(RESET, mask.ctypes.data)
        for name, array in before.items():
            np.testing.assert_array_equal(getattr(program, name)[~mask], array[~mask], err_msg=name)
        assert (program.nefc[mask] == 0).all()
        assert program.worldids() == [1] * 4 + [2] * 4 + [4] * 4
        program.expect_ids()
    other = Program()
    for name in STATE:
        getattr(other, name)[:] = getattr(program, name)
    for one in (program, other):
        one.worlds.run(STEP)
    np.testing.assert_allclose(program.qvel, other.qvel, atol=1e-4)


def test_diverged_worlds_show_what_diverged_and_the_others_go_on():
    program, other = Program(), Program()
    for one in (program, other):
        one.throw()
    program.qvel[2, 3] = np.nan
    for _ in range(5):
        program.worlds.run(STEP)
        other.worlds.run(STEP)
    assert np.isnan(program.qvel[2, 3])
    assert np.isnan(program.xpos[2]).all()
    assert not np.isnan(program.ctrl[2]).any()
    assert 2 not in program.contact["worldid"][: program.count[0, 0]]
    np.testing.assert_array_equal(program.time, other.time)
    rest = [0, 1, 3, 4]
    np.testing.assert_array_equal(program.qpos[rest], other.qpos[rest])
    program.worlds.run(RESET, np.array([False, False, True, False, False]).ctypes.data)
    program.worlds.run(STEP)
    assert np.isfinite(program.qpos).all()


@pytest.mark.parametrize(("contacts", "constraints"), [(3, 4), (0, 0)])  # arrays without rows are not linked
def test_too_few_rows_are_an_error_that_says_how_many(contacts, constraints):
    program = Program(contacts=contacts)
    program.worlds.run(STEP)
    program.qpos[:, 2] = 0.099
    with pytest.raises(ValueError, match=f"5 worlds have 20 contacts, and the data has room for {contacts}: make it with nconmax=8 or more"):
        program.worlds.run(STEP)
    assert program.count[0, 0] == contacts
    program = Program(constraints=constraints)
    program.qpos[:, 2] = 0.099
    with pytest.raises(ValueError, match=f"world 0 has 16 rows of constraints, and the data has room for {constraints}: make it with njmax=32"):
        program.worlds.run(STEP)


def test_errors_of_a_world_leave_the_contacts_of_all_numbered():
    program = Program()
    program.qpos[:, 2] = 0.099
    program.worlds.run(FORWARD)
    program.qpos[2, 2] = 1
    program.worlds.set_option("opt.integrator", [0, 0, 0, 0, 99])
    with pytest.raises(RuntimeError, match=r"world 4: MuJoCo: .*integrator"):
        program.worlds.run(STEP)
    assert program.worldids() == [0] * 4 + [1] * 4 + [3] * 4 + [4] * 4
    program.expect_ids()
    program.worlds.set_option("opt.integrator", [0])
    program.worlds.run(STEP)
    assert program.worldids() == [0] * 4 + [1] * 4 + [3] * 4 + [4] * 4


def test_other_fields_sizes_and_types_are_refused():
    program = Program()
    assert not program.add("data", "nothing", np.zeros((WORLDS, 3), np.float32))
    assert not program.add("data", "qpos", np.zeros((WORLDS, 3), np.float32))
    assert not program.add("data", "qpos", np.zeros((WORLDS, program.model.nq), np.int32))
    assert not program.add("model", "body_mass", np.zeros((1, 1), np.float32))
    assert not program.add("contact", "pos", np.zeros((9, 2), np.float32))
    assert not program.add("contact", "mu", np.zeros((9, 1), np.float32))
    ids = np.array(program.model.geom_bodyid[None])
    assert program.add("model", "geom_bodyid", ids)
    ids[0, 1] = 99
    with pytest.raises(ValueError, match="geom_bodyid"):
        program.worlds.run(STEP)


@pytest.mark.parametrize("call", [FORWARD, STEP])
def test_rays_hit_what_plain_mujoco_hits(call):
    """After a step, poses are those before it."""
    program = Program()
    program.throw()
    datas = program.plain()
    program.worlds.run(call)
    rng, count = np.random.default_rng(1), 37
    origins = rng.uniform(-0.2, 0.2, (WORLDS, count, 3)).astype(np.float32) + np.float32((0, 0, 1.2))
    directions = rng.normal(0, 1, (WORLDS, count, 3)).astype(np.float32)
    directions[:, :, 2] -= 2
    directions[1, 5] = 0
    exclude = np.full(count, -1, np.int32)
    exclude[20:] = 1
    exclude[3] = 2
    distances, geoms = np.empty((WORLDS, count), np.float32), np.empty((WORLDS, count), np.int32)
    normals = np.empty((WORLDS, count, 3), np.float32)
    arrays = [array.ctypes.data for array in (origins, directions, exclude, distances, geoms, normals)]
    program.worlds.cast(count, arrays, 0x3F, bytes(program.model.ngeom))
    found = np.zeros(1, np.int32)
    for world, data in enumerate(datas):
        (mujoco.mj_forward if call == FORWARD else mujoco.mj_step)(program.model, data)
        for ray in range(count):
            if not directions[world, ray].any():
                assert geoms[world, ray] == -1
                continue
            normal = np.zeros(3)
            expected = mujoco.mj_ray(
                program.model, data, origins[world, ray], directions[world, ray].astype(float), None, 1, exclude[ray], found, normal
            )
            assert geoms[world, ray] == found[0]
            np.testing.assert_allclose(distances[world, ray], expected, atol=2e-6)
            np.testing.assert_allclose(normals[world, ray], normal if found[0] >= 0 else 0, atol=1e-5)
    assert {-1, 0, 1, 2} <= {*geoms.ravel().tolist()}
    program.worlds.cast(count, arrays, 0x3F, bytes([1, 0, 0]))
    assert 0 not in geoms


def test_rays_use_the_poses_of_the_arrays():
    """The program may compute them itself, and a reset leaves them."""
    program = Program()
    poses, rotations = (np.zeros((WORLDS, n * program.model.ngeom), np.float32) for n in (3, 9))
    assert program.add("data", "geom_xpos", poses)
    assert program.add("data", "geom_xmat", rotations)
    program.worlds.run(STEP)
    origins, directions = np.tile(np.float32([0, 0, 3]), (WORLDS, 1)), np.tile(np.float32([0, 0, -1]), (WORLDS, 1))
    exclude, geoms = np.full(1, -1, np.int32), np.zeros(WORLDS, np.int32)
    distances, normals = np.zeros(WORLDS, np.float32), np.zeros((WORLDS, 3), np.float32)
    arrays = [array.ctypes.data for array in (origins, directions, exclude, distances, geoms, normals)]
    program.worlds.run(RESET)
    program.worlds.cast(1, arrays, 0x3F, bytes(program.model.ngeom))
    np.testing.assert_allclose(distances, 2.6, atol=1e-5)
    poses[1, 3:6] = 0, 0, 1
    poses[2, 3:6] = 5, 0, 0
    program.worlds.cast(1, arrays, 0x3F, bytes(program.model.ngeom))
    np.testing.assert_allclose(distances, [2.6, 1.9, 3, 2.6, 2.6], atol=1e-5)


@pytest.mark.parametrize("side", [9, 24])  # with one level of boxes, and with blocks of them
def test_grids_of_rays_hit_what_plain_mujoco_hits(side):
    """The rays of a grid have other origins each, as those of a height scanner."""
    heights = np.random.default_rng(0).uniform(0.02, 0.2, (side, side))
    boxes = "".join(
        f'<geom type="box" size=".04 .04 {height}" pos="{0.1 * (x - side // 2)} {0.1 * (y - side // 2)} 0"/>'
        for (x, y), height in np.ndenumerate(heights)
    )
    model = mujoco.MjModel.from_xml_string(f'<mujoco><worldbody>{boxes}<geom type="plane" size="0 0 1"/></worldbody></mujoco>')
    worlds = _core.ForeignArrays(model._address, 1, 1)
    worlds.run(FORWARD)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    grid = np.stack(np.meshgrid(np.linspace(-0.8, 0.8, 17), np.linspace(-0.5, 0.5, 11)), -1).reshape(-1, 2) + 0.013
    origins = np.column_stack([grid, np.full(len(grid), 1.0)]).astype(np.float32)
    directions = np.tile(np.float32([0, 0, -1]), (len(grid), 1))
    lost = [0, 40, 100]  # rays that are not finite hit nothing, and leave the others
    origins[lost[:2], 1], directions[lost[2]] = np.nan, np.inf
    exclude, geoms = np.full(len(grid), -1, np.int32), np.empty(len(grid), np.int32)
    distances, normals = np.empty(len(grid), np.float32), np.empty((len(grid), 3), np.float32)
    worlds.cast(
        len(grid), [array.ctypes.data for array in (origins, directions, exclude, distances, geoms, normals)], 0x3F, bytes(model.ngeom)
    )
    found, expected = np.zeros(1, np.int32), []
    for origin in origins:
        distance = mujoco.mj_ray(model, data, origin, np.array([0, 0, -1.0]), None, 1, -1, found)
        expected.append((int(found[0]), distance))
    for ray in lost:
        expected[ray] = -1, -1
    assert geoms.tolist() == [geom for geom, _ in expected]
    np.testing.assert_allclose(distances, [distance for _, distance in expected], atol=2e-6)
    assert len({*geoms.tolist()}) > 60


SEEN = """
<mujoco><visual><headlight ambient=".1 .05 0" diffuse=".2 .2 .3" specular=".1 .1 .1"/></visual>
<asset><material name="glossy" rgba=".6 .4 .2 .3" specular=".8" shininess=".1" emission=".15" reflectance=".9"/></asset><worldbody>
  <light type="directional" pos="0 0 9" dir="-.48 0 -.64" diffuse=".5 .6 .4" specular=".7 .7 .7" ambient=".02 0 .03"/>
  <light type="spot" pos="2 -1 4" dir="-.4 .2 -1" cutoff="60" exponent="2" diffuse=".3 .1 .2" specular="0 0 0" attenuation=".8 .1 .02" castshadow="false"/>
  <geom type="plane" size="0 0 1" rgba=".5 .7 .9 1"/>
  <camera pos="0 -1 6" xyaxes="1 0 0 0 .97 .24"/>
  <body pos="0 0 1.5"><freejoint/><geom size=".5" material="glossy" rgba="0 1 0 1"/></body>
</worldbody></mujoco>"""


def unit(v):
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def warp_colors(model, data, rays, points, normals, rgb, specular, exponent, emission, lit):
    """mujoco_warp's light model: colours of points, [n, 3]. `lit`: 1, or the share of light where the directional light is shadowed."""
    head, ambient = model.vis.headlight, model.light_ambient.sum(0)
    result, gloss = rgb * (emission + head.ambient + ambient), 0
    lights = [(-unit(data.cam_xmat[0].reshape(3, 3) @ [0, 0, -1]), 1.0, head.diffuse, head.specular, 1.0)]
    lights.append((-unit(data.light_xdir[0]), 1.0, model.light_diffuse[0], model.light_specular[0], lit))
    away = data.light_xpos[1] - points
    distance = np.linalg.norm(away, axis=1, keepdims=True)
    cosine = -(away / distance) @ data.light_xdir[1][:, None]
    a = model.light_attenuation[1]
    strength = (cosine > np.cos(np.deg2rad(60))) * np.maximum(cosine, 0) ** 2 / (a[0] + a[1] * distance + a[2] * distance**2)
    lights.append((away / distance, strength, model.light_diffuse[1], model.light_specular[1], 1.0))
    for to_light, strength, diffuse, shine, share in lights:
        matte = np.maximum((normals * to_light).sum(-1, keepdims=True), 0)
        half = np.maximum((normals * unit(to_light - rays)).sum(-1, keepdims=True), 0)
        result = result + rgb * diffuse * matte * strength * share
        gloss = gloss + (matte > 0) * shine * specular * half**exponent * strength * share
    return np.clip(result + gloss, 0, 1)


@pytest.mark.parametrize(("shadows", "threads", "series_4"), [(False, 1, False), (True, 3, False), (True, 1, True)])
def test_images_have_the_colours_of_mujoco_warps_light_model(shadows, threads, series_4):
    """mujoco_warp 3.11 gives a geom the colour of its material, and 4.0 its own."""
    share = 0.1 if series_4 else 0.3
    model = mujoco.MjModel.from_xml_string(SEEN)
    data, width, height = mujoco.MjData(model), 40, 28
    mujoco.mj_forward(model, data)
    worlds = _core.ForeignArrays(model._address, 2, threads)
    worlds.run(FORWARD)
    packed, depth = np.zeros((2, 5 + width * height), np.uint32), np.zeros((2, width * height), np.float32)
    ids = np.full((2, width * height, 2), 9, np.int32)
    arrays = (packed.ctypes.data + 20, depth.ctypes.data, ids.ctypes.data)
    worlds.render([(0, width, height, None, arrays)], (5 + width * height, width * height, 2 * width * height), 7, True, shadows, False, 0xFF102030, series_4, False, share)
    assert not packed[:, :5].any()
    np.testing.assert_array_equal(packed[0], packed[1])
    rgb = np.stack([packed[1, 5:] >> shift & 255 for shift in (16, 8, 0)], -1).astype(int)
    half = np.tan(np.deg2rad(model.cam_fovy[0] / 2))
    x, y = np.meshgrid((np.arange(width) + 0.5) / width * 2 - 1, 1 - (np.arange(height) + 0.5) / height * 2)
    local = unit(np.stack([x * half * width / height, y * half, -np.ones_like(x)], -1).reshape(-1, 3))
    rays, eye, middle = local @ data.cam_xmat[0].reshape(3, 3).T, data.cam_xpos[0], data.geom_xpos[1]

    def on_sphere(origin, direction):
        b, c = (direction * (origin - middle)).sum(-1), ((origin - middle) ** 2).sum(-1) - 0.25
        return np.where(b * b > c, -b - np.sqrt(np.maximum(b * b - c, 0)), -1)

    sphere, plane = on_sphere(eye, rays), -eye[2] / rays[:, 2]
    seen, floor = sphere > 0, (sphere < 0) & (plane > 0)
    assert seen.sum() > 20 < floor.sum()
    np.testing.assert_allclose(depth[0], np.where(seen, sphere, plane) * -local[:, 2], rtol=1e-5)
    np.testing.assert_array_equal(ids[1], np.stack([seen, np.full_like(seen, mujoco.mjtObj.mjOBJ_GEOM, int)], -1))
    points = eye + sphere[seen, None] * rays[seen]
    wanted = warp_colors(model, data, rays[seen], points, unit(points - middle), np.array([0, 1.0, 0] if series_4 else [0.6, 0.4, 0.2]), 0.8, 12.8, 0.15, 1.0)
    assert np.abs(rgb[seen] - np.floor(255 * wanted)).max() <= 1
    points = eye + plane[floor, None] * rays[floor]
    away = on_sphere(points, -unit(data.light_xdir[0])) > 0
    lit = np.where(away & shadows, share, 1.0)[:, None]
    wanted = warp_colors(model, data, rays[floor], points, np.array([[0, 0, 1.0]]), np.array([0.5, 0.7, 0.9]), 0.5, 64, 0, lit)
    assert (np.abs(rgb[floor] - np.floor(255 * wanted)).max(-1) <= 1).mean() > 0.99
    assert away.sum() > 10


def test_images_use_the_poses_models_and_pixels_of_the_program():
    model = mujoco.MjModel.from_xml_string("<mujoco><worldbody><camera pos='0 0 4'/><geom size='1' group='1'/><geom size='9' group='4'/></worldbody></mujoco>")
    worlds = _core.ForeignArrays(model._address, 3, 1)
    worlds.clear(9, 9)
    size, pose = np.full((3, 6), 1, np.float32), np.zeros((3, 3), np.float32)
    size[:, 3:] = 9
    assert worlds.add("model", "geom_size", size.ctypes.data, "float32", 3, 6)
    assert worlds.add("data", "cam_xpos", pose.ctypes.data, "float32", 3, 3)
    worlds.run(FORWARD)
    assert pose[:, 2].tolist() == [4, 4, 4]
    size[1, 0], pose[2, 2] = 2, 6
    depth, rgb = np.zeros((3, 9), np.float32), np.zeros((3, 9), np.uint32)
    camera = (0, 3, 3, (-0.03, 0.03, 0.02, -0.02), (rgb.ctypes.data, depth.ctypes.data, 0))
    worlds.render([camera], (9, 9, 0), 1 << 1, False, False, False, 0xFF102030, False, False, 0.3)
    np.testing.assert_allclose(depth[:, 4], [3, 2, 5], rtol=1e-6)
    camera = (*camera[:3], (1.0, 1.0, 0.02, -0.02), camera[4])  # pixels next to the sphere
    worlds.render([camera], (9, 9, 0), 1 << 1, False, False, False, 0xFF102030, False, False, 0.3)
    assert not depth.any()
    assert (rgb == 0xFF102030).all()


@pytest.mark.parametrize("rows", [1, WORLDS])
def test_constants_are_those_of_mj_setconst(rows):
    program = Program()
    program.throw()
    outputs = ("body_subtreemass", "body_invweight0", "dof_invweight0")
    arrays = {name: program.add_model(name, rows) for name in ("body_mass", "body_ipos", *outputs)}
    program.worlds.run(STEP)
    rng = np.random.default_rng(0)
    arrays["body_mass"] *= rng.uniform(0.5, 2, arrays["body_mass"].shape).astype(np.float32)
    arrays["body_ipos"][:, 3:] += rng.uniform(-0.1, 0.1, (rows, 6)).astype(np.float32)
    before = {name: arrays[name].copy() for name in outputs}
    poses = program.xpos.copy()
    program.worlds.set_constants(["body_subtreemass"], False)
    np.testing.assert_array_equal(arrays["dof_invweight0"], before["dof_invweight0"])
    np.testing.assert_array_equal(program.xpos, poses)
    program.worlds.set_constants(["body_invweight0", "dof_invweight0"], True)
    for row in range(rows):
        model = mujoco.MjModel.from_xml_string(XML)
        for name in ("body_mass", "body_ipos"):
            getattr(model, name)[...] = arrays[name][row].reshape(getattr(model, name).shape)
        mujoco.mj_setConst(model, mujoco.MjData(model))
        for name in outputs:
            np.testing.assert_allclose(arrays[name][row], np.ravel(getattr(model, name)), rtol=1e-5, err_msg=name)
    for world, data in enumerate(program.plain()):  # positions are those of the states
        mujoco.mj_kinematics(program.model, data)
        np.testing.assert_allclose(program.xpos[world], data.xpos.ravel(), atol=1e-6)
    arrays["dof_invweight0"][0, 2] = 7  # what the program writes is derived anew
    program.worlds.set_constants(["body_invweight0", "dof_invweight0"], False)
    assert arrays["dof_invweight0"][0, 2] < 7


def test_threads_take_turns_and_a_forked_process_is_refused():
    program, alone = Program(2), Program()
    for one in (program, alone):
        one.throw()
    runs = [threading.Thread(target=lambda: [program.worlds.run(STEP) for _ in range(50)]) for _ in range(4)]
    for run in runs:
        run.start()
    for run in runs:
        run.join()
    for _ in range(200):
        alone.worlds.run(STEP)
    np.testing.assert_array_equal(program.qpos, alone.qpos)
    child = os.fork()
    if child == 0:
        try:
            program.worlds.run(STEP)
        except RuntimeError as error:
            os._exit(0 if "was forked" in str(error) else 2)
        os._exit(1)
    assert os.waitpid(child, 0)[1] == 0

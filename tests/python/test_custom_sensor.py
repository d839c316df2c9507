# SPDX-License-Identifier: Apache-2.0
import gc
import json
import weakref

import gymnasium
import numpy as np
import pytest
from scenes import ball_scene, feet_cfg

import mjsense as mjs

BOX = gymnasium.spaces.Box(-np.inf, np.inf, (1,), np.float32)


class Height(mjs.Sensor):
    """Height of the ball."""

    uuid = "height"
    observation_space = BOX
    unit = "m"
    calls = 0

    def compute(self, sim):
        self.calls += 1
        return sim.qpos[:, 2:3].astype(np.float32)


class HeightOfMjlab(mjs.Sensor):
    def __init__(self):
        super().__init__()
        self.uuid = "height"

    def edit_spec(self, spec, entities):
        self.entities = {name: entity.geom_names for name, entity in entities.items()}

    def initialize(self, mj_model, model, data, device):
        self._mj_data = data
        self.nq = mj_model.nq

    def _compute_data(self):
        return self._mj_data.qpos[:, 2:3]


class HeightOfMolmo(mjs.Sensor):
    def __init__(self):
        super().__init__(uuid="height", observation_space=BOX)

    def get_observation(self, env, task, batch_index=0):
        return env.qpos[batch_index, 2:3].astype(np.float32)


@pytest.mark.parametrize("sensor_type", [Height, HeightOfMjlab, HeightOfMolmo])
@pytest.mark.parametrize("in_scene", [True, False])
def test_three_styles(sensor_type, in_scene):
    sensor = sensor_type()
    scene = ball_scene(sensor) if in_scene else ball_scene()
    sim = mjs.Simulation(scene, num_worlds=3)
    if in_scene:
        assert scene["height"] is sensor
    else:
        sim.add(sensor)
    sim.qpos[:, 2] = [1, 2, 3]
    sim.forward()
    np.testing.assert_array_equal(np.asarray(sensor.data)[:, 0], [1, 2, 3])


def test_registry_order_and_user_defined_config():
    class Cfg:
        name = "mine"
        prefixed_name = "ball/mine"

        def build(self):
            return HeightOfMjlab()

    scene = ball_scene(feet_cfg(fields=("found",)), Cfg())
    assert list(scene.sensors)[:2] == ["touch", "ball/mine"]
    assert scene["ball/mine"].entities["ball"] == ("ball",)
    with pytest.raises(ValueError, match="two sensors have this name"):
        ball_scene(Height(), Height())


def test_lazy_cached_and_invalidated():
    sensor = Height()
    sim = mjs.Simulation(ball_scene(sensor), num_worlds=2)
    assert sensor.calls == 0
    sensor.data, sensor.data
    assert sensor.calls == 1
    for change in (sim.step, sim.forward, sim.reset, sim.invalidate, lambda: sim.reset([1]), sim.update_sensors):
        calls = sensor.calls
        change()
        sensor.data, sensor.data
        assert sensor.calls == calls + 1
    sim.set_state(qpos=[0, 0, 4, 1, 0, 0, 0])
    assert sensor.data[0, 0] == 4


def test_reading_other_sensors():
    class Twice(mjs.Sensor):
        uuid = "twice"
        observation_space = BOX

        def compute(self, sim):
            return 2 * sim.scene["height"].data

    sim = mjs.Simulation(ball_scene(Twice(), Height()), num_worlds=2)
    for _ in range(3):
        sim.step()
        np.testing.assert_allclose(sim.scene["twice"].data, 2 * sim.qpos[:, 2:3].astype(np.float32))


def test_life_cycle():
    class Log(mjs.Sensor):
        uuid = "log"

        def __init__(self):
            self.calls = []

        def edit_spec(self, spec):
            spec.worldbody.add_site(name="from_sensor")
            self.calls.append("edit_spec")

        def initialize(self, sim):
            self.calls.append(f"initialize {sim.model.site('from_sensor').id >= 0}")

        def update(self, dt):
            self.calls.append(f"update {dt:g}")

        def reset(self, world_ids=None):
            self.calls.append(f"reset {world_ids}")

        def compute(self, sim):
            self.calls.append("compute")
            return np.zeros(sim.num_worlds)

    log = Log()
    sim = mjs.Simulation(ball_scene(log), num_worlds=3, decimation=2)
    assert log.calls == ["edit_spec", "initialize True"]
    log.calls.clear()
    sim.reset()
    sim.reset([2])
    sim.step(2)
    log.data
    assert log.calls == ["reset None", "reset [2]", "update 0.004", "update 0.004", "compute"]
    log.calls.clear()
    sim.qvel[1, 0] = 1e20
    sim.step()
    assert log.calls == ["reset [1]", "update 0.004", "compute"]


class Broken(mjs.Sensor):
    uuid = "broken"
    fail = True

    def compute(self, sim):
        if self.fail:
            raise ZeroDivisionError("by zero")
        return np.ones(sim.num_worlds)


def test_shared_instance_receives_the_reset_worlds():
    class Wipes(Height):
        def reset(self):
            pass

    mjs.Simulation(ball_scene(Wipes()), num_worlds=1)
    with pytest.raises(TypeError, match=r"'height': one instance computes all worlds, so its reset\(\) must take world_ids"):
        mjs.Simulation(ball_scene(Wipes()), num_worlds=2)


def test_values_of_some_worlds():
    class Some(mjs.Sensor):
        uuid = "some"
        observation_space = gymnasium.spaces.Dict({"id": gymnasium.spaces.Discrete(3), "in": gymnasium.spaces.Dict({"x": BOX})})

        def __init__(self):
            super().__init__()
            self.asked, self.heard = [], []

        def compute(self, sim, world_ids):
            self.asked.append(world_ids)
            return {"id": np.array(world_ids), "in": {"x": np.full((len(world_ids), 1), len(self.asked), np.float32)}}

        def update(self, dt, world_ids):
            self.heard.append((dt, world_ids))

    sensor = Some()
    sim = mjs.Simulation(ball_scene(sensor), num_worlds=3)
    assert sensor.data["id"].tolist() == [0, 1, 2]
    sim.reset([1])
    np.testing.assert_array_equal(sensor.data["in"]["x"][:, 0], [1, 2, 1])
    sim.step()
    assert sensor.asked == [[0, 1, 2], [1], [0, 1, 2]] and sensor.heard == [(sim.step_dt, [0, 1, 2])]
    assert sensor.rows["id"].dtype == np.int64


def test_bounds_are_checked_for_each_world():
    class Bounded(mjs.Sensor):
        uuid = "bounded"
        observation_space = gymnasium.spaces.Box(np.array([0, -np.inf]), np.array([1, np.inf]), dtype=np.float64)
        value = (0.5, np.nan)

        def get_observation(self, env, task, batch_index=0):
            return np.array(self.value if batch_index == 1 else [0.5, np.nan])

    sensor = Bounded()
    sim = mjs.Simulation(ball_scene(sensor), num_worlds=2)
    assert np.isnan(sensor.data[:, 1]).all()
    for value, text in [((2.0, 0.0), "2.0 at [0] is outside the observation_space's [0.0, 1.0]"), ((np.nan, 0), "nan at [0]")]:
        sensor._mjs_calls.instances[1].value = value
        sim.invalidate()
        with pytest.raises(mjs.SensorError) as error:
            sensor.data
        assert str(error.value).startswith("sensor 'bounded', world 1: get_observation(): ValueError: " + text)


def test_wrong_keys():
    class Keys(mjs.Sensor):
        uuid = "keys"
        observation_space = gymnasium.spaces.Dict({"a": BOX, "b": BOX})

        def get_observation(self, env, task, batch_index=0):
            return {"a": [1.0], "c": [2.0]}

    sim = mjs.Simulation(ball_scene())
    with pytest.raises(mjs.SensorError, match="keys are not the observation_space's: missing b; unknown c"):
        sim.add(Keys()).data


def test_sensor_may_read_another_sensor():
    class Outer(mjs.Sensor):
        uuid = "outer"
        observation_space = BOX

        def get_observation(self, env, task, batch_index=0):
            inner = env.scene["height"].data[batch_index]
            assert env.current_batch_index == batch_index
            return inner

    sim = mjs.Simulation(ball_scene(Outer(), HeightOfMolmo()), num_worlds=3)
    sim.qpos[:, 2] = [1, 2, 3]
    sim.forward()
    np.testing.assert_array_equal(sim.scene["outer"].data[:, 0], [1, 2, 3])


def test_errors_name_the_sensor_and_leave_the_simulation_usable():
    sensor = Broken()
    sim = mjs.Simulation(ball_scene(sensor), num_worlds=2)
    for _ in range(2):
        with pytest.raises(mjs.SensorError, match=r"sensor 'broken': compute\(\): ZeroDivisionError: by zero") as error:
            sensor.data
        assert isinstance(error.value.__cause__, ZeroDivisionError)
        sim.step()
        sim.scene["ball/acc"].data
    sensor.fail = False
    assert sensor.data.tolist() == [1, 1]
    sensor.fail = True  # it is read every step now, so step() computes it
    with pytest.raises(mjs.SensorError):
        sim.step()
        sensor.data
    sensor.fail = False
    sim.step()
    assert sensor.data.tolist() == [1, 1]


@pytest.mark.parametrize(
    "value, text",
    [
        (np.zeros((3, 1)), r"shape \(3, 1\) is not \(2, 1\)"),
        (np.zeros(2), "shape"),
        (np.array([["a"], ["b"]]), "do not fit"),
        (np.zeros((2, 1)), "float64 values do not fit the observation_space's float32"),
        (np.zeros((2, 1), np.int32), "int32 values do not fit"),
        ([[1.0], [np.float64(1)]], "float64 values do not fit"),
        ([[True], ["a"]], "do not fit"),
        ({"a": np.zeros((2, 1), np.float32)}, "shape"),
        (None, "shape"),
    ],
)
def test_wrong_values(value, text):
    class Wrong(Height):
        def compute(self, sim):
            return value

    sim = mjs.Simulation(ball_scene(), num_worlds=2)
    with pytest.raises(mjs.SensorError, match=text):
        sim.add(Wrong()).data


def test_changing_state_inside_compute_is_refused():
    class Greedy(mjs.Sensor):
        uuid = "greedy"

        def compute(self, sim):
            sim.step()

    sim = mjs.Simulation(ball_scene(Greedy()))
    with pytest.raises(mjs.SensorError, match=r"step\(\) was called while the simulation is running"):
        sim.scene["greedy"].data
    sim.step()


def test_a_sensor_belongs_to_one_scene():
    sensor = Height()
    scene = ball_scene(sensor)
    with pytest.raises(RuntimeError, match="'height' belongs to another scene"):
        ball_scene(sensor)
    sim = mjs.Simulation(scene)
    with pytest.raises(RuntimeError, match="'height' belongs to a simulation"):
        sim.add(sensor)


def test_dict_sensor_is_json_on_disk():
    class Info(mjs.Sensor):
        uuid = "info"
        is_dict = True
        str_max_len = 64

        def get_observation(self, env, task, batch_index=0):
            return {"z": np.float32(0.5), "a": [1, float("nan")], "world": batch_index}

    sensor = Info()
    sim = mjs.Simulation(ball_scene(sensor), num_worlds=2)
    assert sensor.data[1]["world"] == 1
    row = sensor.rows[1]
    assert row.dtype == np.uint8 and row.shape == (64,)
    text = bytes(row).rstrip(b"\0")
    assert text == b'{"a":[1,NaN],"world":1,"z":0.5}'
    assert json.loads(text)["z"] == 0.5
    sensor.str_max_len = 3
    sim.invalidate()
    with pytest.raises(mjs.SensorError, match="JSON text of 31 bytes, str_max_len is 3"):
        sensor.data


class Reset(Height):
    def reset(self, world_ids=None):
        self.worlds = world_ids


def test_suite():
    suite = mjs.SensorSuite([Reset()])
    with pytest.raises(ValueError, match="'height' is a duplicated sensor uuid"):
        suite.add(Height())
    scene = ball_scene(feet_cfg(fields=("found",)))
    suite.extend([scene["touch"], scene["ball/acc"]])
    sim = mjs.Simulation(scene, num_worlds=2)
    batch = suite.get_observations(sim)
    assert list(batch) == ["height", "touch", "ball/acc"]
    assert batch["height"].shape == (2, 1) and np.shares_memory(batch["ball/acc"], scene["ball/acc"].data)
    one = suite.get_observations(sim, None, 1)
    assert not np.shares_memory(one["height"], suite.get("height").rows)
    assert one["height"].shape == (1,) and one["touch"]["found"].shape == (1,)
    assert suite.observation_spaces.contains(one)
    with pytest.raises(KeyError, match="no sensor 'heigth'"):
        suite.get("heigth")
    with pytest.raises(ValueError, match="batch_index 2"):
        suite.get_observations(sim, None, 2)
    assert len(suite) == 3 and "touch" in suite
    suite.reset([1])
    assert suite.get("height").worlds == [1]
    suite.reset()
    assert suite.get("height").worlds is None


def test_sensors_and_simulations_are_freed():
    def make():
        sensor = Height()
        sim = mjs.Simulation(ball_scene(sensor), num_worlds=2)
        sim.add(Hidden())
        sim.step()
        sensor.data, sim.data.xpos
        return weakref.ref(sensor), weakref.ref(sim), sensor.rows

    class Hidden(HeightOfMjlab):
        def __init__(self):
            super().__init__()
            self.uuid = "hidden"

    sensor, sim, rows = make()
    gc.collect()
    assert sensor() is None and sim() is None
    assert rows.shape == (2, 1)


def test_user_defined_names_do_not_clash():
    class Mine(mjs.Sensor):
        def __init__(self):
            self.name = "mine"

        def initialize(self, sim):
            self.sim, self._value, self._rows, self._handle, self._core, self._data = sim, 1, 2, 3, 4, 5

        def _reset(self):
            raise AssertionError

        def compute(self, sim):
            return np.full(self.sim.num_worlds, self._value + self._rows + self._handle + self._core + self._data)

    sim = mjs.Simulation(ball_scene(Mine()), num_worlds=2)
    sim.reset()
    sim.step()
    assert sim.scene["mine"].data.tolist() == [15, 15]


class Walk(mjs.Sensor):
    """A bias that walks at random, a step a control step."""

    uuid = "walk"
    observation_space = BOX

    def __init__(self):
        super().__init__()
        self.steps = []

    def reset(self):
        self.steps = []

    def update(self, dt):
        self.steps.append(np.random.uniform())

    def get_observation(self, env, task, batch_index=0):
        return np.array([sum(self.steps)], np.float32)


def test_random_numbers_of_update_do_not_depend_on_reads():
    walks = []
    for read in (False, True):
        sim = mjs.Simulation(ball_scene(), num_worlds=2, seed=3)
        walk = sim.add(Walk())
        sim.reset()
        for _ in range(4):
            sim.step()
            if read:
                walk.data
        walks.append([instance.steps for instance in walk._mjs_calls.instances])
    assert walks[0] == walks[1]
    assert len(set(walks[0][0] + walks[0][1])) == 8, "every step and world its own"


def test_reset_hook_cannot_change_the_state():
    class Restless(mjs.Sensor):
        uuid, observation_space = "restless", BOX

        def reset(self, world_ids):
            self.simulation.step()

        def compute(self, sim):
            return sim.qpos[:, 2:3].astype(np.float32)

    sim = mjs.Simulation(ball_scene(), num_worlds=2)
    sim.add(Restless())
    with pytest.raises(mjs.SensorError, match="while the simulation is running"):
        sim.reset()


def test_duplicate_names_are_an_error():
    sim = mjs.Simulation(ball_scene(), num_worlds=1)
    sim.add(Height())
    with pytest.raises(ValueError, match="'height': there is one of that name already"):
        sim.add(Height())

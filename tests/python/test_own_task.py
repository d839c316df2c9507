# SPDX-License-Identifier: Apache-2.0
import gc
import json
import weakref

import gymnasium
import h5py
import numpy as np
import pytest
from tasks import Cart, Driver

import mjsense as mjs


def make(task=Cart, **kwargs):
    return mjs.make_vec(task, **{"num_envs": 3, "cameras": [], "threads": 2, **kwargs})


def record(out, task=None, **kwargs):
    task = task or Cart()
    kwargs.setdefault("policy", Driver(task))
    return mjs.record(task, out=out, **{"episodes": 3, "num_worlds": 2, "cameras": [], "keep_failures": True, **kwargs})


def trajectories(summary):
    found = []
    for path in sorted(summary.path.glob("*.h5")):
        with h5py.File(path) as file:
            for name in sorted(file):
                rows = {}
                file[name].visititems(lambda key, item: rows.update({key: item[()]}) if isinstance(item, h5py.Dataset) else None)
                found.append(rows)
    return found


def json_rows(rows):
    return [json.loads(row.tobytes().rstrip(b"\0")) for row in rows]


def test_recording_of_a_user_defined_task(tmp_path):
    task = Cart()
    summary = record(tmp_path, task)
    assert summary.kept == 3 and summary.enough
    first = trajectories(summary)[0]
    scene = json.loads(first["obs_scene"])
    assert scene["task_type"] == "cart" and scene["task_description"] == "Drive the cart to the mark."
    assert scene["policy_dt_ms"] == 20 and scene["referral_expressions"] == {"ball": [["ball", 1.0]]}
    info = json_rows(first["obs/extra/task_info"])
    assert [row["episode_step"] for row in info] == list(range(21))
    for row, reward, success in zip(info, first["rewards"], first["success"]):
        assert row["mark"] == [row["mark"][0]] * 2 and row["success"] == success == (abs(row["error"]) < 0.02)
        assert reward == np.float32(-abs(row["error"])) and row["near"] is (abs(row["error"]) < 0.1)
    commands = json_rows(first["actions/commanded_action"])
    assert commands[0] == {} and commands[5] == {"joints": [pytest.approx(info[0]["mark"][0])]}
    assert first["obs/extra/obj_start"].shape == (21, 7) and "env_states/actors/ball" in first


def test_python_is_called_once_per_step_for_all_worlds(tmp_path):
    task = Cart()
    policy = Driver(task)
    summary = record(tmp_path, task, policy=policy, episodes=4, num_worlds=4)
    assert summary.steps == 4 * 20
    assert policy.acts == 20 and task.calls == {"scene": 1, "sample": 4, "evaluate": 21} and task.began == [[0, 1, 2, 3]]


def test_an_episode_does_not_depend_on_its_world(tmp_path):
    runs = [trajectories(record(tmp_path / str(worlds), num_worlds=worlds, seed=7)) for worlds in (1, 2, 3)]
    for run in runs[1:]:
        for one, other in zip(runs[0], run, strict=True):
            assert one.keys() == other.keys()
            for key in one:
                np.testing.assert_array_equal(one[key], other[key], err_msg=key)


def test_terminated_is_the_value_of_the_task():
    env = make(horizon=100)
    env.reset(seed=0)
    seen = np.zeros(3, bool)
    for _ in range(100):
        _, _, terminated, truncated, _ = env.step(np.ones((3, 1)))
        np.testing.assert_array_equal(terminated, (np.abs(env.sim.qpos[:, 0]) > 0.95) & ~seen)
        seen |= terminated
        if seen.any():
            break
        assert not truncated.any()
    assert seen.any()
    env.close()


class OverAtOnce(Cart):
    """Episodes whose cart starts on the left are over before they begin."""

    def evaluate(self, sim):
        left = sim.qpos[:, 0] < 0
        return {"reward": -np.abs(sim.qpos[:, 0]), "success": np.zeros(len(left), bool), "terminated": left & (sim.time == 0)}


@pytest.mark.parametrize("worlds", [1, 4])
def test_episodes_without_steps_do_not_end_a_recording(tmp_path, worlds):
    summary = record(tmp_path, OverAtOnce(), episodes=4, num_worlds=worlds, max_attempts=40)
    assert summary.kept == 4 and summary.enough and not summary.interrupted
    assert summary.failures["no success"] >= 1, "the case that this is about"


def test_reward_that_is_not_finite_ends_the_episode(tmp_path):
    class Lost(Cart):
        def evaluate(self, sim):
            found = super().evaluate(sim)
            found["reward"] = np.where(sim.qpos[:, 0] > 0, np.nan, found["reward"])
            return found

    summary = record(tmp_path, Lost(), episodes=2, max_attempts=12)
    assert any("task 'lost': the reward is nan" in why for why in summary.failures)
    assert all(np.isfinite(rows["rewards"]).all() for rows in trajectories(summary))


def test_success_terminates_on_request():
    for asked in (False, True):
        task = Cart()
        env = make(task, terminate_upon_success=asked, horizon=60)
        env.reset(seed=0)
        ended = np.zeros(3, bool)
        for _ in range(40):
            _, _, terminated, _, info = env.step(task.mark[:, None])
            np.testing.assert_array_equal(terminated, info["success"] if asked else np.zeros(3, bool))
            ended |= terminated
        assert ended.any() == asked
        env.close()


def test_the_robot_of_the_scene_and_its_move_groups():
    class Grouped(Cart):
        move_groups = {"wheels": "dri.*"}

    env = make(Grouped)
    assert list(env.action_groups) == ["wheels"]
    observation, _ = env.reset(seed=0)
    assert observation["qpos"]["wheels"].shape == (3, 1)
    env.close()

    class Wrong(Cart):
        move_groups = {"wheels": "drve"}

    with pytest.raises(ValueError, match=r"task 'wrong', move group 'wheels'.*drive"):
        make(Wrong)

    class Armless(Cart):
        robot_entity = "card"

    with pytest.raises(KeyError, match="task 'armless': no robot entity named 'card'; did you mean 'cart'"):
        make(Armless)


def test_a_robot_by_name_joins_the_scene():
    class Watch(mjs.Task):
        robot = "franka"
        objects = {"block": "block/red_block"}

        def scene(self):
            return mjs.SceneCfg(entities={"block": mjs.EntityCfg(model="embedded:objects/red_block.xml")}, terrain=mjs.TerrainCfg())

        def sample(self, rng, world):
            world.place("block/red_block", [0.5, 0, 0.03])
            return [0.1, 0.2, 0, 1, 0, 0, 0]

        def evaluate(self, sim):
            return np.zeros(sim.num_worlds), np.zeros(sim.num_worlds, bool)

    env = make(Watch)
    observation, _ = env.reset(seed=0)
    assert list(env.action_groups) == ["arm", "gripper"] and env.sim.physics_dt == 0.002
    np.testing.assert_allclose(observation["robot_base_pose"], np.tile(np.float32([0.1, 0.2, 0, 1, 0, 0, 0]), (3, 1)))
    assert {"tcp_pose", "obj_start", "grasp_state_block"} <= set(observation)
    env.close()
    with pytest.raises(KeyError, match="did you mean 'franka'"):
        make(Watch, robot="frank")

    class Methodical(Cart):
        def robot(self):  # pyright: ignore[reportIncompatibleVariableOverride]
            """A user's method whose name is also an attribute of Task."""

    with pytest.raises(TypeError, match=r"Methodical\.robot is <bound method .*: must be the name of a robot"):
        make(Methodical)


def test_cpp_planner_on_a_python_task(tmp_path):
    class Lift(mjs.Task):
        """Lift the can."""

        robot = "franka"
        objects = {"pickup_obj": "can/soup_can"}
        graspable = ("can/soup_can",)
        horizon = 150

        def scene(self):
            table = "<mujoco><worldbody><geom type='box' size='.4 .6 .3' pos='.6 0 .3'/></worldbody></mujoco>"
            return mjs.SceneCfg(
                entities={
                    "table": mjs.EntityCfg(model=table, mocap_base=False),
                    "can": mjs.EntityCfg(model="embedded:objects/soup_can.xml"),
                },
                options=mjs.MujocoCfg(cone="elliptic", impratio=10),
            )

        table_height = 0.6

        def sample(self, rng, world):
            world.place("can/soup_can", [0.5 + rng.uniform(-0.05, 0.05), rng.uniform(-0.1, 0.1), 0.6 - self.low + 0.0003])

        def initialize(self, sim):
            body = sim.model.body("can/soup_can")
            geom = sim.model.geom(body.geomadr[0])
            self.low = geom.pos[2] - geom.size[1]
            self.z = np.zeros(sim.num_worlds)
            self.id = body.id

        def begin(self, ids):
            self.z[ids] = self.sim.data.xpos[ids, self.id, 2]

        def evaluate(self, sim):
            height = sim.data.xpos[:, self.id, 2] - self.z
            return height, height > 0.01

    summary = mjs.record(Lift(), policy="planner", out=tmp_path, episodes=2, num_worlds=2, cameras=[])
    assert summary.kept == 2 and summary.succeeded == 2
    rows = trajectories(summary)[0]
    assert rows["success"][-1] and rows["obs/extra/policy_phase"][-1] == 5
    assert json_rows(rows["obs/extra/grasp_state_pickup_obj"])[-1] == {"gripper": {"held": True, "touching": True}}


def test_task_chooses_sensors_and_edits_the_suite(tmp_path):
    class Marked(Cart):
        def sensors(self):
            task = self

            class Mark(mjs.Sensor):
                """Where to go."""

                uuid = "mark"
                observation_space = gymnasium.spaces.Box(-1, 1, (1,), np.float64)

                def compute(self, sim):
                    return task.mark[:, None]

            return [Mark()]

        def suite(self, names):
            self.names = names
            return ["mark", "qpos", "qvel", "actions/commanded_action"]

    task = Marked()
    env = make(task)
    observation, _ = env.reset(seed=0)
    assert list(observation) == ["mark", "qpos", "qvel", "actions/commanded_action"]
    assert task.names[-1] == "mark" and "task_info" in task.names
    np.testing.assert_array_equal(observation["mark"][:, 0], task.mark)
    env.close()
    task = Marked()
    rows = trajectories(record(tmp_path, task, episodes=1))[0]
    assert (rows["obs/extra/mark"].astype(np.float32) == json_rows(rows["actions/commanded_action"])[3]["joints"][0]).all()
    assert "obs/extra/task_info" not in rows

    class Wrong(Cart):
        def suite(self, names):
            return ["qpo"]

    with pytest.raises(KeyError, match="did you mean 'qpos'"):
        make(Wrong)


def test_without_task_sensors_only_those_of_the_caller_remain():
    class Height(mjs.Sensor):
        uuid = "x"
        observation_space = gymnasium.spaces.Box(-2, 2, (1,), np.float64)

        def compute(self, sim):
            return sim.qpos[:, :1]

    env = make(use_sensors=False, sensors=[Height()])
    observation, _ = env.reset(seed=0)
    assert list(observation) == ["x"]
    observation, *_ = env.step(np.zeros((3, 1)))
    np.testing.assert_array_equal(observation["x"], env.sim.qpos[:, :1])
    env.close()


def test_objects_may_change_with_the_episode(tmp_path):
    class Two(Cart):
        def objects(self, world):
            return {"target": ["cart/ball", "cart/cart"][self.which[world]]}

        def initialize(self, sim):
            super().initialize(sim)
            self.which = np.zeros(sim.num_worlds, int)

        def sample(self, rng, world):
            super().sample(rng, world)
            self.which[world.id] = world.episode % 2

    rows = trajectories(record(tmp_path, Two(), episodes=2, policy=lambda obs: np.zeros((2, 1))))
    assert rows[0]["obs/extra/obj_start"][0, 1] == np.float32(0.3) and rows[1]["obs/extra/obj_start"][0, 1] == 0
    assert json.loads(rows[1]["obs_scene"])["referral_expressions"] == {"target": [["cart", 1.0]]}


def broken(**methods):
    return type("Broken", (Cart,), methods)


def raising(self, *args):
    raise ArithmeticError("no")


@pytest.mark.parametrize(
    "methods, error, text, note",
    [
        ({"scene": raising}, ArithmeticError, "no", "in task 'broken': scene()"),
        ({"scene": lambda self: 3}, TypeError, "must return a mjsense.SceneCfg, not 3", "in task 'broken': scene()"),
        ({"initialize": raising}, ArithmeticError, "no", "in task 'broken': initialize()"),
        ({"sample": raising}, ArithmeticError, "no", "in task 'broken': sample()"),
        ({"sample": lambda self, rng, world: [1, 2]}, ValueError, "2 numbers, a pose has 7", None),
        ({"sample": lambda self, rng, world: world.place("cart/bal", [0, 0, 0])}, KeyError, "did you mean 'cart/ball'", "in task 'broken': sample()"),
        ({"sample": lambda self, rng, world: world.place("cart/cart", [0, 0, 0])}, ValueError, "neither free nor a mocap body", None),
        ({"begin": raising}, ArithmeticError, "no", "in task 'broken': begin()"),
        ({"evaluate": raising}, ArithmeticError, "no", "in task 'broken': evaluate()"),
        ({"evaluate": lambda self, sim: (np.zeros(2), np.zeros(3))}, ValueError, r"reward has shape \(2,\), expected \(3,\)", None),
        ({"evaluate": lambda self, sim: 3.0}, TypeError, r"must return \(reward, success\)", "in task 'broken': evaluate()"),
        ({"evaluate": lambda self, sim: {"reward": np.zeros(3)}}, ValueError, "needs reward and success", None),
        ({"evaluate": lambda self, sim: {"reward": np.zeros(3), "success": np.zeros(3), "info": {"x": "y"}}}, ValueError, "info 'x'", None),
        ({"objects": {"ball": "cart/bal"}}, KeyError, "task 'broken', object 'ball': .*did you mean 'cart/ball'", None),
        ({"policy_dt_ms": 21}, ValueError, "policy_dt_ms = 21", None),
        ({"cameras": {"side": "cart/sid"}}, KeyError, "did you mean 'cart/side'", None),
    ],
)  # fmt: skip
def test_errors_name_the_task_and_the_method(methods, error, text, note):
    with pytest.raises(error, match=text) as caught:
        make(broken(**methods), cameras=["side"] if "cameras" in methods else []).reset()
    assert note is None or note in caught.value.__notes__


def test_task_code_cannot_change_the_state(tmp_path):
    class Meddler(Cart):
        def evaluate(self, sim):
            sim.step()

    for play in (lambda: make(Meddler).reset(), lambda: record(tmp_path, Meddler())):
        with pytest.raises(RuntimeError, match=r"step\(\) was called while the simulation is running"):
            play()


def test_task_that_makes_its_scene_accepts_no_other():
    with pytest.raises(ValueError, match="task 'cart' makes its scene itself: it cannot take the scene 'table'"):
        make(scene="table")


def test_by_name():
    mjs.register_task("carting", Cart)
    assert "carting" in mjs.task_names()
    env = mjs.make_vec("carting", cameras=[])
    env.reset(seed=0)
    env.close()
    with pytest.raises(ValueError, match="a task named 'pick' is already registered"):
        mjs.register_task("pick", Cart)
    with pytest.raises(TypeError, match=r"task must be a mjsense\.Task or the name of one"):
        mjs.make_vec(3)


def test_task_is_used_by_one_environment_at_a_time(tmp_path):
    task = Cart()
    env = make(task)
    with pytest.raises(RuntimeError, match="task 'cart' is played already"):
        make(task)
    env.close()
    record(tmp_path, task, episodes=1)
    make(task).close()


@pytest.mark.parametrize("closed", [True, False])
def test_memory_is_freed(closed):
    class Height(mjs.Sensor):
        uuid = "height"
        observation_space = gymnasium.spaces.Box(-2, 2, (1,), np.float64)

        def compute(self, sim):
            return sim.qpos[:, :1]

    task, sensor = Cart(), Height()
    policy = Driver(task)
    env = make(task, policy=policy, sensors=[sensor])
    env.reset(seed=0)
    env.expert_action()
    gone = [weakref.ref(object) for object in (task, policy, sensor, env, env.sim)]
    if closed:
        env.close()
    del env, task, policy, sensor
    gc.collect()
    assert [ref() for ref in gone] == [None] * 5


def test_get_info():
    task = Cart()
    env = make(task)
    env.reset(seed=0)
    env.step(np.zeros((3, 1)))
    info = task.get_info()
    assert len(info) == 3 and set(info[0]) == {"success", "error", "mark", "near"}
    assert info[1]["error"] == pytest.approx(env.sim.qpos[1, 0] - task.mark[1])
    env.close()


def test_evaluate_receives_the_ids_of_the_evaluated_worlds():
    judged = []

    class Told(Cart):
        def evaluate(self, sim, ids):
            judged.append(ids.tolist())
            return super().evaluate(sim)

    env = make(Told, num_envs=2, horizon=2)
    env.reset(seed=0)
    for _ in range(3):
        env.step(np.zeros((2, 1)))
    # After the reset, two steps, and the next reset: each world once an observation.
    assert judged == [[0, 1]] * 4
    env.close()



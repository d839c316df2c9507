# SPDX-License-Identifier: Apache-2.0
from contextlib import closing

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode
from tasks import Cart

import mjsense as mjs


def make(**kwargs):
    return mjs.make_vec(**{"num_envs": 3, "cameras": [], "threads": 2, **kwargs})


@pytest.fixture(scope="module")
def env():
    env = make()
    yield env
    env.close()


def hold(env):
    return np.tile(np.float32([0, -0.7, 0, -2.3, 0, 1.6, 0, 0]), (env.num_envs, 1))


def test_spaces(env):
    assert isinstance(env, mjs.tasks.TaskVectorEnv) and isinstance(env, gymnasium.vector.VectorEnv)
    assert env.metadata["autoreset_mode"] == AutoresetMode.NEXT_STEP
    assert env.action_space.shape == (3, 8) and list(env.action_groups) == ["arm", "gripper"]
    observation, info = env.reset(seed=0)
    assert env.observation_space.contains(observation)
    about = info["episode_info"]
    assert info["_episode_info"].all() and about["number"].tolist() == [0, 1, 2] and about["seed"].tolist() == [0, 0, 0]
    assert about["instruction"].tolist() == env.instructions and about["_object"].all()
    assert all(f"env_states/actors/{name.replace(' ', '_')}" in env.rows for name in about["object"])
    assert observation["tcp_pose"].shape == (3, 7)
    assert env.specs["tcp_pose"].unit.startswith("m")


def test_numbers_by_move_group(env):
    observation, _ = env.reset(seed=0)
    space = env.single_observation_space
    assert space["qpos"]["arm"].shape == (7,) and space["qpos"]["arm"].dtype == np.float32
    assert list(observation["qpos"]) == ["arm", "gripper"]  # a base has no joints
    assert observation["qpos"]["arm"].shape == (3, 7) and (observation["qpos"]["arm"][:, 3] < -1).all()
    assert space["actions/joint_pos"]["gripper"].high == 255
    assert set(observation["env_states"]) == {"actors", "articulations", "present"} and "mug" in observation["env_states"]["actors"]
    given = observation["actions/commanded_action"]["given"]
    assert not given["arm"].any() and observation["actions/ee_pose"]["given"]["arm"].all()
    assert env.specs["qpos/arm"].unit == "rad" and env.rows["qpos/arm"].shape == (3, 7)

    action = hold(env)
    observation = env.step(action)[0]
    assert env.observation_space.contains(observation)
    np.testing.assert_array_equal(observation["actions/commanded_action"]["arm"], action[:, :7])
    assert observation["actions/commanded_action"]["given"]["arm"].all()
    assert observation["grasp_state_pickup_obj"]["gripper"]["held"].dtype == bool


def test_observations_are_chosen_by_sensor_or_stream():
    env = make(num_envs=1, observations=["qpos", "actions/ee_pose/arm", "tcp_pose", "qpos/arm"])
    observation, _ = env.reset(seed=0)
    assert {k: list(v) if isinstance(v, dict) else v.shape for k, v in observation.items()} == {
        "qpos": ["arm", "gripper"], "actions/ee_pose": ["arm"], "tcp_pose": (1, 7)}  # fmt: skip
    env.close()


def test_step_and_copies(env):
    first, _ = env.reset(seed=0)
    second, reward, terminated, truncated, info = env.step(hold(env))
    assert env.observation_space.contains(second)
    assert reward.shape == terminated.shape == truncated.shape == (3,)
    assert not np.shares_memory(first["tcp_pose"], second["tcp_pose"])
    assert not np.shares_memory(second["tcp_pose"], env.rows["tcp_pose"])
    assert info["success"].dtype == bool


def test_same_seed_same_episode(env):
    runs = []
    for _ in range(2):
        env.reset(seed=3)
        runs.append([env.step(hold(env))[0]["tcp_pose"] for _ in range(5)])
    np.testing.assert_array_equal(runs[0], runs[1])
    assert not np.array_equal(env.reset(seed=4)[0]["tcp_pose"], env.reset(seed=3)[0]["tcp_pose"])


def test_truncation_and_autoreset():
    env = make(horizon=4, num_envs=2)
    env.reset(seed=0)
    steps = [env.step(hold(env)) for _ in range(7)]
    assert [step[3].tolist() for step in steps] == [[False] * 2] * 3 + [[True] * 2] + [[False] * 2] * 3
    # The fifth begins anew: nothing was tried that could have succeeded.
    assert [step[4]["_success"].tolist() for step in steps] == [[True] * 2] * 4 + [[False] * 2] + [[True] * 2] * 2
    env.close()


def test_expert_solves_the_task():
    env = make(policy="planner", num_envs=2)
    env.reset(seed=1)
    won = np.zeros(2, bool)
    for _ in range(120):
        *_, info = env.step(env.expert_action())
        won |= info["success"]
        if won.all():
            break
    assert won.all()
    env.close()


@pytest.mark.parametrize("robot", ["rby1", "floating_rum", "mobile_franka"])
def test_groups_that_an_expert_omits_are_unchanged(robot):
    """RB-Y1 stoops as no height of its torso would make it."""
    env = mjs.make_vec("pick", robot=robot, policy="planner", num_envs=1, cameras=[])
    env.reset(seed=1)
    torso = [j for j in range(env.sim.model.njnt) if "torso" in env.sim.model.joint(j).name]
    at = [env.sim.model.jnt_qposadr[j] for j in torso]
    before = env.sim.qpos[0, at].copy()
    for _ in range(10):
        *_, info = env.step(env.expert_action())
        assert "fault" not in info
    assert bool(torso) == (robot == "rby1")
    np.testing.assert_allclose(env.sim.qpos[0, at], before, atol=0.02)
    env.close()


def test_failed_world_has_no_reward():
    class Failing(mjs.Sensor):
        uuid, observation_space = "failing", gymnasium.spaces.Box(-1, 1, (1,))

        def get_observation(self, env, task, batch_index=0):
            if batch_index == 1 and env.mj_datas[1].time > 0.05:
                raise ValueError("lost")
            return np.zeros(1, np.float32)

    class Counting(Cart):
        def evaluate(self, sim):
            return {"reward": 1.0 + sim.time, "success": np.ones(sim.num_worlds, bool)}

    env = mjs.make_vec(Counting, num_envs=2, cameras=[], sensors=[Failing()])
    env.reset(seed=0)
    for step in range(1, 4):
        _, reward, _, truncated, info = env.step(np.zeros(env.action_space.shape, np.float32))
    assert truncated.tolist() == [False, True] and "lost" in info["fault"][1]
    assert reward[0] > 0 and reward[1] == 0 and info["success"].tolist() == [True, False]
    env.close()


def test_cameras_and_render():
    env = make(num_envs=2, cameras=["wrist_camera"], width=32, height=24, observations=["wrist_camera"], render_mode="rgb_array")
    observation, _ = env.reset(seed=0)
    assert list(observation) == ["wrist_camera"] and observation["wrist_camera"].shape == (2, 24, 32, 3)
    assert observation["wrist_camera"].std() > 1
    assert env.render()[1].shape == (24, 32, 3)
    env.close()


def test_bad_use(env):
    env.reset(seed=0)
    for call, error in [
        (lambda: env.step(np.zeros((2, 8))), ValueError),
        (lambda: env.step(np.full((3, 8), np.nan)), ValueError),
        (lambda: env.reset(seed=-1), ValueError),
        (lambda: env.expert_action(), ValueError),
        (lambda: make(observations=["tcp"]), ValueError),
        (lambda: make(task="pik"), KeyError),
        (lambda: make(num_envs=0), ValueError),
        (lambda: make(render_mode="human"), ValueError),
    ]:
        with pytest.raises(error):
            call()
    other = make(num_envs=1)
    with pytest.raises(RuntimeError, match="reset"):
        other.step(np.zeros((1, 8)))
    other.close()
    for call in (lambda: other.step(np.zeros((1, 8))), other.reset, other.expert_action):
        with pytest.raises(RuntimeError, match="closed"):
            call()


def test_step_excludes_other_changes_of_the_simulation():
    """A sensor's code may not change the worlds while the environment steps them, as it may not while the simulation does."""
    env = make()
    said = []

    class Meddler(mjs.Sensor):
        uuid = "meddler"
        observation_space = gymnasium.spaces.Box(0, 1, (1,), np.float32)

        def compute(self, sim):
            try:
                env.sim.reset()
            except RuntimeError as error:
                said.append(str(error))
            return np.zeros((env.num_envs, 1), np.float32)

    env.reset(seed=0)
    meddler = env.sim.add(Meddler())
    assert meddler.data.shape == (3, 1)  # read: from now on part of every step
    env.step(hold(env))
    assert len(said) == 2 and all("reset() was called while the simulation is running" in text for text in said)
    env.close()


@pytest.mark.parametrize(
    "task,robot,text",
    [("open", "franka", "supports picking tasks only; task 'open' is of type 'open'"),
     ("pick", "rby1", "needs a gripper that only the joints of an arm move; robot 'rby1' has none"),
     ("pick", "floating_rum", "robot 'floating_rum' has none")],
)  # fmt: skip
def test_errors_of_the_top_down_planner(task, robot, text):
    with pytest.raises(ValueError, match=text):
        mjs.make_vec(task, robot=robot, policy="top_down_planner", num_envs=1, cameras=[])


def test_top_down_planner_grasps_from_above():
    env = mjs.make_vec("pick", policy="top_down_planner", num_envs=4, cameras=[], observations=["grasp_pose"], seed=1)
    env.reset()
    w, x, y, z = env.rows["grasp_pose"][:, 3:].T
    np.testing.assert_allclose(w * w - x * x - y * y + z * z, -1, atol=1e-3)
    env.close()


def test_normalised_actions_move_the_tool():
    """An action of 1 is the largest displacement, 5 cm; the same commands in their units give the same states."""
    with_range = make(arm_controller="ee_delta_pose", action_space="normalised")
    assert (with_range.single_action_space.low == -1).all() and with_range.single_action_space.shape == (7,)
    before = with_range.reset(seed=3)[0]["tcp_pose"]
    up = np.tile([0, 0, 1, 0, 0, 0, -1], (3, 1))
    still = np.tile([0, 0, 0, 0, 0, 0, -1], (3, 1))
    with_range.step(up)
    for _ in range(15):
        after = with_range.step(still)[0]["tcp_pose"]
    np.testing.assert_allclose(after[:, :3] - before[:, :3], np.tile([0, 0, 0.05], (3, 1)), atol=0.002)
    in_metres = make(arm_controller="ee_delta_pose")
    in_metres.reset(seed=3)
    in_metres.step(up * [0, 0, 0.05, 0, 0, 0, 0])
    for _ in range(15):
        same = in_metres.step(still * [0, 0, 0, 0, 0, 0, 0])[0]["tcp_pose"]
    np.testing.assert_array_equal(same, after)
    with_range.close()
    in_metres.close()


def test_errors_of_action_spaces():
    with pytest.raises(ValueError, match="move group 'arm' have no range"):
        make(arm_controller="ee_pose", action_space="normalised")
    with pytest.raises(ValueError, match="action_space is 'unit': must be one of commands, normalised"):
        make(action_space="unit")
    with pytest.raises(ValueError, match="did you mean 'ee_delta_pose'"):
        make(arm_controller="ee_delta_pse")
    with pytest.raises(ValueError, match="commands joint positions; the controller of move group 'arm'"):
        make(arm_controller="joint_position_relative", policy="planner")


def test_environments_without_a_seed_play_different_episodes():
    """As Gymnasium's: each draws entropy, also the copies of a vector environment, and a seeded one continues its own episodes."""
    options = {"cameras": [], "observations": ["obj_start"], "horizon": 4, "threads": 1}

    def starts(count=2, **more):
        with closing(mjs.make_vec("pick", "franka", num_envs=2, **options, **more)) as worlds:
            return [worlds.reset()[0]["obj_start"] for _ in range(count)]

    assert not np.array_equal(starts(), starts())
    np.testing.assert_array_equal(starts(seed=3), starts(seed=3))
    np.testing.assert_array_equal(starts(seed=0)[0], starts(1, seed=0)[0])
    with closing(gymnasium.make_vec("mjsense/Pick-Franka-v0", num_envs=3, vectorization_mode="sync", **options)) as copies:
        found = copies.reset()[0]["obj_start"]
        assert len(np.unique(found, axis=0)) == 3
        seeded, after = copies.reset(seed=7)[0]["obj_start"], copies.reset()[0]["obj_start"]
        np.testing.assert_array_equal(copies.reset(seed=7)[0]["obj_start"], seeded)
        np.testing.assert_array_equal(copies.reset()[0]["obj_start"], after)
        assert not np.array_equal(seeded, after)
    with closing(mjs.make("pick", "franka", **options)) as env:
        np.testing.assert_array_equal(env.reset(seed=7)[0]["obj_start"], seeded[0])

# SPDX-License-Identifier: Apache-2.0

import gymnasium
import h5py
import numpy as np
import pytest
from tasks import CART, Cart, Driver
from test_own_task import json_rows, record, trajectories

import mjsense as mjs
from mjsense.tasks.policy import FunctionPolicy

HOLD = np.array([0, -0.7, 0, -2.3, 0, 1.6, 0, 0])


def pick(policy, **kwargs):
    return mjs.make_vec("pick", policy=policy, **{"num_envs": 3, "cameras": [], "threads": 2, **kwargs})


def test_a_function_is_a_policy(tmp_path):
    def hold(obs):
        return np.tile(HOLD, (len(obs["tcp_pose"]), 1))

    summary = mjs.record("pick", policy=hold, out=tmp_path, episodes=1, horizon=3, cameras=[], keep_failures=True)
    rows = trajectories(summary)[0]
    commands = json_rows(rows["actions/commanded_action"])
    assert commands[0] == {} and commands[3]["arm"] == pytest.approx(HOLD[:7]) and commands[3]["gripper"] == [0]
    with h5py.File(next(summary.path.glob("*.h5"))) as file:
        settings = file.attrs["recording"]
    assert '"policy":"hold"' in settings


def test_policy_receives_the_observations_of_the_environment():
    seen = []

    class Look(mjs.Policy):
        def act(self, obs):
            seen.append(obs)
            return np.tile(HOLD, (self.num_worlds, 1))

    env = pick(Look)
    observation, _ = env.reset(seed=0)
    env.expert_action()

    def same(one, other):
        assert one.keys() == other.keys()
        for key in one:
            if isinstance(one[key], dict):
                same(one[key], other[key])
            else:
                np.testing.assert_array_equal(one[key], other[key])

    same(seen[0], observation)
    assert not seen[0]["qpos"]["arm"].flags.writeable
    observation = env.step(env.expert_action())[0]
    same(seen[0], observation)  # live
    env.close()


def test_policy_selects_its_observations():
    class Look(mjs.Policy):
        observation = ("qpos/arm", "tcp_pose")

        def act(self, obs):
            assert list(obs) == ["qpos", "tcp_pose"] and list(obs["qpos"]) == ["arm"]
            return np.tile(HOLD, (self.num_worlds, 1))

    env = pick(Look)
    env.reset(seed=0)
    env.expert_action()
    env.close()
    Look.observation = ("qpso",)
    with pytest.raises(ValueError, match="did you mean 'qpos'"):
        pick(Look)


def test_action_layout_and_life_cycle():
    calls = []

    class Note(mjs.Policy):
        def initialize(self):
            calls.append("initialize")

        def reset(self, ids):
            calls.append(ids.tolist())

        def act(self, obs):
            calls.append(self.wanted.tolist())
            return np.zeros((3, 8))

    policy = Note()
    env = pick(policy)
    assert policy.action_groups == {"arm": slice(0, 7), "gripper": slice(7, 8)} and policy.num_worlds == 3
    assert policy.action_high[7] == 255 and policy.action_low.shape == (8,)
    env.reset(seed=0)
    env.expert_action()
    env.reset(options={"reset_mask": np.array([False, True, False])})
    assert calls == ["initialize", [0, 1, 2], [True] * 3, [1]]
    env.close()


def test_groups_without_a_command_hold():
    class Close(mjs.Policy):
        def act(self, obs):
            return {"gripper": np.full((3, 1), 255.0), "success": [False, True, False]}

    env = pick(Close)
    first, _ = env.reset(seed=0)
    action = env.expert_action()
    np.testing.assert_allclose(action[:, :7], first["qpos"]["arm"], atol=1e-6)
    assert (action[:, 7] == 255).all()
    env.close()


def test_done_ends_an_episode(tmp_path):
    class Stop(mjs.Policy):
        def reset(self, ids):
            self.left = 5

        def act(self, obs):
            self.left -= 1
            done = np.full(self.num_worlds, self.left == 0)
            return {"action": np.tile(HOLD, (self.num_worlds, 1)), "done": done, "success": ~done}

        def failure(self, world):
            return "tired"

    summary = mjs.record("pick", policy=Stop(), out=tmp_path, episodes=1, cameras=[], keep_failures=True)
    assert summary.lengths == [6] and summary.failures == {"the policy gave up: tired": 1}
    rows = trajectories(summary)[0]
    assert rows["terminated"].tolist() == [False] * 5 + [True] and not rows["truncated"].any()
    commands = json_rows(rows["actions/commanded_action"])
    assert commands[-1]["success"] == [0.0] and commands[-2]["success"] == [1.0]
    assert json_rows(rows["actions/joint_pos"])[-1] == {}

    env = pick(Stop)
    env.reset(seed=0)
    for step in range(5):
        action = env.expert_action()
        terminated = env.step(action, done=env.expert_done)[2]
        assert terminated.all() == (step == 4)
    env.close()


def test_next_chunk_is_requested_when_one_ends(tmp_path):
    class Ramp(mjs.Policy):
        """Four commands at a time."""

        def __init__(self):
            self.asked = []

        def act(self, obs):
            self.asked.append(self.wanted.tolist())
            k = len(self.asked)
            return np.tile(0.1 * k + 0.01 * np.arange(4)[None, :, None], (self.num_worlds, 1, 1))

    policy = Ramp()
    summary = record(tmp_path, Cart(), policy=policy, episodes=2, num_worlds=2, horizon=6)
    assert policy.asked == [[True, True], [True, True]]
    for rows in trajectories(summary):
        commands = [row["joints"][0] for row in json_rows(rows["actions/commanded_action"])[1:]]
        assert commands == pytest.approx([0.1, 0.11, 0.12, 0.13, 0.2, 0.21])

    # Only the world that was reset requests a chunk; the other continues its own.
    policy = Ramp()
    env = mjs.make_vec(Cart(), policy=policy, num_envs=2, cameras=[], autoreset_mode="disabled")
    env.reset(seed=0)
    env.step(env.expert_action())
    env.reset(options={"reset_mask": np.array([False, True])})
    np.testing.assert_allclose(env.expert_action()[:, 0], [0.11, 0.2])
    assert policy.asked == [[True, True], [False, True]]
    env.close()


def test_phases_are_recorded(tmp_path):
    class Staged(mjs.Policy):
        phases = {"wait": 0, "go": 7}

        def act(self, obs):
            self.phase[:] = np.where(obs["qpos"]["joints"][:, 0] > 0, 7, 0)
            self.num_retries += 1
            return np.ones((self.num_worlds, 1))

    rows = trajectories(record(tmp_path, policy=Staged(), episodes=1))[0]
    assert set(rows["obs/extra/policy_phase"]) <= {0, 7} and rows["obs/extra/policy_phase"][-1] == 7
    assert rows["obs/extra/policy_num_retries"].tolist() == list(range(21))
    assert b'"policy_phases":{"wait":0,"go":7}' in rows["obs_scene"]


def test_random_numbers_depend_on_the_episode(tmp_path):
    class Chance(mjs.Policy):
        def act(self, obs):
            return np.array([[self.rng(w).uniform(-1, 1)] for w in range(self.num_worlds)])

    runs = [trajectories(record(tmp_path / str(worlds), policy=Chance(), num_worlds=worlds, seed=3)) for worlds in (1, 3)]
    for one, other in zip(*runs, strict=True):
        np.testing.assert_array_equal(one["actions/commanded_action"], other["actions/commanded_action"])
    assert not np.array_equal(runs[0][0]["actions/commanded_action"], runs[0][1]["actions/commanded_action"])


def test_sensors_of_a_policy(tmp_path):
    class Thinker(Driver):
        def sensors(self):
            policy = self

            class Acts(mjs.Sensor):
                uuid = "acts"
                observation_space = gymnasium.spaces.Box(0, 100, (1,), np.int64)

                def compute(self, sim):
                    return np.full((sim.num_worlds, 1), policy.acts)

            return [Acts()]

    task = Cart()
    rows = trajectories(record(tmp_path, task, policy=Thinker(task), episodes=1))[0]
    assert rows["obs/extra/acts"][:, 0].tolist() == list(range(21))


@pytest.mark.parametrize(
    "value, error, text",
    [
        (None, ValueError, r"policy 'wrong': act\(\) returned None, expected actions of shape \(3, 8\)"),
        (np.zeros((3, 7)), ValueError, r"policy 'wrong': act\(\) returned shape \(3, 7\), expected \(3, 8\), or \(3, H, 8\) for H steps, with the columns arm 7, gripper 1"),
        (np.zeros(8), ValueError, r"returned shape \(8,\)"),
        ({"arm": np.zeros((3, 8))}, ValueError, r"returned 'arm' of shape \(3, 8\), expected \(3, 7\)"),
        ({"arms": np.zeros((3, 7))}, KeyError, "did you mean 'arm'"),
        ({"action": np.zeros((3, 8)), "done": True}, ValueError, r"'done' of shape \(1,\), expected \(3,\)"),
        ({"arm": np.zeros((3, 2, 7)), "gripper": np.zeros((3, 1))}, ValueError, "has 1 step, another group 2"),
        ("up", ValueError, None),
    ],
)  # fmt: skip
def test_errors_say_what_was_expected(value, error, text):
    class Wrong(mjs.Policy):
        def act(self, obs):
            return value

    env = pick(Wrong)
    env.reset(seed=0)
    with pytest.raises(error, match=text):
        env.step(env.expert_action())
    env.close()


def test_an_action_that_is_not_finite_ends_only_its_episode(tmp_path):
    class Breaks(mjs.Policy):
        def reset(self, ids):
            self.step = 0

        def act(self, obs):
            self.step += 1
            actions = np.tile(HOLD, (self.num_worlds, 1))
            if self.step == 3:
                actions[1, 2] = np.nan
            return actions

    options = {"episodes": 3, "num_worlds": 3, "max_attempts": 3, "horizon": 5, "cameras": [], "keep_failures": True}
    summary = mjs.record("pick", policy=Breaks(), out=tmp_path, **options)
    assert sorted(summary.lengths) == [4, 6, 6]  # the robot holds its position in the last step
    outcomes = {e.number: e.outcome for e in mjs.Dataset(tmp_path).episodes}
    assert outcomes[1] == "the policy gave up: policy 'breaks' returned an action that is not finite (arm[2] is nan)"
    assert outcomes[0].startswith("horizon reached") and outcomes[2].startswith("horizon reached")


def test_a_policy_may_hold_some_worlds_or_groups(tmp_path):
    class Holds(mjs.Policy):
        def act(self, obs):
            hold = np.zeros((self.num_worlds, 2), bool)
            hold[0] = [True, False]
            return {"action": np.tile(HOLD, (self.num_worlds, 1)), "hold": hold}

    summary = mjs.record("pick", policy=Holds(), out=tmp_path, episodes=2, num_worlds=2, max_attempts=2, horizon=2, cameras=[], keep_failures=True)
    given = [sorted(json_rows(rows["actions/commanded_action"])[1]) for rows in trajectories(summary)]
    assert given == [["gripper"], ["arm", "gripper"]]

    class Wrong(mjs.Policy):
        def act(self, obs):
            return {"action": np.tile(HOLD, (self.num_worlds, 1)), "hold": np.zeros((self.num_worlds, 3), bool)}

    with pytest.raises(ValueError, match=r"returned 'hold' of shape \(1, 3\), expected \(1,\) or \(1, 2\)"):
        mjs.record("pick", policy=Wrong(), out=tmp_path / "wrong", cameras=[])


def test_errors_of_user_code_name_the_method(tmp_path):
    class Broken(mjs.Policy):
        def act(self, obs):
            raise ArithmeticError("no")

    for play in (lambda: mjs.record("pick", policy=Broken(), out=tmp_path, cameras=[]), lambda: env.expert_action()):
        env = pick(Broken)
        env.reset(seed=0)
        with pytest.raises(ArithmeticError, match="no") as caught:
            play()
        assert caught.value.__notes__ == ["in policy 'broken': act()"]
        env.close()


def test_by_name(tmp_path):
    mjs.register_policy("still", lambda: FunctionPolicy(lambda obs: np.zeros((len(obs["qpos"]["joints"]), 1)), "still"))
    assert "still" in mjs.policy_names()
    assert record(tmp_path, policy="still", episodes=1).kept == 1
    with pytest.raises(ValueError, match="a policy named 'planner' is already registered"):
        mjs.register_policy("planner", Driver)
    with pytest.raises(TypeError, match=r"policy must be a mjsense\.Policy, a function, or the name of one"):
        mjs.record("pick", policy=3, out=tmp_path)


def test_chunks_that_start_at_different_times_do_not_mix(tmp_path):
    """Commands of a chunk, and groups without a command, are those of the chunk's world."""

    class Chunks(mjs.Policy):
        calls = 0

        def act(self, obs):
            Chunks.calls += 1
            rows = {"arm": np.zeros((self.num_worlds, 4, 1))}
            if Chunks.calls > 1:
                rows["joints"] = rows.pop("arm")
            return rows

    class TwoGroups(Cart):
        move_groups = {"arm": "drive", "joints": "turner"}
        horizon = 8

        def scene(self):
            turn = '<joint name="turn" axis="0 0 1" range="-1 1" damping="1"/>'
            drive = '<position name="turner" joint="turn" kp="1" ctrlrange="-1 1"/>'
            xml = CART.replace('range="-1 1" damping="20"/>', 'range="-1 1" damping="20"/>' + turn)
            return mjs.SceneCfg(entities={"cart": mjs.EntityCfg(model=xml.replace("</actuator>", drive + "</actuator>"))})

        def evaluate(self, sim):
            # World 1 begins anew in the middle of world 0's chunk.
            over = (np.arange(sim.num_worlds) == 1) & (sim.time > 0.03)
            return {"reward": np.zeros(sim.num_worlds), "success": np.ones(sim.num_worlds, bool), "terminated": over}

    summary = mjs.record(TwoGroups(), policy=Chunks(), out=tmp_path, episodes=4, num_worlds=2, cameras=[], keep_failures=True)
    for rows in trajectories(summary):
        commands = json_rows(rows["actions/commanded_action"])[1:]
        for first in range(0, len(commands), 4):
            groups = {tuple(command) for command in commands[first : first + 4] if command}
            assert len(groups) <= 1, commands

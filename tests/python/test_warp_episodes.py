# SPDX-License-Identifier: Apache-2.0
"""make_vec(backend="warp") on Warp's CPU device plays the episodes of the CPU's worlds, and trainers get its tensors."""

import re
from pathlib import Path

import gymnasium
import numpy as np
import pytest

pytest.importorskip("mujoco_warp", reason="mujoco_warp is not installed: pip install 'mjsense[warp]'")
torch = pytest.importorskip("torch", reason="torch is not installed: pip install 'mjsense[torch]'")

import mjsense as mjs


@pytest.fixture(scope="module")
def drive():
    """The task of docs/own_task.md."""
    page = (Path(__file__).parents[2] / "docs/own_task.md").read_text()
    code = re.search(r"^```python\n(.*?)^env = ", page, re.MULTILINE | re.DOTALL)
    names = {"__name__": "page"}
    exec(compile(code[1], "docs/own_task.md", "exec"), names)
    return names["Drive"]


OBSERVED = ["qpos", "qvel", "robot_base_pose", "noisy"]


class Position(mjs.Sensor):
    """Position of the cart, with noise."""

    uuid = "noisy"
    observation_space = gymnasium.spaces.Box(-9, 9, (1,), np.float32)

    def compute(self, sim):
        return sim.scene["noise"].data[:, :1] * 1.0


def noisy(task):
    """The task with a sensor of MuJoCo to which noise is added."""

    class Noisy(task):
        def scene(self):
            velocity = mjs.BuiltinSensorCfg("speed", "jointvel", mjs.ObjRef("joint", "slide", "cart"))
            noise = mjs.EffectSensorCfg("noise", "cart/speed", effects=(mjs.effects.Noise(mjs.effects.Gaussian(0.1)),))
            return mjs.sensors.replace(super().scene(), sensors=(velocity, noise))

    return Noisy()


def environments(task, mode, **options):
    common = {"num_envs": 5, "horizon": 8, "seed": 3, "observations": OBSERVED, "cameras": [], "autoreset_mode": mode, **options}
    return [
        mjs.make_vec(noisy(task), sensors=[Position()], **common),
        mjs.make_vec(noisy(task), sensors=[Position()], backend="warp", device="cpu", **common),
    ]


def same(expected, found, path=""):
    assert expected.keys() == found.keys()
    for name, value in expected.items():
        if isinstance(value, dict):
            same(value, found[name], f"{path}/{name}")
        else:
            assert isinstance(found[name], torch.Tensor) and str(found[name].dtype).endswith(str(value.dtype)), path + name
            np.testing.assert_allclose(found[name].numpy(), value, atol=2e-5, err_msg=path + name)


@pytest.mark.parametrize("mode", ["next_step", "same_step", "disabled"])
def test_episodes_are_those_of_the_cpu(drive, mode):
    cpu, warp = environments(drive, mode)
    assert warp.single_observation_space == cpu.single_observation_space and warp.single_action_space == cpu.single_action_space
    assert warp.specs.keys() == cpu.specs.keys() and warp.horizon == 8
    same(cpu.reset(seed=7)[0], warp.reset(seed=7)[0])
    rng = np.random.default_rng(0)
    ended = finals = 0
    for step in range(30):
        actions = rng.uniform(-1, 1, (5, 1)).astype(np.float32)
        actions[0] = 1  # leaves the track
        expected, found = cpu.step(actions), warp.step(torch.tensor(actions))
        same(expected[0], found[0])
        np.testing.assert_allclose(found[1].numpy(), expected[1], atol=1e-5)
        for ours, theirs in zip(found[2:4], expected[2:4], strict=True):
            np.testing.assert_array_equal(ours.numpy(), theirs, err_msg=f"step {step}")
        over = expected[2] | expected[3]
        ended += over.sum()
        np.testing.assert_array_equal(found[4]["success"], expected[4]["success"])
        if "final_obs" in expected[4]:
            for world in np.flatnonzero(over):
                same(expected[4]["final_obs"][world], found[4]["final_obs"][world])
                finals += 1
        if mode == "disabled" and over.any():
            for env in (cpu, warp):
                env.reset(options={"reset_mask": over})
    assert ended >= 15 and (finals > 0) == (mode == "same_step")
    for env in (cpu, warp):
        assert env.instructions == ["noisy"] * 5
        env.close()


def test_actions_are_clipped_and_checked(drive):
    cpu, warp = environments(drive, "next_step", action_space="normalised", terminate_upon_success=True)
    for env in (cpu, warp):
        env.reset(seed=0)
    for value in (0.3, -5.0, 5.0):
        expected, found = (env.step(np.full((5, 1), value)) for env in (cpu, warp))
        same(expected[0], found[0])
        np.testing.assert_array_equal(found[2].numpy(), expected[2])
    with pytest.raises(ValueError, match=r"actions: shape \(5, 2\), expected \(5, 1\)"):
        warp.step(torch.zeros(5, 2))
    with pytest.raises(ValueError, match=r"actions of worlds \[1\] are not finite"):
        warp.step(torch.tensor([[0.0], [np.nan], [0.0], [0.0], [0.0]]))
    with pytest.raises(NotImplementedError, match="step_chunk"):
        warp.step_chunk(torch.zeros(5, 2, 1))


def test_a_world_that_fails_is_truncated(drive):
    _, warp = environments(drive, "same_step")
    warp.reset()
    warp.sim.qvel[2] = np.nan
    warp.sim.forward()
    assert warp.sim.failures  # reset by forward(); a step reports its own failures
    warp.sim.xfrc_applied[2] = np.nan
    _, _, terminated, truncated, infos = warp.step(torch.zeros(5, 1))
    assert truncated.tolist() == [False, False, True, False, False] and not terminated.any()
    assert "NaN" in infos["final_info"]["fault"][2]


def test_what_is_missing_is_a_clear_error(drive):
    def make(task=drive, **options):
        return mjs.make_vec(task, backend="warp", device="cpu", **options)

    with pytest.raises(
        ValueError, match=r"task 'pick' is not available with backend='warp', which plays tasks written in Python"
    ):
        make("pick")
    with pytest.raises(ValueError, match=r"make_vec\(\): robot, policy are for backend='cpu'"):
        make(robot="franka", policy="planner")
    with pytest.raises(ValueError, match=r"make_vec\(\): device is for backend='warp'"):
        mjs.make_vec(drive, device="cpu")
    with pytest.raises(ValueError, match=r"no sensor or stream 'qpo'; did you mean 'qpos'"):
        make(observations=["qpo"])
    with pytest.raises(ValueError, match=r"device 'cuda:7': there is no such device"):
        mjs.make_vec(drive, backend="warp", device="cuda:7")

    class Broken(drive):
        def evaluate(self, sim):
            return sim.qpos[:2, 0], sim.qpos[:, 0] > 0

    with pytest.raises(ValueError, match=r"task 'broken': reward has shape \(2,\), expected \(4,\): one value a world"):
        make(Broken, num_envs=4).reset()


def test_rsl_rl_learns_without_a_copy_to_the_host(drive, monkeypatch):
    pytest.importorskip("rsl_rl")
    from rsl_rl.runners import OnPolicyRunner

    from mjsense.tasks.rl.rsl import RslRlVecEnv

    class Coarse(drive):
        sim_dt_ms = 20  # a physics step for each control step, because kernels take long to start on the CPU

    torch.manual_seed(0)
    env = mjs.make_vec(
        Coarse,
        num_envs=64,
        backend="warp",
        device="cpu",
        observations=["qpos", "mark"],
        sensors=[Mark()],
        autoreset_mode="same_step",
    )
    worlds = RslRlVecEnv(env, {"policy": None})
    before = played(worlds, lambda observation: torch.zeros(64, 1))
    net = {"class_name": "MLPModel", "hidden_dims": (32, 32), "activation": "elu"}
    runner = OnPolicyRunner(worlds, {
        "num_steps_per_env": 12, "save_interval": 10**9, "logger": "tensorboard", "obs_groups": {"actor": ["policy"], "critic": ["policy"]},
        "actor": {**net, "distribution_cfg": {"class_name": "GaussianDistribution", "init_std": 0.5, "std_type": "scalar"}}, "critic": net,
        "algorithm": {"class_name": "PPO", "learning_rate": 5e-3, "gamma": 0.95, "lam": 0.95, "num_learning_epochs": 8, "num_mini_batches": 2,
                      "clip_param": 0.2, "entropy_coef": 0.0, "value_loss_coef": 1.0, "use_clipped_value_loss": True, "max_grad_norm": 1.0,
                      "schedule": "adaptive", "desired_kl": 0.01},
    }, device="cpu")  # fmt: skip
    runner.learn(10)
    policy = runner.get_inference_policy()
    with torch.inference_mode():
        after = played(worlds, policy)
    print(f"reward {before:.3f} -> {after:.3f}")
    assert after > 0.6 * before  # rewards are negative; chance and standing still give less
    # From the actions to the observations, no tensor goes to the host except masks of worlds.
    copied = []
    original = torch.Tensor.cpu
    monkeypatch.setattr(torch.Tensor, "cpu", lambda tensor, *options: (copied.append(tensor), original(tensor, *options))[1])
    worlds.step(torch.zeros(64, 1))
    assert all(tensor.dtype == torch.bool for tensor in copied)
    worlds.close()


class Mark(mjs.Sensor):
    """Position of the mark."""

    uuid = "mark"
    observation_space = gymnasium.spaces.Box(-9, 9, (1,), np.float32)

    def compute(self, sim):
        return sim.mocap_pos[:, 0, :1]


def played(worlds, policy):
    """Mean reward of 25 steps."""
    total, observation = 0.0, worlds.get_observations()
    for _ in range(25):
        observation, reward, _, _ = worlds.step(policy(observation))
        total += float(reward.mean()) / 25
    return total


def test_stable_baselines3_gets_arrays(drive):
    pytest.importorskip("stable_baselines3")
    from stable_baselines3 import PPO

    from mjsense.tasks.rl.sb3 import SB3VecEnv

    rows = []
    for env in environments(drive, "same_step"):
        worlds = SB3VecEnv(env)
        worlds.seed(5)
        first = worlds.reset()
        for _ in range(8):
            last, reward, done, infos = worlds.step(np.full((5, 1), 0.2, np.float32))
        assert done.all() and isinstance(last, np.ndarray) and isinstance(reward, np.ndarray) and infos[0]["TimeLimit.truncated"]
        rows.append(np.concatenate([first, last, [info["terminal_observation"] for info in infos]]))
        PPO("MlpPolicy", worlds, n_steps=8, batch_size=40, n_epochs=1, seed=0, device="cpu").learn(40)
        worlds.close()
    np.testing.assert_allclose(rows[1], rows[0], atol=2e-5)

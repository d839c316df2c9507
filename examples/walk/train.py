# SPDX-License-Identifier: Apache-2.0
"""Learns to walk, then says how it compares with chance.

pip install mjsense rsl-rl-lib              # or stable-baselines3
python examples/walk/train.py --trainer rsl --iterations 60
"""

import argparse
import json
import time
from pathlib import Path

import numpy as np
import torch
from walk import Walk

import mjsense as mjs

SCALE = 0.25  # rad around the standing pose, for an action of 1


def judge(task, act, worlds=128, steps=500):
    """Mean reward and control steps of the first episode of every world, and the mean error of its velocity, m/s."""
    env = mjs.make_vec(task, num_envs=worlds, observations=["feeling"], cameras=[], autoreset_mode="disabled", seed=1000)
    observation, _ = env.reset()
    reward, lengths, errors, alive = np.zeros(worlds), np.zeros(worlds), np.zeros(worlds), np.ones(worlds, bool)
    for _ in range(steps):
        observation, step_reward, terminated, truncated, _ = env.step(task.stand + SCALE * act(observation["feeling"]))
        speed = np.linalg.norm(env.sim.scene["robot/speed"].data[:, :2] - task.command[:, :2], axis=1)
        reward, lengths, errors = reward + step_reward * alive, lengths + alive, errors + speed * alive
        alive &= ~(terminated | truncated)
    env.close()
    return reward.mean(), lengths.mean(), (errors / lengths).mean()


def with_rsl(task, env):
    """(policy, what trains it for some iterations)"""
    from rsl_rl.runners import OnPolicyRunner

    from mjsense.tasks.rl.rsl import RslRlVecEnv

    torch.manual_seed(0)
    net = {"class_name": "MLPModel", "hidden_dims": (256, 128, 64), "activation": "elu", "obs_normalization": True}
    worlds = RslRlVecEnv(env, action_mean=task.stand, action_scale=SCALE)
    runner = OnPolicyRunner(
        worlds,
        {
            "num_steps_per_env": 24,
            "save_interval": 10**9,
            "logger": "tensorboard",
            "obs_groups": {"actor": ["policy"], "critic": ["policy"]},
            "actor": {**net, "distribution_cfg": {"class_name": "GaussianDistribution", "init_std": 0.5, "std_type": "scalar"}},
            "critic": net,
            "algorithm": {
                "class_name": "PPO",
                "learning_rate": 1e-3,
                "schedule": "adaptive",
                "desired_kl": 0.01,
                "gamma": 0.99,
                "lam": 0.95,
                "entropy_coef": 0.005,
                "num_learning_epochs": 5,
                "num_mini_batches": 4,
                "clip_param": 0.2,
                "value_loss_coef": 1.0,
                "use_clipped_value_loss": True,
                "max_grad_norm": 1.0,
            },
        },
        device="cpu",
    )

    def act(observation):
        from tensordict import TensorDict

        policy = runner.get_inference_policy()
        rows = torch.from_numpy(np.array(observation, np.float32))
        with torch.inference_mode():
            return policy(TensorDict({"policy": rows}, batch_size=[len(rows)])).numpy()

    return act, runner.learn


def with_sb3(task, env):
    """(policy, what trains it for some iterations)"""
    from stable_baselines3 import PPO
    from stable_baselines3.common.vec_env import VecNormalize

    from mjsense.tasks.rl.sb3 import SB3VecEnv

    worlds = VecNormalize(SB3VecEnv(env, action_mean=task.stand, action_scale=SCALE), norm_reward=False)
    # Servos have limits of their own.
    worlds.action_space = type(worlds.action_space)(-10, 10, worlds.action_space.shape, np.float32)
    steps = 24 * env.num_envs
    trainer = PPO(
        "MlpPolicy",
        worlds,
        n_steps=24,
        batch_size=steps // 4,
        n_epochs=5,
        learning_rate=5e-4,
        seed=0,
        device="cpu",
        policy_kwargs={"net_arch": [256, 128, 64], "log_std_init": -0.7},
    )

    def act(observation):
        return trainer.predict(worlds.normalize_obs(observation), deterministic=True)[0]

    return act, lambda iterations: trainer.learn(iterations * steps, reset_num_timesteps=False)


def main():
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--trainer", choices=("rsl", "sb3"), default="rsl")
    options.add_argument("--iterations", type=int, default=100)
    options.add_argument("--worlds", type=int, default=256)
    options.add_argument("--curve", help="file that gets the curve, for curves.py")
    options.add_argument("--model", default="embedded:robots/quadruped.xml", help="MJCF of a quadruped with a Go1's names")
    options = options.parse_args()
    torch.set_num_threads(1)  # small nets: threads that wait for each other cost more than they bring
    rng = np.random.default_rng(0)
    chance = judge(Walk(options.model), lambda observation: rng.normal(size=(len(observation), 12)))
    still = judge(Walk(options.model), lambda observation: np.zeros((len(observation), 12)))
    task = Walk(options.model)
    env = mjs.make_vec(task, num_envs=options.worlds, observations=["feeling"], cameras=[], autoreset_mode="same_step", seed=0)
    act, learn = {"rsl": with_rsl, "sb3": with_sb3}[options.trainer](task, env)
    start, cpu = time.perf_counter(), 0.0  # learning alone, without what judges it
    curve = []
    for done in range(0, options.iterations, 10):
        before = time.process_time()
        learn(min(10, options.iterations - done))
        cpu += time.process_time() - before
        curve.append(
            {"iteration": min(done + 10, options.iterations), "cpu": cpu, "reward": judge(Walk(options.model), act, worlds=32)[0]}
        )
        print("iteration {iteration:4} ({cpu:4.0f} s CPU): reward {reward:6.2f}".format(**curve[-1]), flush=True)
    env.close()
    results = {"random": chance, "standing": still, "learned": judge(Walk(options.model), act)}
    for name, result in results.items():
        print(f"{name:9} reward {result[0]:6.2f}  steps {result[1]:5.0f} of 500  error of velocity {result[2]:.2f} m/s")
    print(f"{time.perf_counter() - start:.0f} s in all")
    if options.curve:
        Path(options.curve).write_text(
            json.dumps({"trainer": options.trainer, "worlds": options.worlds, "results": results, "curve": curve})
        )


if __name__ == "__main__":
    main()

# SPDX-License-Identifier: Apache-2.0
"""Checks of mjsense's policy lerobot:DIR against LeRobot's own code, run with LeRobot's Python.

python lerobot_steps.py rollout CHECKPOINT OUT.npz SEED HORIZON WORLDS: LeRobot's rollout in the environment of lerobot_env_mjsense; saves the
    states [B, T, n] and where episodes end.
python lerobot_steps.py memory CHECKPOINT WORLDS: worlds whose episodes begin at different times receive the actions that LeRobot's
    select_action gives to each of them alone; prints the largest difference.
"""

import sys

import numpy as np
import torch

from mjsense.evaluation.lerobot_policy import LeRobotPolicy

mode, checkpoint = sys.argv[1:3]
policy = LeRobotPolicy(checkpoint, device="cpu")
model, before, after = policy._model, policy._before, policy._after
if hasattr(model, "diffusion"):  # the same noise in every call
    sample = model.diffusion.generate_actions
    noise = torch.randn(1, model.config.horizon, 8, generator=torch.Generator().manual_seed(0))
    model.diffusion.generate_actions = lambda batch, noise_=None, **_: sample(batch, noise=noise.expand(len(batch["observation.state"]), -1, -1))


def rollout(out, seed, horizon, worlds):
    from lerobot.envs.factory import make_env
    from lerobot.processor import PolicyProcessorPipeline
    from lerobot.scripts import lerobot_eval
    from lerobot_env_mjsense import MjsenseEnvConfig

    config = MjsenseEnvConfig(task="pick", env_seed=seed, width=64, height=64, horizon=horizon, options={"shadows": False})
    env = make_env(config, n_envs=worlds)["mjsense"][0]
    nothing = PolicyProcessorPipeline(steps=[])
    found = lerobot_eval.rollout(env, model, nothing, nothing, before, after, seeds=list(range(worlds)), return_observations=True)
    env.close()
    np.savez(out, states=found["observation"]["observation.state"].numpy(), done=found["done"].numpy(), success=found["success"].numpy())


def memory(worlds):
    import mjsense as mjs

    env = mjs.make_vec("pick", num_envs=worlds, width=64, height=64, seed=3, shadows=False)
    env.reset()
    policy._mjs_bind(env.sim, env._rollout.streams(), env._rollout.action_layout())
    inputs, alone, mine, due, chunks = {}, {}, {}, np.zeros(worlds, bool), [[] for _ in range(worlds)]
    for step in range(14):
        begin = [world for world in range(worlds) if step == 0 or (step + 2 * world) % 7 == 0]
        policy._mjs_reset(begin, [step] * len(begin), 0, ["Pick up the mug"] * len(begin))
        for world in begin:
            inputs[world, step] = []
            chunks[world] = []
            alone[world] = (world, step)
        due = np.array([not chunks[world] for world in range(worlds)])
        batches = [policy._batch(np.array([world])) for world in range(worlds)]
        for world in range(worlds):
            inputs[alone[world]].append(batches[world])
        policy.wanted[:] = due
        if due.any():
            answer = policy.act({})["action"]
            for world in np.flatnonzero(due):
                chunks[world] = list(answer[world][: policy.execution_horizon])
        for world in range(worlds):
            mine.setdefault(alone[world], []).append(chunks[world].pop(0))
        env.step(np.stack([mine[alone[world]][-1] for world in range(worlds)]))
    worst = 0.0
    for key, observed in inputs.items():
        model.reset()
        with torch.inference_mode():
            expected = np.stack([after(model.select_action(before(batch))).numpy()[0] for batch in observed])
        worst = max(worst, float(np.abs(expected - np.stack(mine[key])).max()))
    print(f"episodes {len(inputs)}, largest difference {worst:.3g}")
    assert len(inputs) > worlds and worst < 1e-4, worst


if mode == "rollout":
    rollout(sys.argv[3], *map(int, sys.argv[4:7]))
else:
    memory(int(sys.argv[3]))

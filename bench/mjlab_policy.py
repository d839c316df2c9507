# SPDX-License-Identifier: Apache-2.0
"""The reward curve of a training by mjlab's script, and how its last policy does in new episodes.

    build/mjlab/bin/python bench/mjlab_policy.py TASK logs/rsl_rl/EXPERIMENT/RUN [--video walk.mp4]

The curve is that of the run's event file (--agent.logger tensorboard): the mean reward of an episode at eleven times. The policy
then plays 64 environments for 1,000 steps with mjlab's settings for play, without exploration. Printed are the reward of a
second, how many episodes ended early, for tasks with a commanded velocity the mean difference of the velocity from the command,
and the mean command, and for tasks that lift an object in how many environments it came to its goal. The video, drawn by
mjsense, shows the first 10 s. The environment build/mjlab is that of tests/python/test_adapters.py; PYTHONPATH names the folder
of the build.
"""

from __future__ import annotations

import argparse
from dataclasses import asdict
from pathlib import Path
from typing import Any

import mediapy
import mjlab.tasks  # noqa: F401
import numpy as np
import torch
from mjlab.envs import ManagerBasedRlEnv
from mjlab.rl import MjlabOnPolicyRunner, RslRlVecEnvWrapper
from mjlab.tasks.registry import load_env_cfg, load_rl_cfg, load_runner_cls
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

import mjsense.compat.mjlab

ENVIRONMENTS, STEPS, VIDEO_SECONDS = 64, 1000, 10


def print_curve(run: Path) -> None:
    events = EventAccumulator(str(run))
    events.Reload()
    rewards = events.Scalars("Train/mean_reward")
    lengths = {each.step: each.value for each in events.Scalars("Train/mean_episode_length")}
    start = events.FirstEventTimestamp()
    for k in np.linspace(0, len(rewards) - 1, 11).astype(int):
        minutes = (rewards[k].wall_time - start) / 60
        length = lengths[rewards[k].step]
        print(f"{minutes:5.1f} min, iteration {rewards[k].step}: reward {rewards[k].value:.2f}, {length:.0f} steps an episode")


def newest_policy(run: Path) -> Path:
    return max(run.glob("model_*.pt"), key=lambda path: int(path.stem.split("_")[1]))


def velocity_errors(env: Any) -> list[float]:
    """Means of the environments: the differences of the velocity along x and y in m/s and about z in rad/s, and both commands."""
    command = env.command_manager.get_command("twist")
    robot = env.scene["robot"].data
    along = torch.norm(command[:, :2] - robot.root_link_lin_vel_b[:, :2], dim=-1)
    about = (command[:, 2] - robot.root_link_ang_vel_b[:, 2]).abs()
    return [x.mean().item() for x in (along, about, torch.norm(command[:, :2], dim=-1), command[:, 2].abs())]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("task")
    parser.add_argument("run", type=Path)
    parser.add_argument("--video", type=Path)
    arguments = parser.parse_args()
    print_curve(arguments.run)

    mjsense.compat.mjlab.use()
    cfg = load_env_cfg(arguments.task, play=True)
    cfg.scene.num_envs, cfg.seed = ENVIRONMENTS, 1000
    cfg.viewer.width, cfg.viewer.height = 640, 360
    agent = load_rl_cfg(arguments.task)
    raw = ManagerBasedRlEnv(cfg=cfg, device="cpu", render_mode="rgb_array")
    env = RslRlVecEnvWrapper(raw, clip_actions=agent.clip_actions)
    runner = (load_runner_cls(arguments.task) or MjlabOnPolicyRunner)(env, asdict(agent), device="cpu")
    checkpoint = newest_policy(arguments.run)
    runner.load(str(checkpoint), load_cfg={"actor": True}, strict=True, map_location="cpu")
    policy = runner.get_inference_policy(device="cpu")

    frames, rewards, ended, errors, terms = [], [], 0, [], raw.command_manager.active_terms
    reached = torch.zeros(ENVIRONMENTS)
    observation = env.get_observations()
    for step in range(STEPS):
        with torch.no_grad():
            observation, reward, done, extras = env.step(policy(observation))
        rewards.append(reward.mean().item())
        ended += int((done.bool() & ~extras["time_outs"].bool()).sum()) if "time_outs" in extras else int(done.sum())
        if "twist" in terms:
            errors.append(velocity_errors(raw))
        if "lift_height" in terms:
            reached = torch.maximum(reached, raw.command_manager.get_term("lift_height").metrics["at_goal"])
        if arguments.video and step * raw.step_dt < VIDEO_SECONDS:
            frames.append(raw.render())
    seconds = STEPS * raw.step_dt
    print(f"{checkpoint.name} in {ENVIRONMENTS} environments for {seconds:.0f} s each:")
    print(f"reward of a second {sum(rewards) / seconds:.3f}, {ended} episodes ended early")
    if errors:
        along, about, *commands = np.mean(errors, axis=0)
        print(f"difference along x and y: {along:.2f} m/s, where {commands[0]:.2f} are commanded")
        print(f"difference about z: {about:.2f} rad/s, where {commands[1]:.2f} are commanded")
    if "lift_height" in terms:
        print(f"the object came to its goal in {int(reached.sum())} of {ENVIRONMENTS} environments")
    if arguments.video:
        mediapy.write_video(arguments.video, frames, fps=1 / raw.step_dt)


if __name__ == "__main__":
    main()

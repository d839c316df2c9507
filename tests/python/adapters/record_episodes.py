# SPDX-License-Identifier: Apache-2.0
"""mjsense.RecordEpisodes on environments of Gymnasium, gymnasium-robotics, gym-aloha and robosuite, with cameras and attached sensors."""

import subprocess
import sys
import tempfile
import warnings
from pathlib import Path

import gym_aloha  # noqa: F401
import gymnasium
import gymnasium_robotics
import numpy as np
import robosuite
from robosuite.wrappers import GymWrapper

import mjsense as mjs
from mjsense.compat import dm_control

warnings.simplefilter("ignore")
gymnasium.register_envs(gymnasium_robotics)
out = Path(tempfile.mkdtemp())


def recorded(env, name, episodes=2, **options):
    env = mjs.RecordEpisodes(env, out / name, episodes, **options)
    env.action_space.seed(0)
    env.reset(seed=1)
    while not env.recording.complete:
        _, _, terminated, truncated, _ = env.step(env.action_space.sample())
        if np.ndim(terminated) == 0 and (terminated or truncated):
            env.reset()
    env.close()
    done = subprocess.run([sys.executable, "-m", "mjsense", "verify", out / name], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    data = mjs.Dataset(out / name)
    print(name, len(data.episodes), "episodes,", len(data), "rows,", len(data.streams), "streams, success", [e.success for e in data.episodes])
    return data


feet = mjs.ContactSensorCfg(name="feet", primary=mjs.ContactMatch(mode="geom", pattern=("bfoot", "ffoot")), fields=("found",), track_air_time=True)
eye = mjs.CameraSensorCfg(name="eye", camera_name="track", width=32, height=24, data_types=("rgb", "depth"))
data = recorded(gymnasium.make("HalfCheetah-v5", max_episode_steps=20), "cheetah", cameras={"side": "track"}, camera_size=(48, 64), sensors=(feet, eye))
episode = data.episodes[1]
assert data.fps == 20 and episode["obs/extra/feet/found"].any() and episode.video("side")[3].std() > 10
assert {"obs/extra/info/x_position", "obs/extra/info/reward_ctrl"} <= {*data.streams}
vector = gymnasium.make_vec("HalfCheetah-v5", 2, vectorization_mode="sync", max_episode_steps=10)
assert recorded(vector, "cheetahs", 4, cameras=["track"], camera_size=(24, 32), sensors=(feet,)).episodes[3].length == 11
vector = gymnasium.make_vec("CartPole-v1", 3, vectorization_mode="async")
assert len(recorded(vector, "carts", 6).episodes) == 6
data = recorded(gymnasium.make("Pendulum-v1", max_episode_steps=15), "pendulum")
assert data.episodes[0].outcome == "truncated" and data[1]["obs/extra/observation"].shape == (3,)

tip = mjs.BuiltinSensorCfg(name="tip", sensor_type="framepos", obj=mjs.ObjRef("site", "robot0:grip"))
data = recorded(gymnasium.make("FetchReach-v4", max_episode_steps=10), "fetch", sensors=(tip,), cameras={"head": "head_camera_rgb"}, camera_size=(48, 64))
episode = data.episodes[0]
assert np.allclose(episode["obs/extra/tip"], episode["obs/extra/observation/achieved_goal"], atol=1e-6)
assert episode["obs/extra/observation/desired_goal"].shape == (11, 3)
env = gymnasium.make("FrankaKitchen-v1", max_episode_steps=5, tasks_to_complete=["kettle"])
data = recorded(env, "kitchen", 1, cameras={"room": 0}, camera_size=(48, 64))
assert data.episodes[0]["obs/extra/observation/observation"].shape == (6, 59) and data.episodes[0].video("room")[2].std() > 5

dm_control.use()  # draws the observations
arm = mjs.BuiltinSensorCfg(name="grip", sensor_type="framepos", obj=mjs.ObjRef("xbody", "vx300s_left/gripper_link"))
env = gymnasium.make("gym_aloha/AlohaTransferCube-v0", obs_type="pixels_agent_pos", max_episode_steps=3)
data = recorded(env, "aloha", 2, cameras=["top"], camera_size=(48, 64), sensors=(arm,))
assert data.episodes[1]["obs/extra/observation/agent_pos"].shape == (4, 14) and data.episodes[1].video("top")[3].std() > 5

cube = mjs.BuiltinSensorCfg(name="cube", sensor_type="framepos", obj=mjs.ObjRef("xbody", "cube_main"))
lift = robosuite.make("Lift", robots="Panda", has_renderer=False, has_offscreen_renderer=False, use_camera_obs=False, horizon=5)
data = recorded(GymWrapper(lift), "lift", 3, cameras=["agentview"], camera_size=(48, 64), sensors=(cube,))  # makes a new model in each reset
for episode in data.episodes:
    assert episode.length == 6 and 0.8 < episode["obs/extra/cube"][-1, 2] < 0.9 and episode.video("agentview")[3].std() > 5

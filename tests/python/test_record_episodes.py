# SPDX-License-Identifier: Apache-2.0
"""mjsense.RecordEpisodes: recordings of any Gymnasium environment."""

import copy
import gc
import os
import signal
import subprocess
import sys
import time
import warnings
from pathlib import Path

import gymnasium
import mujoco
import numpy as np
import pytest
from gymnasium.vector import AsyncVectorEnv, AutoresetMode, SyncVectorEnv
from program_runs import run_program

import mjsense as mjs
from mjsense.exporting.mapping import Source

spaces = gymnasium.spaces


class Counter(gymnasium.Env):
    """Counts its steps; episodes have `length` steps, and those of odd seeds are truncated. It does not use MuJoCo."""

    metadata = {"render_modes": ["rgb_array"], "render_fps": 20}

    def __init__(self, length=4, render_mode="rgb_array"):
        self.length, self.render_mode, self.episode = length, render_mode, -1
        self.observation_space = spaces.Dict({
            "count": spaces.Discrete(100), "pair": spaces.Tuple((spaces.Box(-1, 1, (2,), np.float32), spaces.MultiBinary(3))),
            "inner": spaces.Dict({"image": spaces.Box(0, 255, (4, 6, 3), np.uint8), "state": spaces.Box(-np.inf, np.inf, (2,), np.float64)}),
        })  # fmt: skip
        self.action_space = spaces.Box(-1, 1, (2,), np.float32)

    def _observation(self):
        return {"count": self.count, "pair": (np.full(2, self.count / 10, np.float32), np.ones(3, np.int8)),
                "inner": {"image": np.full((4, 6, 3), self.count, np.uint8), "state": np.array([self.count, self.episode], float)}}  # fmt: skip

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.episode += 1
        self.count = 0
        return self._observation(), {"start": self.episode}

    def step(self, action):
        self.count += 1
        ends = self.count == self.length
        info = {"distance": self.count / 2, "deep": {"flag": True}, "word": "go", "is_success": ends and self.episode == 0, "object": object()}
        return self._observation(), float(action[0]), ends, False, info

    def render(self):
        return np.full((16, 24, 3), 10 * self.count, np.uint8)


def run(env, steps=1000):
    """Plays until everything is recorded."""
    play(env, steps)
    env.close()


def play(env, steps):
    """Makes at most so many steps."""
    single = not hasattr(env, "num_envs")
    env.reset(seed=5)
    for step in range(steps):
        if env.recording.complete:
            break
        action = np.full(2 if single else (env.num_envs, 2), step % 10 / 10, np.float32)
        _, _, terminated, truncated, _ = env.step(action)
        if single and (terminated or truncated):
            env.reset()


def verified(folder):
    done = run_program("verify", str(folder))
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(autouse=True)
def _quiet():
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=".*the info 'object' is not recorded.*")
        yield


def test_a_single_environment(tmp_path):
    env = mjs.RecordEpisodes(Counter(), tmp_path, 3, cameras={"view": "render"}, settings={"note": 1})
    assert isinstance(env, gymnasium.Wrapper)
    run(env)
    assert "3 episodes, 15 observations, 3 videos" in verified(tmp_path)
    data = mjs.Dataset(tmp_path)
    assert data.fps == 20 and [e.outcome for e in data.episodes] == ["success", "terminated", "terminated"]
    assert [e.seed for e in data.episodes] == [5, 0, 0]
    episode = data.episodes[1]
    assert episode["obs/extra/observation/count"].tolist() == [0, 1, 2, 3, 4]
    assert episode["obs/extra/observation/inner/state"][:, 1].tolist() == [1] * 5
    assert episode["obs/extra/observation/pair/0"][2].tolist() == [np.float32(0.2)] * 2
    assert episode["obs/extra/observation/pair/1"].shape == (5, 3)
    assert episode["obs/extra/observation/inner/image"][3].max() == 3
    actions = episode["actions/action"]
    assert actions[0].tolist() == [0, 0] and np.allclose(actions[1:, 0], episode["rewards"][1:])
    assert episode["terminated"].tolist() == [False] * 4 + [True]
    row = data[7]  # the third of the second episode
    assert row["obs/extra/info/distance"] == 1.0 and row["obs/extra/info/deep/flag"] and row["obs/extra/info/word"] == "go"
    assert abs(int(episode.video("view")[3].mean()) - 30) <= 2


def test_an_export_has_the_observation_without_images_and_the_action(tmp_path):
    with mjs.RecordEpisodes(Counter(), tmp_path, episodes=1) as env:
        env.action_space.seed(0)
        env.reset(seed=0)
        actions = [env.action_space.sample() for _ in range(4)]
        for action in actions:
            env.step(action)
    source = Source(tmp_path)
    rows = source.rows(source.episodes[0])
    assert {name.removeprefix("obs/extra/observation/") for name in source.features["state"].streams} == {"count", "pair/0", "pair/1", "inner/state"}
    count = source.features["state"].parts["count"]
    np.testing.assert_array_equal(rows["state"][:, count].ravel(), range(5))
    np.testing.assert_array_equal(rows["action"], actions)


class Pixels(gymnasium.Env):
    """Random observations of any space; episodes have as many steps as `lengths` says in turn."""

    metadata = {"render_fps": 10}

    def __init__(self, space, lengths=(3, 2)):
        self.observation_space, self.action_space, self.lengths = space, spaces.Box(-1, 1, (2,), np.float32), lengths
        self.episode, self.seen = -1, []

    def _observation(self):
        self.seen.append(self.observation_space.sample())
        return self.seen[-1]

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.episode, self.t = self.episode + 1, 0
        self.observation_space.seed(self.episode)
        return self._observation(), {}

    def step(self, action):
        self.t += 1
        return self._observation(), 0.5, self.t >= self.lengths[self.episode % len(self.lengths)], False, {}


def smooth(shape):
    """Images of one colour each, which a video keeps nearly as they are."""
    class Space(spaces.Box):
        def sample(self, mask=None, probability=None):
            colour = self.np_random.integers(40, 200, 3, np.uint8)
            return np.broadcast_to(colour if shape[2] == 3 else colour[:, None, None], shape).copy()

    return Space(0, 255, shape, np.uint8)


def test_images_of_the_observation_as_videos(tmp_path):
    """Also of channel-first images and of a dict, which also has other entries."""
    space = spaces.Dict({"eye": spaces.Dict({"left": smooth((16, 24, 3)), "right": smooth((3, 16, 24))}), "grey": spaces.Box(0, 255, (9, 9), np.uint8),
                         "x": spaces.Box(-1, 1, (2,), np.float32)})  # fmt: skip
    with mjs.RecordEpisodes(env := Pixels(space), tmp_path / "data", episodes=2, image_videos=True) as recorded:
        run(recorded)
    assert "2 episodes, 7 observations, 4 videos" in verified(tmp_path / "data")
    row = 0
    for episode in mjs.Dataset(tmp_path / "data").episodes:
        left, right = episode.video("eye_left"), episode.video("eye_right")
        for t in range(episode.length):
            seen = env.seen[row]
            assert left[t].shape == right[t].shape == (16, 24, 3)
            assert np.abs(left[t].astype(int) - seen["eye"]["left"]).max() <= 6
            assert np.abs(right[t].astype(int) - seen["eye"]["right"].transpose(1, 2, 0)).max() <= 6
            np.testing.assert_array_equal(episode["obs/extra/observation/x"][t], seen["x"])
            np.testing.assert_array_equal(episode["obs/extra/observation/grey"][t], seen["grey"])
            row += 1
    source = Source(tmp_path / "data")
    assert list(source.cameras) == ["eye_left", "eye_right"] and source.features["state"].streams == ("obs/extra/observation/x",)
    with mjs.RecordEpisodes(Pixels(smooth((16, 24, 3))), tmp_path / "only", episodes=1, image_videos=True) as recorded:
        run(recorded)
    source = Source(tmp_path / "only")
    assert list(source.cameras) == ["observation"] and "state" not in source.features and source.features["action"].size == 2
    with pytest.raises(ValueError, match="two images of the observation would be the video 'a_b'"):
        mjs.RecordEpisodes(Pixels(spaces.Dict({"a_b": smooth((8, 8, 3)), "a": spaces.Dict({"b": smooth((8, 8, 3))})})), tmp_path / "two", episodes=1,
                           image_videos=True).reset()  # fmt: skip


@pytest.mark.parametrize(("space", "size"), (
    (spaces.Box(-1, 1, (2, 3), np.float64), 6), (spaces.Box(0, 255, (8, 9, 3), np.uint8), None), (spaces.Box(0, 255, (3, 8, 9), np.uint8), None),
    (spaces.Box(-1, 1, (0,), np.float32), None), (spaces.Dict({"a": spaces.Box(-1, 1, (0,), np.float32), "b": spaces.Discrete(3)}), 1),
), ids=("matrix", "image", "channel_first", "empty", "partly_empty"))  # fmt: skip
def test_exports_of_observations_that_are_no_vectors(space, size, tmp_path, capsys):
    """A matrix becomes a vector; without numbers there is no state, and images that are left out are named."""
    pq = pytest.importorskip("pyarrow.parquet")
    with mjs.RecordEpisodes(env := Pixels(space), tmp_path / "data", episodes=2) as recorded:
        run(recorded)
    mjs.exporting.export_lerobot(tmp_path / "data", tmp_path / "out")
    table = pq.read_table(tmp_path / "out/data/chunk-000/file-000.parquet").to_pydict()
    assert len(table["action"]) == 5 and ("observation.state" in table) == (size is not None)
    if size == 6:
        np.testing.assert_array_equal(table["observation.state"], [env.seen[i].ravel().astype(np.float32) for i in (0, 1, 2, 4, 5)])
    assert ("is recorded as an array and left out" in capsys.readouterr().err) == (len(space.shape or ()) == 3)
    mjs.exporting.export_robomimic(tmp_path / "data", tmp_path / "robomimic.hdf5")


def test_an_export_says_how_many_episodes_have_no_step(tmp_path, capsys):
    with mjs.RecordEpisodes(Pixels(spaces.Box(-1, 1, (2,), np.float32)), tmp_path / "data", episodes=3, keep_partial=True) as recorded:
        recorded.reset()
        run(recorded)
    assert sorted(e.length for e in mjs.Dataset(tmp_path / "data").episodes) == [1, 3, 4]
    mjs.exporting.export_lerobot(tmp_path / "data", tmp_path / "out")
    assert "1 of 3 episodes have one observation and no step; they are left out" in capsys.readouterr().err


def test_infos_that_cannot_be_stored_are_named_once(tmp_path):
    env = mjs.RecordEpisodes(Counter(), tmp_path, 1, info_bytes=60)
    env.reset()
    with pytest.warns(UserWarning) as told:
        env.step(np.zeros(2, np.float32))
    texts = sorted(str(w.message) for w in told)
    assert "the info 'object' is not recorded: it is neither a number, a text nor an array" in texts[-1]
    assert "of the 60 of info_bytes" in texts[0]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        env.step(np.zeros(2, np.float32))


@pytest.mark.parametrize("mode", list(AutoresetMode))
@pytest.mark.parametrize("kind", [SyncVectorEnv, AsyncVectorEnv])
def test_vector_environments(tmp_path, kind, mode):
    lengths = (3, 4, 6)
    env = kind([lambda n=n: Counter(n) for n in lengths], autoreset_mode=mode)
    cameras = {} if mode == AutoresetMode.SAME_STEP else {"view": "render"}
    env = mjs.RecordEpisodes(env, tmp_path, 6, cameras=cameras)
    assert isinstance(env, mjs.recording.RecordVectorEpisodes) and isinstance(env, mjs.RecordEpisodes)
    assert not isinstance(env.env, mjs.RecordEpisodes)
    env.reset(seed=5)
    for step in range(100):
        if env.recording.complete:
            break
        _, _, terminated, _, _ = env.step(np.full((3, 2), step / 100, np.float32))
        if mode == AutoresetMode.DISABLED and terminated.any():
            env.reset(options={"reset_mask": terminated})
    env.close()
    verified(tmp_path)
    episodes = mjs.Dataset(tmp_path).episodes
    assert len(episodes) == 6 and [e.seed for e in episodes][:3] == [5, 6, 7]
    for episode in episodes:
        length = episode.length - 1
        assert length in lengths
        assert episode["obs/extra/observation/count"].tolist() == list(range(length + 1)), mode
        assert len({*episode["obs/extra/observation/inner/state"][:, 1]}) == 1
        assert episode["terminated"].tolist() == [False] * length + [True]
        assert np.allclose(episode["actions/action"][:, 0], episode["rewards"])
        if cameras:
            assert abs(int(episode.video("view")[length].mean()) - 10 * length) <= 2


def test_episodes_that_are_cut_short(tmp_path):
    for keep in (False, True):
        env = mjs.RecordEpisodes(Counter(), tmp_path / str(keep), 3, keep_partial=keep)
        for _ in range(2):
            env.reset()
            for _ in range(2):
                env.step(np.zeros(2, np.float32))
        env.close()
    assert [e.outcome for e in mjs.Dataset(tmp_path / "True").episodes] == ["the environment was reset", "the environment was closed"]
    assert not list((tmp_path / "False").rglob("*.h5"))


class Pendulum(gymnasium.Env):
    """A MuJoCo environment."""

    metadata = {"render_modes": []}
    frame_skip, dt = 5, 0.01

    def __init__(self):
        self.model = mujoco.MjModel.from_xml_string(
            """<mujoco><worldbody><light pos="0 0 2"/><camera name="side" pos="0 -2 .5" xyaxes="1 0 0 0 0 1"/>
            <geom name="floor" type="plane" size="2 2 .1" pos="0 0 -.2"/><body><joint name="hinge" axis="0 1 0" damping=".01"/>
            <geom name="rod" type="capsule" fromto="0 0 0 .4 0 0" size=".05" rgba="1 0 0 1"/><site name="tip" pos=".4 0 0"/></body></worldbody>
            <actuator><motor joint="hinge"/></actuator></mujoco>"""
        )
        self.data = mujoco.MjData(self.model)
        self.observation_space, self.action_space = spaces.Box(-np.inf, np.inf, (2,)), spaces.Box(-1, 1, (1,), np.float32)

    def _observation(self):
        return np.concatenate([self.data.qpos, self.data.qvel])

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[0] = self.np_random.uniform(-0.1, 0.1)
        mujoco.mj_forward(self.model, self.data)
        return self._observation(), {}

    def step(self, action):
        self.data.ctrl[:] = action
        mujoco.mj_step(self.model, self.data, 5)
        return self._observation(), 0.0, False, bool(self.data.time > 0.0999), {}


@pytest.mark.parametrize("worlds", [0, 2])
def test_cameras_and_sensors_of_a_mujoco_environment(tmp_path, worlds):
    sensors = (
        mjs.BuiltinSensorCfg(name="tip", sensor_type="framepos", obj=mjs.ObjRef("site", "tip")),
        mjs.ContactSensorCfg(name="touch", primary=mjs.ContactMatch(mode="geom", pattern=("rod",)), fields=("found",), track_air_time=True),
        mjs.CameraSensorCfg(name="eye", camera_name="side", width=24, height=16, data_types=("rgb", "depth")),
    )
    env = SyncVectorEnv([Pendulum] * worlds) if worlds else Pendulum()
    env = mjs.RecordEpisodes(env, tmp_path, 4, cameras=["side"], camera_size=(32, 48), sensors=sensors)
    single = not worlds
    env.reset(seed=1)
    while not env.recording.complete:
        _, _, _, truncated, _ = env.step(np.zeros((1,) if single else (worlds, 1), np.float32))
        if single and truncated:
            env.reset()
    env.close()
    verified(tmp_path)
    data = mjs.Dataset(tmp_path)
    assert data.fps == 100 and len(data.episodes) == 4
    for episode in data.episodes:
        assert episode.length == 11
        angle = episode["obs/extra/observation"][:, 0]
        assert np.allclose(episode["obs/extra/tip"][:, 0], 0.4 * np.cos(angle), atol=1e-6)
        assert episode["obs/extra/touch/current_air_time"][-1, 0] == pytest.approx(0.1 if not episode["obs/extra/touch/found"].any() else 0, abs=0.1)
        assert episode.video("side")[0].shape == (32, 48, 3) and episode.video("eye_depth")[0].shape == (16, 24)


class Remade(Pendulum):
    """Makes a new model and data in every reset, as robosuite does."""

    def reset(self, *, seed=None, options=None):
        if self.np_random.random() < 2:
            self.__init__()
        return super().reset(seed=seed, options=options)


def test_an_environment_may_make_its_model_anew(tmp_path):
    tip = mjs.BuiltinSensorCfg(name="tip", sensor_type="framepos", obj=mjs.ObjRef("site", "tip"))
    env = mjs.RecordEpisodes(Remade(), tmp_path, 3, cameras=["side"], camera_size=(16, 16), sensors=(tip,))
    env.reset(seed=0)
    while not env.recording.complete:
        *_, truncated, _ = env.step(np.full(1, 0.5, np.float32))
        if truncated:
            env.reset()
    env.close()
    for episode in mjs.Dataset(tmp_path).episodes:
        assert np.allclose(episode["obs/extra/tip"][:, 0], 0.4 * np.cos(episode["obs/extra/observation"][:, 0]), atol=1e-6)


def made(folder, house):
    tip = mjs.BuiltinSensorCfg(name="tip", sensor_type="framepos", obj=mjs.ObjRef("site", "tip"))
    return mjs.RecordEpisodes(Pendulum(), folder, 2, cameras=["side"], camera_size=(16, 16), sensors=(tip,), house=house)


def test_environments_in_other_processes_record_to_folders_of_their_own(tmp_path):
    env = AsyncVectorEnv([lambda house=house: made(tmp_path, house) for house in range(2)])
    env.reset(seed=3)
    for _ in range(23):
        env.step(np.zeros((2, 1), np.float32))
    env.close()
    verified(tmp_path)
    data = mjs.Dataset(tmp_path)
    assert [(e.house, e.length, e.seed) for e in data.episodes] == [(0, 11, 3), (0, 11, 0), (1, 11, 4), (1, 11, 0)]
    assert data.episodes[3].video("side")[10].shape == (16, 16, 3) and data.episodes[3]["obs/extra/tip"].shape == (11, 3)


SCRIPT = """
import sys, time, warnings
sys.path[:0] = {tests!r}
warnings.simplefilter("ignore")
import numpy as np, mjsense as mjs
from test_record_episodes import Counter
env = mjs.RecordEpisodes(Counter(), sys.argv[1], 8, cameras={{"view": "render"}}, resume=sys.argv[2] == "resume", batches=2)
env.reset()
while not env.recording.complete:
    _, _, ended, _, _ = env.step(np.zeros(2, np.float32))
    if ended:
        env.reset()
        print(env.recording.kept, flush=True)
        if sys.argv[2] == "slow":
            time.sleep(0.1)
env.close()
"""


def test_a_killed_recording_is_resumed(tmp_path):
    script = SCRIPT.format(tests=[str(folder) for folder in Path(__file__).parents[:2]])
    with subprocess.Popen([sys.executable, "-c", script, tmp_path, "slow"], stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        while int(process.stdout.readline()) < 3:
            pass
        time.sleep(0.05)
        os.kill(process.pid, signal.SIGKILL)
    again = [sys.executable, "-c", script, tmp_path]
    done = subprocess.run([*again, "new"], capture_output=True, text=True, check=False)
    assert done.returncode and "has a recording: pass resume=True to continue it" in done.stderr
    done = subprocess.run([*again, "resume"], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "8 episodes, 40 observations" in verified(tmp_path)
    assert [e.length for e in mjs.Dataset(tmp_path).episodes] == [5] * 8


@pytest.mark.parametrize("make", [Counter, lambda: SyncVectorEnv([Counter, Counter])], ids=["single", "vector"])
@pytest.mark.parametrize("within", [True, False])
def test_a_recording_that_an_error_ends_is_resumed(tmp_path, make, within):
    """In a ``with`` block, and when the environment is deleted without close()."""
    env = mjs.RecordEpisodes(make(), tmp_path, 5)
    if within:
        with pytest.raises(RuntimeError, match="the arm is lost"), env:
            play(env, 13)
            raise RuntimeError("the arm is lost")
        assert env.recording.kept
    else:
        play(env, 13)
        del env
        gc.collect()
    assert (tmp_path / "house_0/.recording").exists()
    with mjs.RecordEpisodes(make(), tmp_path, 5, resume=True) as env:
        play(env, 100)
    assert "5 episodes, 25 observations" in verified(tmp_path)


def test_a_recording_that_was_published_early_cannot_be_resumed(tmp_path):
    with mjs.RecordEpisodes(Counter(), tmp_path, 5) as env:
        play(env, 13)
    env = mjs.RecordEpisodes(Counter(), tmp_path, 5, resume=True)
    for _ in range(2):
        with pytest.raises(ValueError, match="house_0' was published with 3 of 5 episodes and cannot be continued: choose another folder"):
            env.reset()


@pytest.mark.parametrize("env", [Counter, lambda: SyncVectorEnv([Counter])])
def test_a_recording_environment_cannot_be_copied(env, tmp_path):
    with pytest.raises(TypeError, match=r"cannot be copied or pickled; make one in each process, with house=0, 1, 2"):
        copy.deepcopy(mjs.RecordEpisodes(env(), tmp_path, 1))


@pytest.mark.parametrize("use", [lambda data, out: mjs.check_replay(data), lambda data, out: mjs.render(data, out)])
def test_replay_and_render_say_that_another_environment_cannot_be_simulated(use, tmp_path):
    env = mjs.RecordEpisodes(Counter(), tmp_path / "data", episodes=1, cameras={"view": "render"})
    run(env)
    env.close()
    with pytest.raises(ValueError, match=r"has no data for replay: the environment '.*Counter.*' is not simulated by mjsense"):
        use(tmp_path / "data", tmp_path / "out")


def test_options_of_videos(tmp_path):
    with mjs.RecordEpisodes(Counter(), tmp_path, 1, cameras={"view": "render"}, keyint=4, tune="") as env:
        run(env)
    video = mjs.Dataset(tmp_path).episodes[0]._recording.video
    assert (video["keyint"], video["tune"]) == (4, "")


def test_errors(tmp_path):
    with pytest.raises(TypeError, match="has no MuJoCo `model` and `data`"):
        mjs.RecordEpisodes(Counter(), tmp_path, 1, cameras={"front": "front"})
    with pytest.raises(TypeError, match=r"RecordEpisodes\(\) .*'keyin'.*did you mean 'keyint'"):
        mjs.RecordEpisodes(Counter(), tmp_path, 1, keyin=3)
    with pytest.raises(ValueError, match="keyint is 0: must be at least 1"):
        mjs.RecordEpisodes(Counter(), tmp_path, 1, keyint=0)
    with pytest.raises(ValueError, match="episodes is 0: must be at least 1"):
        mjs.RecordEpisodes(Counter(), tmp_path, 0)
    with pytest.raises(ValueError, match=r"do not see the last state of an episode with AutoresetMode.SAME_STEP"):
        mjs.RecordEpisodes(SyncVectorEnv([Counter], autoreset_mode=AutoresetMode.SAME_STEP), tmp_path, 1, cameras={"view": "render"})
    with pytest.raises(ValueError, match="render_mode='rgb_array'"):
        env = Counter()
        env.render = lambda: None
        mjs.RecordEpisodes(env, tmp_path, 1, cameras={"view": "render"}).reset()
    env = AsyncVectorEnv([Pendulum])
    with pytest.raises(TypeError, match=r"are in other processes.*house=0, 1, 2"):
        mjs.RecordEpisodes(env, tmp_path, 1, cameras=["side"])
    env.close()
    env = Counter()
    env.observation_space = spaces.Text(5)
    with pytest.raises(TypeError, match=r"observation: .*Text.*FilterObservation"):
        mjs.RecordEpisodes(env, tmp_path, 1)
    env = Counter()
    env.action_space = spaces.Text(5)
    with pytest.raises(TypeError, match=r"actions/action: space Text.*TransformAction"):
        mjs.RecordEpisodes(env, tmp_path, 1)
    env = Counter()
    env.step = lambda action: (env._observation(), np.array([1.0, 2.0]), False, False, {})
    recorded = mjs.RecordEpisodes(env, tmp_path / "reward", 1)
    recorded.reset()
    with pytest.raises(ValueError, match=r"the reward has the shape \(2,\), expected one number"):
        recorded.step(np.zeros(2, np.float32))
    env = Pendulum()
    env.observation_space = spaces.Box(-1, 1, (3,))
    with pytest.raises(ValueError, match=r"'observation' has the shape \(2,\), expected \(3,\) as in its space"):
        mjs.RecordEpisodes(env, tmp_path / "shape", 1).reset()

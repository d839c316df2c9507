# SPDX-License-Identifier: Apache-2.0
"""Evaluation of policies: which episodes are played, policies by text, chunks and delays, interruptions, and frozen benchmarks."""

import json
import os

import h5py
import numpy as np
import pytest

import mjsense as mjs
from mjsense.evaluation import Benchmark, create_benchmark, evaluate
from mjsense.evaluation.benchmarks import benchmark_names
from mjsense.evaluation.policies import policy_from

SMALL = {"cameras": [], "progress": False}


def rows(results):
    return [{name: value for name, value in row.items() if name != "position"} for row in results.to_table().to_pylist()]


@pytest.fixture(scope="module")
def planned(tmp_path_factory):
    out = tmp_path_factory.mktemp("planned")
    return out, evaluate("pick", out=out, episodes=3, num_worlds=3, **SMALL)


def test_the_episodes_are_those_of_a_recording_without_noise(planned, tmp_path):
    out, results = planned
    mjs.record("pick", out=tmp_path, num_attempts=3, num_worlds=2, keep_failures=True, action_noise=False, terminate_upon_success=True, **SMALL)
    mine, expected = mjs.Dataset(out).episodes, mjs.Dataset(tmp_path).episodes
    assert [episode.number for episode in mine] == [episode.number for episode in expected] == [0, 1, 2]
    for one, other in zip(mine, expected, strict=True):
        np.testing.assert_array_equal(one.states, other.states)
    assert [row["success"] for row in rows(results)] == [episode.success for episode in expected]
    assert all(row["light"] for row in rows(results))
    about = json.loads((out / "evaluation.json").read_text())
    assert about["policy"]["spec"] == "planner" and about["episodes"] == 3


def test_chosen_episodes_have_the_same_rows_in_any_number_of_worlds(planned, tmp_path):
    assert rows(evaluate("pick", out=tmp_path, episodes=[2, 0], num_worlds=1, **SMALL)) == [row for row in rows(planned[1]) if row["episode"] != 1]


def test_recorded_actions_repeat_the_episodes(planned, tmp_path):
    out, results = planned
    again = evaluate("pick", policy=f"replay:{out}", out=tmp_path / "a", episodes=3, num_worlds=2, **SMALL)
    assert [row["success"] for row in rows(again)] == [row["success"] for row in rows(results)] == [True] * 3
    for one, other in zip(mjs.Dataset(tmp_path / "a").episodes, mjs.Dataset(out).episodes, strict=True):
        # The last targets are known with single precision only.
        np.testing.assert_array_equal(one.states[:-1], other.states[:-1])
    with pytest.raises(ValueError, match=r"replay: .* was recorded with seed = 0, but it would be 4 now"):
        evaluate("pick", policy=f"replay:{out}", out=tmp_path / "b", episodes=1, seed=4, **SMALL)
    with pytest.raises(ValueError, match=r"replay: .* has no episode 3; it has 3 episodes between 0 and 2, of seed 0"):
        evaluate("pick", policy=f"replay:{out}", out=tmp_path / "b", episodes=4, **SMALL)


def test_videos_that_were_left_out_are_rendered_afterwards(tmp_path):
    options = {"policy": "random", "episodes": 2, "num_worlds": 2, "horizon": 4, "width": 32, "height": 24, "progress": False}
    filmed = evaluate("pick", out=tmp_path / "filmed", **options)
    plain = evaluate("pick", out=tmp_path / "plain", videos=False, **options)
    assert rows(plain) == rows(filmed) and not list(tmp_path.glob("plain/*/*.mp4"))
    mjs.render(tmp_path / "plain", tmp_path / "rendered", progress=False)
    videos = {path.name: path.read_bytes() for path in tmp_path.glob("filmed/*/*.mp4")}
    assert len(videos) == 4 and {path.name: path.read_bytes() for path in tmp_path.glob("rendered/*/*.mp4")} == videos
    with pytest.raises(ValueError, match="belongs to a different recording: 'video' was absent and is now"):
        evaluate("pick", out=tmp_path / "plain", resume=True, **options)


class Counting:
    """Moves the first joint by the number of the call and of the action in its chunk."""

    name = "counting"
    observation = ("qpos",)

    def __init__(self, length: int = 0) -> None:
        self.length, self.calls = length, {}

    def fingerprint(self) -> str:
        return f"counting {self.length}"

    def reset(self, world_ids):
        self.calls |= dict.fromkeys(world_ids.tolist(), 0)

    def act(self, observations):
        ids = observations["world_ids"].tolist()
        assert len(observations["instructions"]) == len(observations["qpos"]["arm"]) == len(ids)
        chunk = np.zeros((len(ids), max(self.length, 1), 8))
        chunk[..., 1:7] = [0, 0, -1.5, 0, 1.5, 0]
        for i, world in enumerate(ids):
            self.calls[world] += 1
            chunk[i, :, 0] = 0.01 * self.calls[world] + 0.001 * np.arange(max(self.length, 1))
        return chunk if self.length else chunk[:, 0]


def first_joints(folder):
    with h5py.File(next(folder.glob("house_0/*.h5"))) as file:
        return file["traj_0/obs/extra/policy_latency"][:] if "policy_latency" in file["traj_0/obs/extra"] else None, [
            json.loads(bytes(row).rstrip(b"\0")).get("arm", [None])[0] for row in file["traj_0/actions/commanded_action"][1:]
        ]


@pytest.mark.parametrize("options, expected", [
    ({}, [0.01, 0.011, 0.012, 0.02, 0.021, 0.022]),
    ({"execution_horizon": 2}, [0.01, 0.011, 0.02, 0.021, 0.03, 0.031]),
    # An answer is two steps late: the robot holds its position at first, and then executes what is left of the previous chunk.
    ({"execution_horizon": 2, "latency": 0.13}, [None, None, 0.01, 0.011, 0.02, 0.021]),
    ({"execution_horizon": 1, "ensemble": 0.0}, [0.01, (0.011 + 0.02) / 2, (0.012 + 0.021 + 0.03) / 3, (0.022 + 0.031 + 0.04) / 3]),
], ids=str)  # fmt: skip
def test_chunks_are_executed_as_asked(tmp_path, options, expected):
    evaluate("pick", policy=Counting(3), out=tmp_path, episodes=1, num_worlds=1, horizon=7, **options, **SMALL)
    latency, found = first_joints(tmp_path)
    assert found[: len(expected)] == [value if value is None else pytest.approx(value, abs=1e-6) for value in expected]
    if "latency" in options:
        assert np.nanmax(latency) == np.float32(0.13)


def test_the_same_policy_in_a_loop_of_steps(tmp_path):
    options, arm = {"execution_horizon": 2, "latency": 0.13}, slice(1, 8)
    evaluate("pick", policy=Counting(3), out=tmp_path, episodes=[1, 4], num_worlds=2, horizon=7, **options, **SMALL)
    states = [episode.states for episode in mjs.Dataset(tmp_path).episodes]
    worlds = mjs.make_vec("pick", num_envs=2, policy=mjs.wrap_policy(Counting(3), **options), episodes=[1, 4], seed=0, horizon=7, autoreset_mode="disabled", cameras=[])
    worlds.reset()
    for t in range(1, 8):
        worlds.step(worlds.expert_action(), done=worlds.expert_done)
        np.testing.assert_allclose(worlds.sim.state[:, arm], [rows[t, arm] for rows in states], atol=1e-5)  # actions of environments are float32
    one = mjs.make("pick", policy=mjs.wrap_policy(Counting(3), **options), episodes=[4], seed=0, horizon=7, cameras=[])
    one.reset()
    for t in range(1, 8):
        one.step(one.expert_action())
        np.testing.assert_allclose(one.sim.state[0, arm], states[1][t, arm], atol=1e-5)
    assert mjs.wrap_policy("planner") == "planner"
    with pytest.raises(ValueError, match="policy 'planner' is computed together with its episode"):
        mjs.wrap_policy("planner", latency=0.1)


def test_an_evaluation_is_resumed_after_an_error_of_its_policy(tmp_path):
    options = {"episodes": 4, "num_worlds": 2, "horizon": 6, **SMALL}
    unbroken = evaluate("pick", policy=Counting(), out=tmp_path / "a", **options)

    class Interrupted(Counting):
        """As Counting, until the third call of the second pair of episodes."""

        resets = 0

        def reset(self, world_ids):
            super().reset(world_ids)
            self.resets += len(world_ids)

        def act(self, observations):
            if self.resets == 4 and max(self.calls.values()) == 2:
                raise RuntimeError("the network is gone")
            return super().act(observations)

    with pytest.raises(RuntimeError, match="the network is gone") as raised:
        evaluate("pick", policy=Interrupted(), out=tmp_path / "b", **options)
    assert "resume the evaluation to play the others" in str(raised.value.__notes__)
    offered = "already contains an unfinished recording; resume it, overwrite it, or choose another directory"
    with pytest.raises(ValueError, match=offered) as again:
        evaluate("pick", policy=Counting(), out=tmp_path / "b", **options)
    assert not hasattr(again.value, "__notes__")
    with pytest.raises(ValueError, match="policy"):  # its code is another one
        evaluate("pick", policy=Counting(2), out=tmp_path / "b", resume=True, **options)
    again = evaluate("pick", policy=Counting(), out=tmp_path / "b", resume=True, **options)
    assert rows(again) == rows(unbroken)


def test_an_action_that_is_not_finite_fails_its_episode_only(tmp_path):
    class Broken(Counting):
        def act(self, observations):
            actions = super().act(observations)
            if self.calls[0] == 3:
                actions[observations["world_ids"] == 0] = np.nan
            return actions

    found = rows(evaluate("pick", policy=Broken, out=tmp_path, episodes=2, num_worlds=2, horizon=8, **SMALL))
    assert "not finite" in found[0]["failure"] and "not finite" not in found[1]["failure"], found
    assert found[0]["steps"] < found[1]["steps"] == 8


def test_actions_of_a_wrong_shape_name_the_policy_and_the_episodes(tmp_path):
    class Short:
        def act(self, observations):
            return np.zeros((len(observations["world_ids"]), 5))

    with pytest.raises(ValueError, match=r"policy 'short': act\(\) returned actions of shape \(2, 5\) for the episodes 0, 1; expected \(2, 8\) or"):
        evaluate("pick", policy=Short, out=tmp_path, episodes=2, num_worlds=2, **SMALL)


def test_policies_by_text(tmp_path, monkeypatch):
    (tmp_path / "nets.py").write_text("class Net:\n    def __init__(self, gain=1.0): self.gain = gain\n    def act(self, obs): pass\n")
    assert policy_from(f"{tmp_path}/nets.py:Net", gain=2.0).model.gain == 2.0
    monkeypatch.chdir(tmp_path)
    assert policy_from("python:nets:Net").model.gain == 1.0
    assert policy_from("planner") == "planner"
    for text, message in (
        ("plannr", "did you mean 'planner'"), ("nets.py:Nett", "'nets' has no 'Nett'; did you mean 'Net'"), ("nowhere.py:Net", "there is no file 'nowhere.py'"),
        ("python:nowhere:Net", "there is no module 'nowhere'"), ("python:nets", "expected python:MODULE:CLASS"),
    ):  # fmt: skip
        with pytest.raises(ValueError, match=message):
            policy_from(text)
    with pytest.raises(TypeError, match="Net: got an unexpected keyword argument 'gein'"):
        policy_from("python:nets:Net", gein=1)


def test_random_commands_depend_on_the_episode_only(tmp_path):
    few = {"policy": "random", "episodes": 2, "horizon": 4, **SMALL}
    for name, worlds in (("a", 1), ("b", 2)):
        evaluate("pick", out=tmp_path / name, num_worlds=worlds, **few)
    for one, other in zip(mjs.Dataset(tmp_path / "a").episodes, mjs.Dataset(tmp_path / "b").episodes, strict=True):
        np.testing.assert_array_equal(one.states, other.states)


@pytest.fixture
def benchmark(tmp_path):
    return create_benchmark("pick", out=tmp_path / "bench", episodes=2, split="test", horizon=5, cameras=[], progress=False)


def test_a_benchmark_fixes_its_episodes(benchmark, tmp_path):
    found = {}
    for name, worlds in (("a", 1), ("b", 4), ("c", 16)):
        found[name] = evaluate(benchmark.folder, policy=Counting(), out=tmp_path / name, num_worlds=worlds, progress=False)
    assert rows(found["a"]) == rows(found["b"]) == rows(found["c"])
    one, other = (mjs.Dataset(tmp_path / name).episodes for name in "ac")
    assert [episode.number for episode in one] == benchmark.episodes
    for mine, theirs, start in zip(one, other, mjs.Dataset(benchmark.folder / "starts").episodes, strict=True):
        np.testing.assert_array_equal(mine.states, theirs.states)
        np.testing.assert_array_equal(mine.states[0], start.states[0])
    about = json.loads((tmp_path / "a/evaluation.json").read_text())
    assert about["benchmark"] == {"name": "pick", "checksum": benchmark.checksum}
    with pytest.raises(ValueError, match="it fixes seed, which is given too"):
        evaluate(benchmark.folder, out=tmp_path / "c", seed=3)


def sealed(folder, change):
    """Changes benchmark.json, and makes its checksum fit again."""
    from mjsense.evaluation.benchmarks import _checksum

    path = folder / "benchmark.json"
    table = json.loads(path.read_text())
    change(table)
    path.write_text(json.dumps({**table, "checksum": _checksum(table)}))


def test_a_benchmark_with_other_starts_is_refused(benchmark, tmp_path):
    sealed(benchmark.folder, lambda table: table["recipe"].update(seed=1))
    with pytest.raises(ValueError, match=r"episode 0 does not start as when the benchmark was made: "):
        evaluate(benchmark.folder, out=tmp_path / "a", progress=False)
    assert not (tmp_path / "a").exists()


@pytest.mark.parametrize("change, message", [
    (lambda t: t["recipe"].update(task="/etc/passwd"), "task is '/etc/passwd'; a benchmark can only contain names"),
    (lambda t: t["recipe"].update(scene="../x.toml"), "a benchmark can only contain names"), (lambda t: t["recipe"].update(ffmpeg="sh"), "has the option 'ffmpeg'"),
    (lambda t: t["recipe"].update(cameras=[["x"]]), "cameras is"), (lambda t: t.update(recipe=3), "the recipe is"), (lambda t: t.update(episodes=[1, 0]), "ascending"),
    (lambda t: t.update(episodes=[]), "list of 1 to"), (lambda t: t.update(files={"../x": "sha256"}), "expected names inside the folder"),
    (lambda t: t.update(format=9), "format is 9"), (lambda t: t["recipe"].pop("task"), "has no task"),
], ids=range(10))  # fmt: skip
def test_a_hostile_benchmark_is_refused(tmp_path, change, message):
    table = {"format": 1, "version": "1", "recipe": {"task": "pick"}, "episodes": [0], "files": {}}
    (tmp_path / "benchmark.json").write_text(json.dumps(table))
    sealed(tmp_path, change)
    with pytest.raises(ValueError, match=message):
        Benchmark(tmp_path)


def test_files_of_a_benchmark_are_its_own(benchmark, tmp_path):
    os.symlink("/etc/hostname", benchmark.folder / "starts/house_0/more")
    with pytest.raises(ValueError, match="neither a file nor a folder of a benchmark"):
        evaluate(benchmark.folder, out=tmp_path / "a")
    os.remove(benchmark.folder / "starts/house_0/more")
    with open(next(benchmark.folder.glob("starts/house_0/*.h5")), "ab") as file:
        file.write(b"x")
    with pytest.raises(ValueError, match="was changed: its checksum is not the stated one"):
        evaluate(benchmark.folder, out=tmp_path / "a")


@pytest.mark.parametrize("options, message", [
    ({"episodes": 0}, "episodes is 0"), ({"latency": -1.0, "policy": "random"}, "latency is -1"), ({"execution_horizon": 0, "policy": Counting(3)}, "horizon is 0"),
    ({"execution_horizon": 3}, "'planner' is computed together with its episode"), ({"policy": Counting(3), "execution_horizon": 5}, "chunks of 3 actions"),
], ids=range(5))  # fmt: skip
def test_bad_options(tmp_path, options, message):
    with pytest.raises(ValueError, match=message):
        evaluate("pick", out=tmp_path, **{"episodes": 1, **options}, **SMALL)


@pytest.mark.parametrize("name", benchmark_names())
def test_benchmarks_of_the_package_start_as_when_they_were_made(name):
    benchmark = Benchmark(name)
    assert len(benchmark.episodes) == 50
    del benchmark.episodes[2:]
    benchmark.check_starts()
    benchmark._digests["1"]["state"] = "0"
    with pytest.raises(ValueError, match="episode 1 does not start as when the benchmark was made: the checksum of its state differs"):
        benchmark.check_starts()


def test_a_benchmark_of_the_package_is_named(tmp_path):
    with pytest.raises(mjs.UnknownNameError, match=r"there is no 'benchmark:pik'; did you mean 'benchmark:pick'"):
        evaluate("benchmark:pik", out=tmp_path)

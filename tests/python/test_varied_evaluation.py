# SPDX-License-Identifier: Apache-2.0
"""Evaluations in which one factor differs at a time."""

import numpy as np
import pytest

import mjsense as mjs
from mjsense import commands
from mjsense.evaluation import sensitivity

SMALL = {"episodes": 2, "num_worlds": 2, "horizon": 2, "width": 32, "height": 32, "shadows": False, "crf": 0, "progress": False}


@pytest.fixture(scope="module")
def varied(tmp_path_factory):
    out = tmp_path_factory.mktemp("varied")
    factors = ["light", "light=0.1", "camera", "distractors", "start", "latency=0.1"]
    return out, sensitivity(factors, policy="random", out=out, **SMALL), factors


def first(folder):
    episodes = mjs.Dataset(folder).episodes
    images = np.stack([episode.video("exo_camera_1")[0] for episode in episodes]).astype(float)
    return np.stack([episode["obs/extra/obj_start"][0] for episode in episodes]), [e.states[0] for e in episodes], images, [e.task for e in episodes]


def test_one_factor_differs_at_a_time(varied):
    out, _, factors = varied
    objects, states, images, tasks = first(out / "unchanged")
    moved = {}
    for factor in factors:
        other = first(out / factor)
        np.testing.assert_array_equal(other[0], objects)  # the object of the task lies where it did
        same = all(np.array_equal(a, b) for a, b in zip(states, other[1]))
        assert same == (factor not in ("distractors", "start")), factor
        assert factor in ("distractors", "start") or other[3] == tasks, factor  # paraphrases describe what the robot sees
        moved[factor] = np.abs(other[2] - images).mean()
        assert moved[factor] == 0 if factor == "latency=0.1" else moved[factor] > (2 if "=" not in factor else 0.2), (factor, moved)
    assert moved["light=0.1"] < 0.3 * moved["light"]
    assert np.nanmax(mjs.Dataset(out / "latency=0.1").episodes[0]["obs/extra/policy_latency"]) == np.float32(0.1)


def test_the_table_compares_the_same_episodes(varied):
    out, found, factors = varied
    assert list(found.comparisons) == factors and all(len(one.pairs) == 2 and one.left_out == 0 for one in found.comparisons.values())
    lines = str(found).splitlines()
    assert [line.split()[0] for line in lines[1:-1]] == ["unchanged", *factors] and "0 of 2" in lines[2]
    assert (out / "sensitivity.txt").read_text() == f"{found}\n"


@pytest.mark.parametrize("vary, options, message", [
    (["lihgt"], {}, "'lihgt' is not a factor; did you mean 'light'"), (["latency"], {}, "give seconds, latency=0.1"), (["light=2"], {}, "the strength must be above 0 and at most 1.5"),
    (["instruction=1"], {}, "this factor has no strength"), (["distractors=1.5"], {}, "must be a number of objects from 1 on"),
    (["latency=x"], {}, "must be seconds"), (["camera"], {"cameras": []}, "leave out camera_system, and render cameras"),
    (["distractors"], {"scene": "table", "cameras": []}, "'distractors' changes nothing in this task"),
    (["light"], {"scene": lambda: None}, "needs a registered task, and a robot and a scene by their names or files"),
], ids=range(9))  # fmt: skip
def test_factors_that_a_task_does_not_have(tmp_path, vary, options, message):
    with pytest.raises(ValueError, match=message):
        sensitivity(vary, policy="random", out=tmp_path, **{**SMALL, **options})
    assert not (tmp_path / "unchanged").exists()


def test_the_command(tmp_path, capsys):
    words = ["evaluate", "pick", "--policy", "random", "--episodes", "1", "--horizon", "2", "--width", "16", "--height", "16", "--out", str(tmp_path)]
    assert commands.run([*words, "--vary", "instruction"]) == 0
    assert "instruction  0 of 1" in capsys.readouterr().out
    assert first(tmp_path / "unchanged")[3] != first(tmp_path / "instruction")[3]

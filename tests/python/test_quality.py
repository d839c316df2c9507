# SPDX-License-Identifier: Apache-2.0
"""Figures of episodes: a policy that moves, waits and moves again; picks of the planner; the program."""

import json

import numpy as np
import pytest
from program_runs import run_program
from waiting import MOVES, WAITS, Waiting

import mjsense as mjs
from mjsense.commands import run as run_command


@pytest.fixture(scope="module")
def waiting(tmp_path_factory):
    out = tmp_path_factory.mktemp("waiting")
    mjs.record(
        "pick", policy=Waiting, out=out, horizon=2 * MOVES + WAITS, num_worlds=1, keep_failures=True, cameras=[], action_noise=False
    )
    return out


@pytest.fixture(scope="module")
def picks(tmp_path_factory):
    out = tmp_path_factory.mktemp("picks")
    mjs.record("pick", policy="top_down_planner", out=out, episodes=2, num_worlds=2, width=32, height=24, shadows=False)
    return out


def test_a_wait_is_found(waiting):
    (episode,) = mjs.Dataset(waiting).episodes
    idle = np.flatnonzero(episode.idle)
    # The servos need a few steps until they stand still.
    assert set(range(MOVES + 6, MOVES + WAITS)) <= set(idle) and not set(range(2, MOVES)) & set(idle)
    quality = episode.quality
    assert quality.idle == pytest.approx(episode.idle[1:].mean()) and 0.2 < quality.idle < 0.7
    assert quality.longest_wait == pytest.approx(
        len(idle[(idle > MOVES) & (idle <= MOVES + WAITS + 1)]) / float(episode.fps), abs=0.07
    )
    assert np.isnan(quality.approach) and quality.visibility == {}


def test_picks_from_above(picks):
    for episode in mjs.Dataset(picks).episodes:
        quality = episode.quality
        assert quality.approach < 30 and quality.jerk > 0 and quality.idle < 0.3
        seen = episode["obs/extra/object_image_points/pickup_obj/wrist_camera/num_points"] > 0
        assert quality.visibility["wrist_camera"]["pickup_obj"] == pytest.approx(seen.mean())


def test_jerk_of_two_arms_is_that_of_the_rougher_one(tmp_path):
    mjs.record("pick", "bimanual_yam", out=tmp_path, episodes=1, horizon=8, keep_failures=True, cameras=[])
    (episode,) = mjs.Dataset(tmp_path).episodes
    paths = [episode[f"obs/extra/tcp_pose_{side}"][:, :3].astype(float) for side in ("left", "right")]
    jerks = [np.sqrt(((np.diff(path, 3, axis=0) * float(episode.fps) ** 3) ** 2).sum(1).mean()) for path in paths]
    assert episode.quality.jerk == pytest.approx(max(jerks))


def test_episodes_are_chosen_by_a_function(waiting, picks):
    assert len(mjs.Dataset(picks, where=lambda episode: episode.quality.idle < 0.3).episodes) == 2
    assert not mjs.Dataset(waiting, where=lambda episode: episode.quality.idle < 0.1).episodes


def test_trimmed_episodes(waiting):
    (episode,) = mjs.Dataset(waiting).episodes
    trimmed = mjs.Dataset(waiting, trim_idle=True, delta_timestamps={"obs/agent/qpos": [0, float(1 / episode.fps)]})
    (short,) = trimmed.episodes
    kept = [t for t in range(episode.length) if any((short.states == episode.states[t]).all(1))]
    left_out = sorted(set(range(episode.length)) - set(kept))
    assert len(trimmed) == short.length == len(kept) and 3 < len(left_out) < WAITS
    assert episode.idle[left_out].all() and left_out == list(range(left_out[0], left_out[-1] + 1))
    assert (short["actions/joint_pos/arm"] == episode["actions/joint_pos/arm"][kept]).all()
    arm, before, after = episode["obs/agent/qpos/arm"], left_out[0] - 1, left_out[-1] + 1
    assert np.ptp(arm[before:after], axis=0).max() <= 0.01
    assert (trimmed[before]["obs/agent/qpos/arm"] == arm[[before, after]]).all()
    assert len(list(short.replay())) == short.length
    with pytest.raises(ValueError, match="is trimmed; only the complete episode"):
        short.replay("actions")


def test_moving_objects_and_idle_steps_at_the_end_stay(tmp_path):
    class Still(mjs.Policy):
        """Commands the initial position while an object falls."""

        observation = ("qpos",)

        def act(self, obs):
            arm = np.tile([0, -0.7853, 0, -2.35619, 0, 1.57079, 0], (self.num_worlds, 1))
            return {"arm": arm, "gripper": np.zeros((self.num_worlds, 1))}

    mjs.record(
        "pick", policy=Still, out=tmp_path / "data", horizon=20, num_worlds=1, keep_failures=True, cameras=[], action_noise=False
    )
    (episode,) = mjs.Dataset(tmp_path / "data").episodes
    assert episode.idle[-8:].all() and episode.trimmed().length >= 8
    rows = {"env_states/actors/" + name: values.copy() for name, values in episode["env_states/actors"].items()}
    falling = next(name for name, values in rows.items() if np.isfinite(values).all())
    rows[falling][:, 2] += np.linspace(0, 1, episode.length)
    episode._store.rows.add((episode.index, falling), rows[falling], 0)
    assert episode.trimmed().length == episode.length


def test_program(picks, waiting, capsys):
    assert run_command(["quality", str(picks), "--json"]) == 0
    rows = json.loads(capsys.readouterr().out)
    assert [row["episode"] for row in rows] == [0, 1] and rows[0]["visibility"].keys() == {"wrist_camera", "exo_camera_1"}
    assert run_command(["quality", str(waiting)]) == 0
    assert "longest wait" in capsys.readouterr().out


def test_inspect_with_quality(picks):
    def inspect(*options):
        done = run_program("inspect", str(picks), "--quality", *options)
        assert done.returncode == 0, done.stderr
        return done.stdout

    assert "longest wait" in (text := inspect()) and "2 episodes" in text
    shown = json.loads(inspect("--json"))
    assert shown["streams"] and [row["episode"] for row in shown["quality"]] == [0, 1]

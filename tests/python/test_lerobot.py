# SPDX-License-Identifier: Apache-2.0
"""Exported data sets, read with LeRobot itself in environments of its own (lerobot_environments.py)."""

import json
import os
import re
import subprocess
from fractions import Fraction
from pathlib import Path

import gymnasium
import numpy as np
import pytest
from lerobot_environments import checkers, environment
from scenes import ball_scene
from waiting import MOVES, WAITS, Waiting

pytest.importorskip("av")
pytest.importorskip("pyarrow")

import mjsense as mjs
from mjsense.exporting import Source


class Height(mjs.Sensor):
    """Height and speed of the ball."""

    uuid = "height"
    observation_space = gymnasium.spaces.Box(-10, 10, (2,), np.float64)

    def compute(self, sim):
        return np.stack([sim.qpos[:, 2], sim.qvel[:, 2]], 1)


def map_of(version):
    depth = {"eye_depth": "eye_depth"} if version == "0.6.1" else {}  # others cannot read depth
    return {"state": "obs/extra/height", "action": "obs/extra/height", "cameras": {"eye": "eye"} | depth}


@pytest.fixture(scope="module")
def record(tmp_path_factory):
    """A function that records two episodes of a bouncing ball at a rate, with moving images of 32x16 pixels, and depth."""
    made = {}

    def make(fps, steps):
        if fps not in made:
            camera = mjs.CameraSensorCfg(name="eye", pos=(0, -2, 0.5), quat=(0.7, 0.7, 0, 0), width=32, height=16, data_types=("rgb", "depth"))
            sim = mjs.Simulation(ball_scene(camera), num_worlds=2, decimation=10)
            made[fps] = tmp_path_factory.mktemp("data")
            rng = np.random.default_rng(0)
            with mjs.Recorder(sim, made[fps], [*sim.scene.sensors.values(), Height()], episodes=2, fps=fps) as recorder:
                for world in range(2):
                    recorder.begin_episode(world, episode=world, seed=0)
                recorder.append()
                for _ in range(steps):
                    sim.qvel[:, :3] += rng.normal(size=(2, 3))
                    sim.step()
                    recorder.append()
                for world in range(2):
                    recorder.finish_episode(world, {"task_description": f"Watch ball {world}."})
        return made[fps]

    return make


def expected_of(source, path):
    """The rows and frames that LeRobot must find."""
    columns, tasks = {}, []
    for episode in source.episodes:
        length = episode.length - 1
        rows = source.rows(episode)
        found = {"observation.state": rows["state"][:length].astype(np.float32), "action": rows["action"][:length].astype(np.float32)}
        found |= {f"observation.images.{camera}": source.video(episode, camera)[:length] for camera in source.cameras}
        for name, values in found.items():
            columns.setdefault(name, []).append(values)
        tasks += [episode.task] * length
    np.savez(path, tasks=json.dumps(tasks), **{name: np.concatenate(parts) for name, parts in columns.items()})
    return len(tasks)


def read(version, out, expected, step, tolerance=0, mode=""):
    """What LeRobot finds in the data set ``out``: the last line of lerobot_rows.py."""
    python, path = environment(version)
    words = [python, Path(__file__).parent / "lerobot_rows.py", out, expected, str(step), str(tolerance), *([mode] if mode else [])]
    done = subprocess.run(words, capture_output=True, text=True,
                          env={**os.environ, "PYTHONPATH": path, "HF_HOME": str(expected.parent / "hf"), "HF_HUB_OFFLINE": "1"})  # fmt: skip
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-3000:]
    return json.loads(done.stdout.splitlines()[-1])


@pytest.mark.parametrize("version, format", (("0.4.4", "lerobot"), ("0.6.1", "lerobot"), ("0.3.3", "lerobot21")))
@pytest.mark.parametrize("fps, repeats", ((Fraction(20), 1), (Fraction(500, 33), 1), (Fraction(500, 33), 141)), ids=("20", "15.15", "hour"))
def test_lerobot_reads_every_row_and_frame(record, tmp_path, version, format, fps, repeats):
    if format == "lerobot21" and repeats > 1:
        pytest.skip("each episode has a file")
    environment(version)
    root = record(fps, 200)
    map = map_of(version if repeats == 1 else "")
    rows = expected_of(Source(root, map=map), tmp_path / "expected.npz")
    out = getattr(mjs, f"export_{format}")(root, tmp_path / "out", map=map, episodes=[0, 1] * repeats)
    if repeats > 1:
        (_video,) = out.glob("videos/*/*/*.mp4")
        assert 2 * repeats * 201 / fps > 3700
    result = read(version, out, tmp_path / "expected.npz", 1 if repeats == 1 else 7)
    assert result["rows"] == rows * repeats and result["read"] >= min(rows * repeats, 8000) and result["wrong"] == 0, result
    assert {"mean", "std", "min", "max"} <= set(result["stats"]), result


@pytest.mark.parametrize("version, format", (("0.4.4", "lerobot"), ("0.6.1", "lerobot"), ("0.3.3", "lerobot21")))
def test_lerobot_reads_episodes_without_idle_steps(tmp_path, version, format):
    """Each row has its own frame, although frames between them are left out; the frames are encoded again and differ slightly."""
    environment(version)
    mjs.record("pick_and_place", policy=Waiting, out=tmp_path / "data", episodes=2, num_worlds=2, horizon=2 * MOVES + WAITS, keep_failures=True,
               width=64, height=48, cameras=["wrist_camera"], shadows=False)  # fmt: skip
    source = Source(tmp_path / "data", trim_idle=None)
    assert all(episode.trimmed_steps > 3 for episode in source.episodes)
    rows = expected_of(source, tmp_path / "expected.npz")
    out = getattr(mjs, f"export_{format}")(tmp_path / "data", tmp_path / "out")
    result = read(version, out, tmp_path / "expected.npz", 1, tolerance=5)
    assert result["rows"] == result["read"] == rows and result["wrong"] == 0, result


@pytest.mark.parametrize("version", ("0.4.4", "0.6.1"))
@pytest.mark.parametrize("mode, tolerance", (("stream", 0), ("delete", 8)))
def test_lerobot_streams_and_edits_an_export_at_the_default_rate(record, tmp_path, version, mode, tolerance):
    """Its streaming reader finds frames by the number of the row in the data set; its tools, which encode videos again, by whole rates."""
    environment(version)
    root = record(Fraction(500, 33), 200)
    map = map_of("")
    rows = expected_of(Source(root, map=map), tmp_path / "expected.npz")
    out = mjs.exporting.export_lerobot(root, tmp_path / "out", map=map)
    result = read(version, out, tmp_path / "expected.npz", 1, tolerance, mode)
    assert result["rows"] == (rows // 2 if mode == "delete" else rows) and result["wrong"] == 0, result


@pytest.fixture(scope="module")
def placed(tmp_path_factory):
    """Two episodes of pick_and_place with one small camera; all else is the default."""
    out = tmp_path_factory.mktemp("placed")
    mjs.record("pick_and_place", out=out, episodes=2, num_worlds=2, keep_failures=True, width=96, height=64, cameras=["wrist_camera"])
    return out


# What the programs report that docs/export.md explains; everything else is a defect of the export.
DOCTOR = (
    r"action\[7\]: [\d.]+% of values at (minimum|maximum) \([\d.]+\)",
    r"action\[7\]: stuck/static in \d/2 episodes .*",
    r"action: \d+% of episode \d is consecutive identical actions \(frozen\)",
    r"\d/2 episode\(s\) flagged",
    r"Episode \d: \d+% of action frozen \(consecutive identical\)",
)
FINGERS = {"DISCONTINUITY", "ACTION_STATE_DIVERGENCE_CRASHED", "ACTION_RANGE_MISMATCH_CRASHED"}
NOTES = {"UNITS_INFERRED", "TOO_FEW_EPISODES"}


def run_checker(name, *words):
    """What a program prints about a data set. Its exit code says only how severe the findings are."""
    python, folder, variables = checkers()
    done = subprocess.run([python, folder / name, *words], capture_output=True, text=True, env={**os.environ, **variables})
    assert "Traceback" not in done.stderr, done.stderr[-3000:]
    return done.stdout


@pytest.mark.parametrize("format", ("lerobot", "lerobot21"))
def test_programs_that_check_data_sets_report_what_the_page_explains(placed, tmp_path, format):
    checkers()
    out = mjs.export(placed, tmp_path / "out", format=format)
    report = run_checker("lerobot-doctor", out)
    findings = re.findall(r"^ +- (.*)$", report, re.M)
    assert "[FAIL]" not in report and f"Frames: {json.loads((out / 'meta/info.json').read_text())['total_frames']}" in report, report
    assert [line for line in findings if not any(re.fullmatch(known, line) for known in DOCTOR)] == [], report
    gates = json.loads(run_checker("lerobot-quality-gates", "check", out, "--format", "json"))
    assert {finding["path"] for finding in gates["findings"] if "meta/episodes.json" not in finding["message"]} == {"README.md"}, gates


@pytest.mark.parametrize("state, explained", (("obs/agent/qpos", NOTES | FINGERS), ("obs/agent/qpos/arm", NOTES)), ids=("all", "arm"))
def test_lelint_reports_what_the_page_explains(placed, tmp_path, state, explained):
    checkers()
    action = state.replace("obs/agent/qpos", "actions/joint_pos")
    out = mjs.export(placed, tmp_path / "out", format="lerobot", map={"state": state, "action": action})
    run_checker("lelint", "check", out, "--json", tmp_path / "report.json")
    found = json.loads((tmp_path / "report.json").read_text())["findings"]
    assert {finding["check"] for finding in found} <= explained, found
    assert {finding["joint"] for finding in found if finding["check"] == "DISCONTINUITY"} <= {"7", "8"}, found


TRAIN = """--policy.type=act --policy.device=cpu --policy.push_to_hub=false --policy.pretrained_backbone_weights=null --policy.dim_model=64
--policy.n_heads=4 --policy.dim_feedforward=128 --policy.n_encoder_layers=1 --policy.n_vae_encoder_layers=1 --policy.latent_dim=8
--policy.chunk_size=10 --policy.n_action_steps=10 --policy.optimizer_lr=2e-4 --policy.optimizer_lr_backbone=2e-4 --batch_size=2 --steps=200
--log_freq=20 --num_workers=0 --save_checkpoint=false --wandb.enable=false --dataset.repo_id=local/pick"""


def test_act_trains_on_an_exported_pick(tmp_path):
    """A small ACT, 200 steps: the loss falls, and LeRobot prints no warning. About a minute of CPU time."""
    python, _ = environment("0.4.4")
    mjs.record("pick", out=tmp_path / "data", episodes=2, keep_failures=True, width=96, height=96, cameras=["wrist_camera"], num_worlds=2)
    mjs.exporting.export_lerobot(tmp_path / "data", tmp_path / "lerobot")
    words = [python.parent / "lerobot-train", *TRAIN.split(), f"--dataset.root={tmp_path}/lerobot", f"--output_dir={tmp_path}/act"]
    done = subprocess.run(words, capture_output=True, text=True, env={**os.environ, "HF_HOME": str(tmp_path / "hf"), "HF_HUB_OFFLINE": "1"})
    text = done.stdout + done.stderr
    assert done.returncode == 0, text[-3000:]
    losses = [float(loss) for loss in re.findall(r"loss:([0-9.]+)", text)]
    assert len(losses) == 10 and losses[-1] < 0.3 * losses[0], losses
    assert "warn" not in text.lower(), [line for line in text.splitlines() if "warn" in line.lower()]

# SPDX-License-Identifier: Apache-2.0
"""Recording on Ray. Runs where Ray is installed: pip install "ray>=2.40" fsspec pyarrow"""

import hashlib
import os
import random
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("ray", reason="Ray is not installed")
h5py = pytest.importorskip("h5py")

from mjsense.cluster import Job, export_on_ray, record_on_ray, render_on_ray
from mjsense.cluster import driver as driver_module

import mjsense as mjs

ARGUMENTS = {"task": "pick", "horizon": 12, "keep_failures": True, "width": 32, "height": 24, "worlds": 2, "seed": 5}
EPISODES, ATTEMPTS = 6, 2


def content(root, count=EPISODES):
    """Checksums of everything in the first episodes: datasets and videos by episode."""
    found = {}
    for episode in mjs.Dataset(root).episodes[:count]:
        with h5py.File(episode.path) as file:
            group, sums = file[episode.trajectory], {}
            group.visititems(lambda name, item, sums=sums: sums.update({name: hashlib.sha256(np.asarray(item[()]).tobytes()).hexdigest()}) if isinstance(item, h5py.Dataset) else None)
            for name in group["obs/sensor_data"]:
                video = bytes(group["obs/sensor_data"][name][()]).split(b"\0")[0].decode()
                sums["video " + name] = hashlib.sha256((episode.path.parent / video).read_bytes()).hexdigest()
        found[episode.number] = sums
    return found


@pytest.fixture(scope="module")
def alone(tmp_path_factory):
    out = tmp_path_factory.mktemp("alone")
    mjs.record(**ARGUMENTS, out=out, num_attempts=EPISODES)
    return content(out)


def test_episodes_are_those_of_one_process(alone, tmp_path):
    shown = []
    summary = record_on_ray(Job(str(tmp_path / "out"), ARGUMENTS), episodes=EPISODES - 1, shard_attempts=ATTEMPTS, progress=shown.append)
    assert summary.enough and summary.kept >= EPISODES - 1 and shown[-1].kept == summary.kept
    found = content(tmp_path / "out")
    assert found == {number: alone[number] for number in range(EPISODES - 1)}  # the index leaves out the last one of a shard
    assert mjs.Dataset(tmp_path / "out").episodes[3].number == 3
    with pytest.raises(FileExistsError, match="continue it with resume"):
        record_on_ray(Job(str(tmp_path / "out"), ARGUMENTS), episodes=1, shard_attempts=ATTEMPTS)
    with pytest.raises(ValueError, match="contains a different recording: options"):
        record_on_ray(Job(str(tmp_path / "out"), {**ARGUMENTS, "seed": 6}), episodes=1, shard_attempts=ATTEMPTS, resume=True)


def test_render_and_export_on_ray(tmp_path):
    """Both equal what one process makes, from the index of a recording on Ray."""
    data, ray = tmp_path / "data", pytest.importorskip("ray")
    pytest.importorskip("av")
    options = {"width": 48, "height": 32, "cameras": ["wrist_camera"]}
    ray.init(num_cpus=2, include_dashboard=False, log_to_driver=False, logging_level="ERROR")
    try:
        record_on_ray(Job(str(data), ARGUMENTS), episodes=5, shard_attempts=2)
        summary = render_on_ray(data, tmp_path / "rendered", shard_episodes=2, **options)
        assert summary.enough and summary.kept == 5
        mjs.render(data, tmp_path / "alone", **options)
        assert content(tmp_path / "rendered") == content(tmp_path / "alone")
        with pytest.raises(ValueError, match="contains a different recording: options"):
            render_on_ray(data, tmp_path / "rendered", shard_episodes=2, resume=True, **{**options, "width": 64})
        for format, export in (("lerobot", mjs.export_lerobot), ("lerobot21", mjs.export_lerobot21)):
            made = [export_on_ray(format, data / "index.parquet", tmp_path / f"{format}_ray"), export(data, tmp_path / format)]
            files = [{str(p.relative_to(out)): p.read_bytes() for p in out.rglob("*") if p.is_file()} for out in made]
            assert files[0] == files[1]
        with pytest.raises(ValueError, match="zarr is written by one process"):
            export_on_ray("zarr", data, tmp_path / "zarr")
    finally:
        ray.shutdown()


def test_killed_workers(alone, tmp_path):
    """Workers that are killed at random times lose nothing and add nothing."""
    generator, ended, kills = random.Random(3), threading.Event(), []

    def kill():
        while not ended.wait(generator.uniform(0.2, 0.8)) and len(kills) < 8:
            found = subprocess.run(["pgrep", "-f", "ray::run_shard"], capture_output=True, text=True).stdout.split()
            for pid in found[:1]:
                os.kill(int(pid), signal.SIGKILL)
                kills.append(pid)

    thread = threading.Thread(target=kill)
    thread.start()
    try:
        assert record_on_ray(Job(str(tmp_path / "out"), ARGUMENTS), episodes=EPISODES, shard_attempts=ATTEMPTS).enough
    finally:
        ended.set()
        thread.join()
    assert kills and content(tmp_path / "out") == alone


def test_killed_driver(alone, tmp_path):
    words = ["record", "pick", "--horizon", "12", "--keep-failures", "--size", "32x24", "--worlds", "2", "--seed", "5", "--out", str(tmp_path / "out"),
             "--episodes", str(EPISODES), "--ray", "local", "--shard-attempts", str(ATTEMPTS)]  # fmt: skip
    first = subprocess.Popen([sys.executable, "-m", "mjsense", *words], stderr=subprocess.DEVNULL)
    limit = time.monotonic() + 120
    while not list((tmp_path / "out").glob("shard_*/done.json")) and time.monotonic() < limit:
        time.sleep(0.1)
    first.kill()
    first.wait()
    assert not (tmp_path / "out/index.parquet").exists()
    again = subprocess.run([sys.executable, "-m", "mjsense", *words, "--resume"], capture_output=True, text=True, timeout=300)
    assert again.returncode == 0, again.stderr
    assert content(tmp_path / "out") == alone


def test_user_code_and_errors(tmp_path):
    def fails(obs):
        raise ValueError("no network here")

    with pytest.raises(Exception, match="no network here"):
        record_on_ray(Job(str(tmp_path / "a"), {**ARGUMENTS, "policy": fails}), episodes=1, shard_attempts=1)
    lock = threading.Lock()
    with pytest.raises(TypeError, match="record: policy cannot be sent to the workers"):
        record_on_ray(Job(str(tmp_path / "b"), {**ARGUMENTS, "policy": lambda obs: lock}), episodes=1)
    assert not Path(tmp_path / "b").exists()


@pytest.mark.parametrize("words, message", ((["--shard", "0/2"], "--shard cannot be combined with --ray"), (["--nonsense"], "--nonsense")))
def test_program_reports_wrong_options(tmp_path, words, message):
    done = subprocess.run([sys.executable, "-m", "mjsense", "record", "pick", "--ray", "local", "--out", str(tmp_path / "o"), *words],
                          capture_output=True, text=True, timeout=120)  # fmt: skip
    assert done.returncode == 2 and message in done.stderr and done.stderr.count("\n") == 1


def test_results_without_a_gap():
    results = driver_module._Results.__new__(driver_module._Results)
    results.done = {0: "a", 1: "b", 3: "d"}
    assert results.without_gap() == ["a", "b"]

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
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("ray", reason="Ray is not installed")
h5py = pytest.importorskip("h5py")

import mjsense as mjs
from mjsense.cluster import Job, export_on_ray, exporting, record_on_ray, render_on_ray, tasks
from mjsense.cluster import driver as driver_module
from mjsense.cluster.job import Shard, ShardResult
from mjsense.exporting import FORMATS

ARGUMENTS = {"task": "pick", "horizon": 12, "keep_failures": True, "width": 32, "height": 24, "num_worlds": 2, "seed": 5}
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


def descendants(pid):
    """Ids of the processes that this process and its children started, by command line."""
    parents = {}
    for folder in Path("/proc").glob("[0-9]*"):
        try:
            stat, command = (folder / "stat").read_text(), (folder / "cmdline").read_bytes().decode(errors="replace")
        except OSError:
            continue
        parents[int(folder.name)] = int(stat.rpartition(")")[2].split()[1]), command
    found = {}
    while new := {child: command for child, (parent, command) in parents.items() if child not in found and (parent == pid or parent in found)}:
        found |= new
    return found


def workers_of(pid):
    return [child for child, command in descendants(pid).items() if command.startswith("ray::run_shard")]


def kill(pid):
    try:
        os.kill(pid, signal.SIGKILL)
        return True
    except ProcessLookupError:
        return False


@pytest.fixture(scope="module")
def alone(tmp_path_factory):
    out = tmp_path_factory.mktemp("alone")
    mjs.record(**ARGUMENTS, out=out, num_attempts=EPISODES)
    return content(out)


def test_episodes_are_those_of_one_process(alone, tmp_path):
    shown = []
    direct = mjs.record(**ARGUMENTS, out=tmp_path / "direct", ray="local", episodes=EPISODES, progress=shown.append)
    assert direct.enough and direct.kept == shown[-1].kept >= EPISODES and content(tmp_path / "direct") == alone
    with pytest.raises(ValueError, match="append cannot be combined with ray"):
        mjs.record(**ARGUMENTS, out=tmp_path / "direct", ray="local", append=True)
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
    ray.init("local", num_cpus=2, include_dashboard=False, log_to_driver=False, logging_level="ERROR")
    try:
        record_on_ray(Job(str(data), ARGUMENTS), episodes=5, shard_attempts=2)
        summary = render_on_ray(data, tmp_path / "rendered", shard_episodes=2, **options)
        assert summary.enough and summary.kept == 5
        mjs.render(data, tmp_path / "alone", **options)
        assert content(tmp_path / "rendered") == content(tmp_path / "alone")
        with pytest.raises(ValueError, match="contains a different recording: options"):
            render_on_ray(data, tmp_path / "rendered", shard_episodes=2, resume=True, **{**options, "width": 64})
    finally:
        ray.shutdown()


def files_of(root):
    """Contents of the files of a folder. Of HDF5 files, all arrays and attributes; of Rerun's files, which contain the time, nothing."""
    if root.is_file():
        found = {}
        with h5py.File(root) as file:
            def add(name, item):
                found[name] = {key: np.asarray(value).tolist() for key, value in item.attrs.items()}
                if isinstance(item, h5py.Dataset):
                    found[name] |= {"": item[()].tobytes(), "stored": item.id.get_storage_size(), "links": h5py.h5o.get_info(item.id).rc}

            file.visititems(add)
            return {"data/demo": [*file["data"]], **found, "attributes": dict(file["data"].attrs)}
    return {str(p.relative_to(root)): None if p.suffix == ".rrd" else p.read_bytes() for p in root.rglob("*") if p.is_file()}


class TestExport:
    @pytest.fixture(scope="class")
    def index(self, tmp_path_factory):
        """The index of a recording on Ray of five episodes with depth, and a cluster."""
        ray, data = pytest.importorskip("ray"), tmp_path_factory.mktemp("index") / "data"
        ray.init("local", num_cpus=2, include_dashboard=False, log_to_driver=False, logging_level="ERROR")
        record_on_ray(Job(str(data), {**ARGUMENTS, "depth": True}), episodes=5, shard_attempts=2)
        yield data / "index.parquet"
        ray.shutdown()

    @pytest.mark.parametrize("format", FORMATS)
    def test_it_equals_that_of_one_process(self, format, index, tmp_path, monkeypatch):
        for library in ("av", FORMATS[format].library, *(["rerun_cli"] if format == "rerun" else [])):
            pytest.importorskip(library, reason=f"needs {library}")
        monkeypatch.setattr(exporting, "_CHUNK", 2)  # three parts
        monkeypatch.setattr("mjsense.exporting.rlds._SHARD_BYTES", 50_000)
        shown = []
        (tmp_path / "ray").mkdir()
        ours = export_on_ray(index, tmp_path / "ray/data", format=format, progress=lambda *now: shown.append(now))
        theirs = mjs.export(index, tmp_path / "data", format=format)
        assert files_of(ours) == files_of(theirs) and shown[-1] == (5, 5)
        assert [path.name for path in (tmp_path / "ray").iterdir()] == ["data"]
        for file in ours.glob("*.rrd"):
            program = Path(sys.modules["rerun_cli"].__file__).parent / "rerun"
            compared = subprocess.run([program, "rrd", "compare", "--unordered", file, theirs / file.name], capture_output=True, text=True)
            assert compared.returncode == 0, compared.stderr
        with pytest.raises(FileExistsError, match="exists; name another output"):
            export_on_ray(index, ours, format=format)


@contextmanager
def killed_workers(count):
    """Kills workers at random times. The value is the list of those that were killed."""
    generator, ended, kills = random.Random(3), threading.Event(), []

    def kill_some():
        while not ended.wait(generator.uniform(0.2, 0.8)) and len(kills) < count:
            kills.extend(pid for pid in workers_of(os.getpid())[:1] if kill(pid))

    thread = threading.Thread(target=kill_some)
    thread.start()
    try:
        yield kills
    finally:
        ended.set()
        thread.join()


def test_killed_workers(alone, tmp_path):
    """Workers that are killed at random times lose nothing and add nothing."""
    with killed_workers(8) as kills:
        assert record_on_ray(Job(str(tmp_path / "out"), ARGUMENTS), episodes=EPISODES, shard_attempts=ATTEMPTS).enough
    assert kills and content(tmp_path / "out") == alone


def test_an_evaluation_has_the_same_rows_on_ray(tmp_path):
    options = {"episodes": [1, 2, 7, 11], "cameras": [], "horizon": 40, "num_worlds": 2, "progress": False}
    with killed_workers(2) as kills:
        there = mjs.evaluate("pick", out=tmp_path / "ray", ray="local", **options)
    here = mjs.evaluate("pick", out=tmp_path / "here", **options)
    assert len(kills) == 2 and [row.episode for row in here.rows] == [1, 2, 7, 11]
    assert [repr(row) for row in there.rows] == [repr(row) for row in here.rows]


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


@pytest.mark.skipif(not os.environ.get("MJSENSE_TEST_KILLS"), reason="takes minutes; MJSENSE_TEST_KILLS=50 asks for 50 kills")
def test_random_kills_of_workers_and_driver(tmp_path, capsys):
    """SIGKILL of a random worker or of the driver, again and again; the union is that of one process."""
    wanted, generator, kills = int(os.environ["MJSENSE_TEST_KILLS"]), random.Random(7), {"worker": 0, "driver": 0}
    attempts = max(24, wanted // 2)
    common = ["record", "pick", "--horizon", "4", "--keep-failures", "--size", "32x24", "--worlds", "1", "--seed", "5"]
    words = [*common, "--out", str(tmp_path / "out"), "--episodes", str(attempts), "--max-attempts", str(attempts), "--ray", "local", "--shard-attempts", "1", "-q"]
    subprocess.run([sys.executable, "-m", "mjsense", *common, "--out", str(tmp_path / "alone"), "--num-attempts", str(attempts), "-q", "--no-sheet"],
                   check=True, stdout=subprocess.DEVNULL)  # fmt: skip
    more: list[str] = []
    while True:
        driver = subprocess.Popen([sys.executable, "-m", "mjsense", *words, *more], stderr=subprocess.PIPE, text=True)
        while driver.poll() is None and sum(kills.values()) < wanted:
            time.sleep(generator.uniform(0.1, 1.0))
            found = workers_of(driver.pid)
            if found and generator.random() < 0.15:
                family = descendants(driver.pid)
                driver.kill()
                kills["driver"] += 1
                driver.wait()
                for pid in family:
                    kill(pid)
            elif found:
                kills["worker"] += kill(generator.choice(found))
        error = driver.communicate()[1]
        more = ["--resume"]
        if driver.returncode == 0:
            break
        assert driver.returncode == -signal.SIGKILL, error
    assert content(tmp_path / "out", attempts) == content(tmp_path / "alone", attempts)
    with capsys.disabled():
        print(f"\n{kills}, {attempts} episodes equal")


def test_user_code_and_errors(tmp_path):
    def fails(obs):
        raise ValueError("no network here")

    with pytest.raises(Exception, match="no network here"):
        record_on_ray(Job(str(tmp_path / "a"), {**ARGUMENTS, "policy": fails}), episodes=1, shard_attempts=1)
    lock = threading.Lock()
    with pytest.raises(TypeError, match="record: policy cannot be sent to the workers"):
        record_on_ray(Job(str(tmp_path / "b"), {**ARGUMENTS, "policy": lambda obs: lock}), episodes=1)
    with pytest.raises(mjs.UnknownNameError, match="unknown option 'horizn'; did you mean 'horizon'"):
        record_on_ray(Job(str(tmp_path / "b"), {**ARGUMENTS, "horizn": 3}), episodes=1)
    assert not Path(tmp_path / "b").exists()


def test_local_starts_a_cluster_of_its_own(monkeypatch):
    """Without an address, Ray would join a cluster that runs on this machine."""
    given = {}
    monkeypatch.setattr("ray.is_initialized", lambda: False)
    monkeypatch.setattr("ray.init", lambda **options: given.update(options))
    monkeypatch.setattr("ray.shutdown", lambda: None)
    with tasks.cluster("local"):
        assert given["address"] == "local"


CRASH = """
import os
import mjsense as mjs

class Crash(mjs.Policy):
    name = "crash"

    def act(self, obs):
        with open({log!r}, "a") as log:
            log.write(f"{{os.getpid()}}\\n")
        {defect}
"""
DEFECTS = {
    "SIGSEGV": "os.kill(os.getpid(), 11)",
    "exit code 3": "os._exit(3)",
}


@pytest.mark.parametrize("how", DEFECTS)
def test_a_defect_that_ends_the_process_is_an_error(how, tmp_path, monkeypatch):
    """After four deaths of the same shard. The message names the shard, its attempts, the signal and the line."""
    (tmp_path / "crashing.py").write_text(CRASH.format(log=str(tmp_path / "log"), defect=DEFECTS[how]))
    monkeypatch.syspath_prepend(tmp_path)
    policy = __import__("crashing").Crash
    job = Job(str(tmp_path / "out"), {**ARGUMENTS, "policy": policy, "num_worlds": 1})
    environment = {"env_vars": {"PYTHONPATH": f"{tmp_path}:{os.environ.get('PYTHONPATH', '')}"}}
    with pytest.raises(RuntimeError) as raised:
        record_on_ray(job, episodes=2, max_attempts=2, shard_attempts=2, runtime_env=environment)
    text = str(raised.value)
    assert f"Shard 0 (attempts 0 to 1) ended its process 4 times, the last time with {how}, on " in text
    assert how != "SIGSEGV" or text.endswith(f"a defect: act in line 11 of {tmp_path}/crashing.py"), text
    assert len(set((tmp_path / "log").read_text().split())) == 4  # processes
    sys.modules.pop("crashing")


def test_lost_machines_are_no_defect(alone, tmp_path):
    """The machine that records is lost four times."""
    cluster = pytest.importorskip("ray.cluster_utils").Cluster(initialize_head=True, head_node_args={"num_cpus": 0, "include_dashboard": False})
    lost = []

    def lose(now):
        if workers_of(os.getpid()) and len(lost) < 4:
            lost.append(nodes.pop())
            cluster.remove_node(lost[-1], allow_graceful=False)
            nodes.append(cluster.add_node(num_cpus=1))

    ray = pytest.importorskip("ray")
    nodes = [cluster.add_node(num_cpus=1)]
    ray.init(address=cluster.address, log_to_driver=False, logging_level="ERROR")
    try:
        assert record_on_ray(Job(str(tmp_path / "out"), ARGUMENTS), episodes=2, shard_attempts=2, progress=lose).enough
    finally:
        ray.shutdown()
        cluster.shutdown()
    assert len(lost) == 4
    found = content(tmp_path / "out", 2)
    assert found == {number: alone[number] for number in range(2)}


@pytest.mark.parametrize("words, message", ((["--shard", "0/2"], "--shard cannot be combined with --ray"), (["--nonsense"], "--nonsense")))
def test_program_reports_wrong_options(tmp_path, words, message):
    done = subprocess.run([sys.executable, "-m", "mjsense", "record", "pick", "--ray", "local", "--out", str(tmp_path / "o"), *words],
                          capture_output=True, text=True, timeout=120)  # fmt: skip
    assert done.returncode == 2 and message in done.stderr and done.stderr.count("\n") == 1


def test_results_without_a_gap():
    def result(number, episodes):
        return ShardResult(Shard(number, 2 * number, 2), "", [{}] * episodes, 1, 1, 10)

    results = driver_module._Results([result(1, 1)])
    assert results.kept == 0 and not results.without_gap()
    for number, episodes in ((3, 2), (0, 2)):
        results.add(result(number, episodes))
    assert results.kept == 3 and [found.shard.number for found in results.without_gap()] == [0, 1] and results.succeeded == 3
    assert results.progress(9, 0, 1.0)["steps_per_second"] == 20  # of this driver

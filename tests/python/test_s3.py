# SPDX-License-Identifier: Apache-2.0
"""A recording on Ray in object storage: every command with an s3:// address, on a server of this machine (moto).

The server and s3fs are in a folder of their own, build/s3; MJSENSE_TEST_S3=1 makes it. Runs where Ray is installed.
"""

import os
import shutil
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest

pytest.importorskip("ray", reason="Ray is not installed")
pytest.importorskip("av")

import mjsense as mjs

PACKAGES = Path(__file__).parents[2] / "build/s3"
ARGUMENTS = {"task": "pick", "horizon": 12, "keep_failures": True, "width": 32, "height": 24, "worlds": 2, "seed": 5}
RECORD = ["record", "pick", "--horizon", "12", "--keep-failures", "--size", "32x24", "--worlds", "2", "--seed", "5", "--out", "s3://bucket/pick",
          "--episodes", "4", "--max-attempts", "4", "--ray", "local", "--shard-attempts", "2", "-q"]  # fmt: skip


def listens(port):
    with socket.socket() as client:
        return client.connect_ex(("127.0.0.1", port)) == 0


@pytest.fixture(scope="module")
def cache(tmp_path_factory):
    """Folder of the local copies of remote files."""
    return tmp_path_factory.mktemp("cache")


@pytest.fixture(scope="module")
def run(tmp_path_factory, cache):
    """A function that runs Python with these words, with a bucket ``bucket``, and returns what it prints."""
    if not (PACKAGES / "complete").exists():
        if os.environ.get("MJSENSE_TEST_S3", "0") == "0":
            pytest.skip("needs build/s3; make it: MJSENSE_TEST_S3=1 ./dev test -k test_s3")
        words = ["install", "--quiet", "--disable-pip-version-check", "--retries=1", "--target", PACKAGES, "moto[server]", "s3fs"]
        done = subprocess.run([sys.executable, "-m", "pip", *words], capture_output=True, text=True)
        if done.returncode:
            pytest.skip(f"pip cannot install moto and s3fs: {done.stderr.strip()[-300:]}")
        (PACKAGES / "complete").touch()
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    folder = tmp_path_factory.mktemp("s3")
    path = os.pathsep.join([str(PACKAGES), str(Path(__file__).parent), *filter(None, sys.path)])
    account = {"AWS_ACCESS_KEY_ID": "key", "AWS_SECRET_ACCESS_KEY": "secret", "AWS_DEFAULT_REGION": "us-east-1", "AWS_EC2_METADATA_DISABLED": "true"}
    environment = {**os.environ, **account, "PYTHONPATH": path, "AWS_ENDPOINT_URL": f"http://127.0.0.1:{port}", "MJSENSE_CACHE": str(cache)}

    def call(*words, code=0):
        done = subprocess.run([sys.executable, *map(str, words)], env=environment, capture_output=True, text=True, timeout=300)
        assert done.returncode == code, done.stdout[-2000:] + done.stderr[-3000:]
        return done.stdout + done.stderr

    with open(folder / "log", "w") as log:
        server = subprocess.Popen([sys.executable, "-m", "moto.server", "-H", "127.0.0.1", "-p", str(port)], env=environment, stdout=log, stderr=log)
        try:
            limit = time.monotonic() + 60
            while not listens(port) and time.monotonic() < limit:
                time.sleep(0.2)
            call("-c", "import s3fs; s3fs.S3FileSystem().mkdir('bucket')")
            yield call
        finally:
            server.kill()
            server.wait()


def tree(root):
    return {str(path.relative_to(root)): path.read_bytes() for path in root.rglob("*") if path.is_file()}


def test_record_read_repair_and_export_at_an_address(run, cache, tmp_path):
    mjs.record(**ARGUMENTS, out=tmp_path / "alone", num_attempts=4)
    run("-m", "mjsense", *RECORD)
    compare = "import sys; from test_cluster import content; print(content(sys.argv[1]) == content(sys.argv[2]))"
    assert run("-c", compare, "s3://bucket/pick", tmp_path / "alone").split()[-1] == "True"
    assert "different recording" not in run("-m", "mjsense", *RECORD, "--resume")
    assert "continue it with resume" in run("-m", "mjsense", *RECORD, code=2)

    assert "4 episodes" in run("-m", "mjsense", "inspect", "s3://bucket/pick")
    assert run("-m", "mjsense", "verify", "s3://bucket/pick/index.parquet").startswith("intact: ")
    run("-m", "mjsense", "export", "lerobot", "s3://bucket/pick", tmp_path / "exported", "-q", "--ray", "local")
    mjs.exporting.export_lerobot(tmp_path / "alone", tmp_path / "expected")
    assert tree(tmp_path / "exported") == tree(tmp_path / "expected")
    run("-m", "mjsense", "render", "s3://bucket/pick", "s3://bucket/large", "--width", "48", "--height", "32", "--ray", "local", "-q")
    assert run("-m", "mjsense", "verify", "s3://bucket/large").startswith("intact: ")

    damage = "import s3fs; s3 = s3fs.S3FileSystem(); f = s3.glob('bucket/pick/shard_1/house_0/*.h5')[0]; s3.pipe_file(f, s3.cat_file(f)[:5000])"
    run("-c", damage)
    shutil.rmtree(cache)  # it contains the intact shard
    assert "shard_1" in run("-m", "mjsense", "repair", "s3://bucket/pick")
    run("-m", "mjsense", *RECORD, "--resume")
    assert run("-m", "mjsense", "verify", "s3://bucket/pick").startswith("intact: ")
    assert run("-c", compare, "s3://bucket/pick", tmp_path / "alone").split()[-1] == "True"

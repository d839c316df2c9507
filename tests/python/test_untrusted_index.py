# SPDX-License-Identifier: Apache-2.0
"""An index and objects of a bucket that someone has changed on purpose: paths and keys leave neither the recording nor the cache."""

import io
import json
import shutil

import pytest
from edited_recordings import file_of

pa = pytest.importorskip("pyarrow")
pq = pytest.importorskip("pyarrow.parquet")
fsspec = pytest.importorskip("fsspec")
from fsspec.implementations.memory import MemoryFile

import mjsense as mjs
from mjsense.cluster import driver, tools
from mjsense.cluster import storage as cluster_storage
from mjsense.cluster.job import Job, ShardResult
from mjsense.cluster.storage import Storage
from mjsense.dataset import limits, remote

H5 = "trajectories_batch_1_of_1.h5"
ROW = {"episode": 0, "path": f"house_0/{H5}", "trajectory": "traj_0", "seed": 5, "length": 5, "success": False, "outcome": "x", "task": "t"}


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    out = tmp_path_factory.mktemp("made") / "data"
    mjs.record("pick", out=out, episodes=1, horizon=4, keep_failures=True, cameras=[], seed=5, progress=False)
    return out


@pytest.fixture
def root(made, tmp_path, monkeypatch):
    monkeypatch.setenv("MJSENSE_CACHE", str(tmp_path / "home/.cache/mjsense"))
    return shutil.copytree(made, tmp_path / "data")


def index_of(rows, **options):
    data = io.BytesIO()
    pq.write_table(rows if isinstance(rows, pa.Table) else pa.Table.from_pylist(rows), data, **options)
    return data.getvalue()


def upload(root, name, index, keys=()):
    """The recording at an address of the file system in memory, which permits any key, as object storage does."""
    system = fsspec.filesystem("memory")
    system.store.clear()
    contents = {f"house_0/{path.name}": path.read_bytes() for path in (root / "house_0").iterdir()} | {"index.parquet": index}
    for key, content in {**contents, **dict(keys)}.items():
        system.store[f"/{name}/{key}"] = MemoryFile(system, f"/{name}/{key}", content)
    return f"memory://{name}"


def files_below(folder):
    return {str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file()}


def test_a_right_index(root):
    (root / "index.parquet").write_bytes(index_of([ROW]))
    assert len(mjs.Dataset(root)) == 5
    assert len(mjs.Dataset(upload(root, "good", index_of([ROW])))) == 5


@pytest.mark.parametrize(
    "path",
    [f"/etc/house_0/{H5}", f"../data/house_0/{H5}", "/etc/passwd", f"house_0/../../other/{H5}", f"house_0/./{H5}", f"shard_x/house_0/{H5}",
     "house_0/x.h5", f"house_0/{H5}\n", f"house_{'9' * 5000}/{H5}", ""],
)  # fmt: skip
def test_a_path_is_that_of_a_file_of_the_recording(root, tmp_path, path):
    (root / "index.parquet").write_bytes(index_of([{**ROW, "path": path}]))
    before = files_below(tmp_path)
    for read in (lambda: mjs.Dataset(root), lambda: tools.verify(str(root)), lambda: mjs.Dataset(upload(root, "bad", index_of([{**ROW, "path": path}])))):
        with pytest.raises(ValueError, match=r"index\.parquet(:| row 0: path is .*it must have the form)"):
            read()
    assert {name for name in files_below(tmp_path) - before if not name.startswith("home/.cache/mjsense/")} == set()


@pytest.mark.parametrize(
    ("change", "text"),
    [({"trajectory": "../x"}, "trajectory is '../x'"), ({"trajectory": "traj_007"}, "trajectory is 'traj_007'"), ({"length": -1}, "length is -1"),
     ({"length": 10**12}, "length is 1000000000000"), ({"episode": -1}, "episode is -1"), ({"seed": "x"}, "the column 'seed' is string"),
     ({"length": None}, "the column 'length' is null"), ({"outcome": "x" * 100_000}, "has a text of more than 65536 characters"),
     ({"path": b"x"}, "the column 'path' is binary"), ({"outcome": ["x"]}, "the column 'outcome' is list<"),
     ({"length": [3]}, "the column 'length' is list<")],
)  # fmt: skip
def test_values_of_an_index(root, change, text):
    (root / "index.parquet").write_bytes(index_of([{**ROW, **change}]))
    with pytest.raises(ValueError, match=text.replace("'", ".")):
        mjs.Dataset(root)


def test_a_column_is_missing(root):
    (root / "index.parquet").write_bytes(index_of([{name: value for name, value in ROW.items() if name != "path"}]))
    with pytest.raises(ValueError, match=r"index\.parquet: the column 'path' is missing"):
        mjs.Dataset(root)


def test_an_index_that_unpacks_to_much_more(root, monkeypatch):
    """Filters with a large ratio are refused by name, and rows are counted before they are read."""
    many = pa.table({name: pa.array([value]).take(pa.array([0] * 50_000)) for name, value in ROW.items()})
    (root / "index.parquet").write_bytes(index_of(many, compression="zstd"))
    with pytest.raises(ValueError, match="is packed with ZSTD; it must be UNCOMPRESSED or SNAPPY"):
        mjs.Dataset(root)
    monkeypatch.setattr("mjsense.dataset.index.EPISODES", 49_999)
    (root / "index.parquet").write_bytes(index_of(many))
    with pytest.raises(ValueError, match="has 50000 rows, more than 49999"):
        mjs.Dataset(root)
    assert limits.EPISODES == 10_000_000
    for content in (b"", b"PAR1", b"x" * 1000):
        (root / "index.parquet").write_bytes(content)
        with pytest.raises(ValueError, match=r"index\.parquet: not a Parquet file that can be read"):
            mjs.Dataset(root)


@pytest.mark.parametrize("key", ["house_0/../../../../.bashrc", "house_0/../../ESCAPED", "house_0//x", "house_0/a/../../x", "house_0/./x"])
def test_a_key_that_leaves_the_folder(root, tmp_path, key):
    """Keys of object storage are texts: nothing of the folder is copied if one of them is not a path inside of it."""
    (tmp_path / "home").mkdir()
    (tmp_path / "home/.bashrc").write_text("mine")
    address = upload(root, "bucket", index_of([ROW]), {key: b"theirs"})
    before = files_below(tmp_path)
    with pytest.raises(ValueError, match=r"is not named as a file of the folder .*; nothing was copied"):
        mjs.Dataset(address)
    assert (tmp_path / "home/.bashrc").read_text() == "mine"
    assert all(name.startswith("home/.cache/mjsense/") and name.endswith("index.parquet") for name in files_below(tmp_path) - before)


def test_a_folder_of_a_link(root, tmp_path):
    """An index names files below its own folder, and no folder of it may be a link to another place."""
    (root / "house_0").rename(tmp_path / "moved")
    (root / "house_0").symlink_to(tmp_path / "moved")
    (root / "index.parquet").write_bytes(index_of([ROW]))
    with pytest.raises(OSError, match="house_0: is a symbolic link, which is not followed"):
        mjs.Dataset(root)


@pytest.mark.parametrize(
    "change", [{"shard": {"number": -1, "first": 0, "count": 1}}, {"shard": {"number": "../../x", "first": 0, "count": 1}}, {"episodes": [{**ROW, "path": "../x"}]},
               {"episodes": [7]}, {"episodes": [{**ROW, "length": "x"}]}, {"seconds": []}, {"more": 1}, {"failures": {"x": "y"}}],
)  # fmt: skip
def test_the_results_of_a_shard(change):
    good = {"shard": {"number": 0, "first": 0, "count": 1}, "fingerprint": "f", "episodes": [ROW], "succeeded": 0, "failed": 1, "steps": 4}
    assert ShardResult.parse(json.dumps(good).encode()).episodes == [ROW]
    with pytest.raises(ValueError, match=r"done\.json"):
        ShardResult.parse(json.dumps({**good, **change}).encode())


def test_an_object_that_is_too_large_is_not_read(root, monkeypatch):
    """Its size is checked before its bytes are in memory."""
    address = upload(root, "bucket", index_of([ROW]), {"job.json": b"[1]"})
    storage = Storage(address)
    assert storage.read_all("*.json") == [b"[1]"] and storage.read("none.json") is None and storage.read_all("none*") == []
    with pytest.raises(ValueError, match=r"job.json is a list, not an object"):
        driver._claim(storage, Job(address, {"task": "pick"}), {}, resume=True)
    system = fsspec.filesystem("memory")
    monkeypatch.setattr(type(system), "cat_file", lambda *_: pytest.fail("it was read"))
    for module in (remote, cluster_storage):
        monkeypatch.setattr(module, "OBJECT_BYTES", 2)
    for read in (lambda: mjs.Dataset(address), lambda: tools.repair(address), lambda: storage.read_all("*.json")):
        with pytest.raises(ValueError, match=r"(index.parquet|job.json|\*.json:?) .*has|have (\d+) bytes, more than 2"):
            read()


def test_the_file_is_there(root):
    assert file_of(root).name == H5

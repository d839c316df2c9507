# SPDX-License-Identifier: Apache-2.0
"""mjs.delete_episodes, split_dataset and merge_datasets."""

import json
import shutil

import h5py
import numpy as np
import pytest
from program_runs import run_program

import mjsense as mjs
from mjsense import commands

RECORDING = dict(num_worlds=2, keep_failures=True, width=32, height=24, horizon=4, depth=True, cameras=["wrist_camera"])


@pytest.fixture(scope="module")
def root(tmp_path_factory):
    """Five episodes in two HDF5 files, and two of another house."""
    out = tmp_path_factory.mktemp("data")
    mjs.record("pick", out=out, episodes=5, batches=2, seed=3, **RECORDING)
    mjs.record("pick", out=out, episodes=2, house=4, seed=3, **RECORDING)
    return out


def verified(out):
    done = run_program("verify", str(out), "--decode")
    assert done.returncode == 0 and "note" not in done.stdout, done.stdout + done.stderr
    return int(done.stdout.split(" episode")[0].split()[-1])


def contents(episode):
    """Every dataset of an episode with its attributes, and the bytes of its videos."""
    found = {"": {name: str(value) for name, value in h5py.File(episode.path)[episode.trajectory].attrs.items()}}
    with h5py.File(episode.path) as file:
        recording = file.attrs["recording"]
        file[episode.trajectory].visititems(lambda name, item: found.update({name: (
            np.asarray(item[()]).tobytes() if isinstance(item, h5py.Dataset) and item.dtype != object else str(item[()]) if hasattr(item, "dtype") else None,
            {key: np.asarray(value).tolist() for key, value in item.attrs.items()})}))  # fmt: skip
    for camera in ("wrist_camera", "wrist_camera_depth"):
        found[camera] = episode.video(camera).path.read_bytes()
    return recording, found


def assert_equal(out, *expected):
    """``out`` has these episodes, each equal in everything, and replays them."""
    got = mjs.Dataset(out).episodes
    assert verified(out) == len(expected) == len(got)
    for ours, theirs in zip(got, expected):
        assert contents(ours) == contents(theirs)
    assert mjs.check_replay(out, states=True)


def test_delete(root, tmp_path):
    episodes = mjs.Dataset(root).episodes
    before = {path: path.read_bytes() for path in root.rglob("*") if path.is_file()}
    assert mjs.delete_episodes(root, tmp_path / "some", [1, 5]) == tmp_path / "some"
    assert_equal(tmp_path / "some", *(episodes[i] for i in (0, 2, 3, 4, 6)))
    names = sorted(path.name for path in (tmp_path / "some").glob("*/*.h5"))
    assert names == ["trajectories_batch_1_of_1.h5", "trajectories_batch_1_of_2.h5", "trajectories_batch_2_of_2.h5"]
    whole = [path for path in root.glob("house_0/*.h5") if path.read_bytes() == (tmp_path / "some/house_0" / path.name).read_bytes()]
    assert [path.name for path in whole] == ["trajectories_batch_2_of_2.h5"]  # of which no episode is deleted
    mjs.delete_episodes(root, tmp_path / "one", [0, 1, 2, 3, 5, 6])
    assert_equal(tmp_path / "one", episodes[4])
    assert [path.name for path in (tmp_path / "one").iterdir()] == ["house_0"]
    assert before == {path: path.read_bytes() for path in root.rglob("*") if path.is_file()}


def test_split_and_merge(root, tmp_path):
    episodes = mjs.Dataset(root).episodes
    made = mjs.split_dataset(root, tmp_path / "parts", {"train": 0.7, "test": 0.3, "chosen": [6, 0]})
    assert made == {name: tmp_path / "parts" / name for name in ("train", "test", "chosen")}
    assert_equal(made["train"], *episodes[:5])
    assert_equal(made["test"], *episodes[5:])
    assert_equal(made["chosen"], episodes[0], episodes[6])
    assert mjs.merge_datasets([made["train"], made["test"]], tmp_path / "again") == tmp_path / "again"
    assert_equal(tmp_path / "again", *episodes)
    assert {path.relative_to(root): path.read_bytes() for path in root.rglob("*.*")} == {
        path.relative_to(tmp_path / "again"): path.read_bytes() for path in (tmp_path / "again").rglob("*.*")}  # fmt: skip
    mjs.merge_datasets([made["chosen"], root / "house_0"], tmp_path / "twice")
    assert_equal(tmp_path / "twice", episodes[0], episodes[6], *episodes[:5])
    assert sorted(path.name for path in (tmp_path / "twice").iterdir()) == ["house_0", "house_4", "house_5"]
    mjs.exporting.export_lerobot(tmp_path / "twice", tmp_path / "lerobot")
    assert json.loads((tmp_path / "lerobot/meta/info.json").read_text())["total_episodes"] == 7


def test_a_damaged_value_stays_visible(root, tmp_path):
    """A copy does not renew the checksums."""
    shutil.copytree(root / "house_4", tmp_path / "data/house_4")
    with h5py.File(next((tmp_path / "data").glob("*/*.h5")), "a") as file:
        file["traj_1/obs/extra/tcp_pose"][2, 0] += 1
    mjs.delete_episodes(tmp_path / "data", tmp_path / "out", [0])
    done = run_program("verify", str(tmp_path / "out"))
    assert done.returncode == 1 and "tcp_pose differs from what was recorded" in done.stdout


def test_an_attribute_that_is_never_recorded_is_refused(root, tmp_path):
    shutil.copytree(root / "house_4", tmp_path / "data/house_4")
    with h5py.File(next((tmp_path / "data").glob("*/*.h5")), "a") as file:
        file.attrs["reference"] = file["traj_0"].ref
    with pytest.raises(ValueError, match=r"\.h5: the attribute 'reference' is neither a text nor numbers"):
        mjs.delete_episodes(tmp_path / "data", tmp_path / "out", [0])
    assert not (tmp_path / "out").exists()


def test_errors(root, tmp_path):
    out = tmp_path / "out"
    for call, message in (
        (lambda: mjs.delete_episodes(root, out, [7]), "episodes: 7 is not the position of an episode: 0 to 6"),
        (lambda: mjs.delete_episodes(root, out, range(7)), "all 7 episodes are to be deleted"),
        (lambda: mjs.split_dataset(root, out, {"a": 0.7, "b": 0.4}), "the share of 'b' is 0.4; shares are above 0 and at most 1 together"),
        (lambda: mjs.split_dataset(root, out, {"a": 0.01}), "parts: 'a' has no episode"),
        (lambda: mjs.split_dataset(root, out, {"../a": 0.5}), "'../a' cannot be the name of a folder"),
        (lambda: mjs.split_dataset(root, out, {}), "at least one part is needed"),
        (lambda: mjs.merge_datasets([], out), "at least one recording is needed"),
    ):
        with pytest.raises(ValueError, match=message):
            call()
    mjs.record("pick", out=tmp_path / "20", policy_dt_ms=50, **RECORDING)
    with pytest.raises(ValueError, match=r"has 500/33, .* has 20 observations per second; a data set has one rate"):
        mjs.merge_datasets([root, tmp_path / "20"], out)
    with pytest.raises(FileExistsError, match="exists; name another output"):
        mjs.merge_datasets([root], tmp_path / "20")
    assert [path.name for path in tmp_path.iterdir()] == ["20"]


def test_program(root, tmp_path, capsys):
    def run(*words):
        code = commands.run(["dataset", *map(str, words)])
        printed = capsys.readouterr()
        return code, printed.out + printed.err

    assert run("delete", root, tmp_path / "some", "--episodes", 1, 5) == (0, f"Wrote {tmp_path}/some.\n")
    assert run("split", root, tmp_path / "parts", "--parts", "a=0-2,6", "b=0.5") == (0, f"Wrote {tmp_path}/parts/a, {tmp_path}/parts/b.\n")
    assert [len(mjs.Dataset(tmp_path / "parts" / name).episodes) for name in "ab"] == [4, 4]
    assert run("merge", tmp_path / "parts/a", tmp_path / "some", tmp_path / "all")[0] == 0
    assert len(mjs.Dataset(tmp_path / "all").episodes) == 9
    for words, message in (
        (("delete", root, tmp_path / "x"), "delete: --episodes is missing"),
        (("merge", root, tmp_path / "x", "--parts", "a=1"), "merge: --parts is an option of another action"),
        (("split", root, root, tmp_path / "x", "--parts", "a=1"), "split: 2 recordings and the output"),
        (("merge", root), "merge: 0 recordings and the output"),
        (("split", root, tmp_path / "x", "--parts", "a=b"), "--parts: 'a=b' is not of the form NAME=0.8 or NAME=0-9,12"),
        (("split", root, tmp_path / "x", "--parts", "a=0", "a=1-2"), "--parts: a name is given twice"),
    ):
        code, printed = run(*words)
        assert code == 2 and message in printed and printed.count("\n") == 1, printed

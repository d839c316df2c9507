# SPDX-License-Identifier: Apache-2.0
"""Tests of `mjsense record`: contents of the files, reproducibility from the seed, and clean termination."""

import json
import pathlib
import re
import signal
import subprocess
import time

import h5py
import mujoco
import numpy as np
import pytest

# Small images and few steps: sufficient for every test that does not need a successful episode.
QUICK = ["record", "pick", "--size", "64x48", "--horizon", "6", "--keep-failures", "-q"]


def rows(dataset):
    return [json.loads(bytes(row).rstrip(b"\0")) for row in dataset[()]]


def contents(folder):
    """{path relative to the folder: bytes} of the files of a recording."""
    folder = pathlib.Path(folder)
    return {str(p.relative_to(folder)): p.read_bytes() for p in sorted(folder.rglob("*")) if p.is_file()}


def video_of(mp4):
    out = subprocess.run(
        ["ffprobe", "-v", "error", "-count_packets", "-select_streams", "v", "-show_entries",
         "stream=nb_read_packets,width,height,r_frame_rate", "-of", "json", mp4],
        capture_output=True, text=True, check=True)
    return json.loads(out.stdout)["streams"][0]


def check_cameras(traj, house, start, T):
    for camera in ("wrist_camera", "exo_camera_1"):
        param = traj[f"obs/sensor_param/{camera}"]
        E, K, X = (param[k][0] for k in ("extrinsic_cv", "intrinsic_cv", "cam2world_gl"))
        np.testing.assert_allclose(E, np.linalg.inv(X)[:3], atol=1e-12)
        name = bytes(traj[f"obs/sensor_data/{camera}"][()]).rstrip(b"\0").decode()
        video = video_of(house / name)
        assert int(video["nb_read_packets"]) == T
        assert (video["width"], video["height"], video["r_frame_rate"]) == (160, 96, "500/33")
        points = traj[f"obs/extra/object_image_points/pickup_obj/{camera}/points"]
        assert points.shape == (T, 10, 2) and points.dtype == np.float32
        if camera == "exo_camera_1":  # the object is visible at the projection of its pose
            p = E @ [*start[:3], 1.0]
            assert np.abs(np.nanmean(points[0], axis=0) - (K @ p)[:2] / p[2] / (160, 96)).max() < 0.05


def check_actions(traj, T):
    """Row t is the action that led to observation t; the last row is the done sentinel."""
    actions = {k: rows(v) for k, v in traj["actions"].items()}
    assert all(len(v) == T for v in actions.values())
    assert actions["commanded_action"][0] == {} and actions["commanded_action"][-1] != {}
    for key in ("joint_pos", "joint_pos_rel", "ee_twist", "ee_pose"):
        assert actions[key][-1] == {} and actions[key][1] != {}, key
    qpos = rows(traj["obs/agent/qpos"])
    for t in range(1, T - 1):
        rel = np.array(actions["joint_pos"][t]["arm"]) - np.array(qpos[t - 1]["arm"])
        np.testing.assert_allclose(actions["joint_pos_rel"][t]["arm"], rel, atol=1e-6)
    panda = traj["env_states/articulations/panda"]
    assert panda.shape == (T, 31) and panda.dtype == np.float32
    np.testing.assert_allclose(panda[5, :7], qpos[5]["arm"], atol=1e-6)


def test_molmospaces_readers_accept_a_pick(mjsense):
    done = mjsense("record", "pick", "--robot", "franka", "--episodes", 2, "--worlds", 2, "--size", "160x96",
                   "--out", "data", "--json", "-q")
    summary = json.loads(done.stdout)
    assert summary["kept"] == 2 and summary["succeeded"] == 2
    house = mjsense.folder / "data/house_0"
    with h5py.File(house / "trajectories_batch_1_of_1.h5") as file:
        assert sorted(k for k in file if k.startswith("traj_")) == ["traj_0", "traj_1"]
        for i in range(2):
            traj = file[f"traj_{i}"]
            T = len(traj["success"])
            assert T in summary["observations"]
            assert traj["success"][-1] and not traj["success"][0]
            assert (traj["fail"][()] == ~traj["success"][()]).all()
            assert list(np.flatnonzero(traj["terminated"])) == [T - 1]
            scene = json.loads(traj["obs_scene"][()])
            assert scene["task_type"] == "pick" and scene["policy_dt_ms"] == 66
            assert {"task_description", "referral_expressions", "policy_phases", "text", "object_name"} <= set(scene)
            check_actions(traj, T)
            actors = traj["env_states/actors"]
            assert len(actors) >= 5 and all(a.shape == (T, 13) for a in actors.values())
            start = traj["obs/extra/obj_start"][0]
            assert any(np.allclose(a[0, :7], start, atol=1e-3) and a[-1, 2] > start[2] + 0.01 for a in actors.values())
            assert traj["obs/extra/policy_phase"].dtype == np.int64
            check_cameras(traj, house, start, T)
    assert pathlib.Path(mjsense.folder, summary["contact_sheet"]).read_bytes().startswith(b"\x89PNG")
    mjsense("verify", "data")


def test_absent_objects_are_marked(mjsense):
    """`floor` has 12 objects, of which an episode uses 6 to 10. The others are NaN in the file and marked as absent."""
    mjsense("record", "nav_to_obj", "--episodes", 2, "--horizon", 3, "--keep-failures", "--cameras", "none", "--no-sheet", "--out", "data")
    with h5py.File(mjsense.folder / "data/house_0/trajectories_batch_1_of_1.h5") as file:
        for traj in file.values():
            present = {name: flags[()] for name, flags in traj["env_states/present"].items()}
            articulations = set(traj["env_states/articulations"])
            assert set(present) == set(traj["env_states/actors"]) | articulations and len(present) - len(articulations) == 12
            assert all(present.pop(name).all() for name in articulations)
            assert all(flags.dtype == bool and (flags == flags[0]).all() for flags in present.values())
            assert 6 <= sum(flags[0] for flags in present.values()) <= 10
            for name, flags in present.items():
                rows_of = traj["env_states/actors"][name][()]
                assert np.isfinite(rows_of).all() if flags[0] else np.isnan(rows_of).all(), name
                assert not flags[0] or np.abs(rows_of[:, :3]).max() < 50
            scene = json.loads(traj["obs_scene"][()])
            target = scene["objects"]["pickup_obj"]
            assert present[target["actor"]].all() and target["body"].rpartition("/")[2] in target["actor"]
    mjsense("verify", "data")
    told = json.loads(mjsense("inspect", "data", "--json").stdout)
    actors = [stream for stream in told["streams"] if "env_states/actors/" in stream["name"]]
    assert actors and all(np.max(stream["max"]) < 50 for stream in actors if stream["count"] > 0)


def test_task_info_is_standard_json(mjsense):
    mjsense("record", "pick_and_place", "--episodes", 2, "--horizon", 3, "--keep-failures", "--cameras", "none", "--no-sheet", "--out", "data")
    with h5py.File(mjsense.folder / "data/house_0/trajectories_batch_1_of_1.h5") as file:
        for traj in file.values():
            for row in traj["obs/extra/task_info"][()]:
                info = json.loads(row.tobytes().rstrip(b"\0"), parse_constant=lambda word: pytest.fail(f"bare {word}"))
                assert info["carry_forward_pos_diff"] is None or info["supported_by_receptacle"]
            roles = json.loads(traj["obs_scene"][()])["objects"]
            assert set(roles) == {"pickup_obj", "place_receptacle"} and all({"body", "actor"} == set(r) for r in roles.values())


def test_bytes_do_not_depend_on_worlds_and_threads(mjsense):
    common = [*QUICK, "--episodes", 3, "--no-sheet"]
    mjsense(*common, "--seed", 5, "--worlds", 1, "--threads", 1, "--out", "a")
    mjsense(*common, "--seed", 5, "--worlds", 3, "--threads", 2, "--out", "b")
    mjsense(*common, "--seed", 6, "--out", "c")
    a, b, c = (contents(mjsense.folder / folder) for folder in "abc")
    assert a == b
    assert a["house_0/trajectories_batch_1_of_1.h5"] != c["house_0/trajectories_batch_1_of_1.h5"]


def episodes_of(root):
    """{number of the attempt: its attributes, arrays and videos}"""
    found = {}
    for path in root.rglob("*.h5"):
        with h5py.File(path) as file:
            for traj in file.values():
                one = {"attributes": dict(traj.attrs.items())}

                def visit(name, item, one=one, path=path):
                    if not isinstance(item, h5py.Dataset):
                        return
                    value = item[()]
                    one[name] = (str(item.dtype), item.shape, value if isinstance(value, bytes) else value.tobytes(),
                                 {key: np.asarray(attribute).tolist() for key, attribute in item.attrs.items()})  # fmt: skip
                    if name.startswith("obs/sensor_data/"):
                        video = value.tobytes().rstrip(b"\0").decode()
                        one[video] = (path.parent / video).read_bytes()

                traj.visititems(visit)
                assert one["attributes"]["episode"] not in found
                found[one["attributes"]["episode"]] = one
    return found


def test_shards_have_the_episodes_of_one_run(mjsense):
    import mjsense as mjs

    job = ["record", "pick", "--size", "64x48", "--scene", "shelf", "--horizon", 70, "--no-sheet", "-q", "--num-attempts", 5]
    mjsense(*job, "--worlds", 2, "--out", "one")
    for k in range(2):
        mjsense(*job, "--worlds", 1 + k, "--shard", f"{k}/2", "--out", "parts")
    one, parts = episodes_of(mjsense.folder / "one"), episodes_of(mjsense.folder / "parts")
    assert one == parts and 0 < len(one) < 5
    archives = {path.read_bytes() for path in mjsense.folder.rglob("model_*.zip")}
    assert len(archives) == 1
    mjsense("verify", "parts")
    read = mjs.Dataset(mjsense.folder / "parts")
    assert [episode.number for episode in read.episodes] == [episode.number for episode in mjs.Dataset(mjsense.folder / "one").episodes] == sorted(one)
    # A shard can be resumed, and is complete when all its attempts are decided.
    summary = json.loads(mjsense(*job, "--shard", "1/2", "--out", "parts", "--overwrite", "--json").stdout)
    assert summary["attempts"] == 2 and summary["kept"] <= summary["wanted"] <= 2
    assert "shard '0/8': num_attempts is 5" in mjsense(*job, "--shard", "0/8", "--out", "parts", rc=2).stderr
    assert "leave out episodes" in mjsense(*job, "--episodes", 2, "--out", "no", rc=2).stderr


def test_append_and_overwrite(mjsense):
    job = [*QUICK, "--cameras", "none", "--no-sheet"]
    mjsense(*job, "--episodes", 3, "--out", "whole")
    mjsense(*job, "--episodes", 2, "--out", "data")
    assert "append to it" in mjsense(*job, "--out", "data", rc=2).stderr
    assert "'settings/seed' was 0 and is now 1" in mjsense(*job, "--seed", 1, "--append", "--out", "data", rc=2).stderr
    mjsense(*job, "--append", "--out", "data")
    assert episodes_of(mjsense.folder / "data") == episodes_of(mjsense.folder / "whole")
    mjsense("verify", "data")
    mjsense(*job, "--episodes", 3, "--overwrite", "--out", "data")
    assert contents(mjsense.folder / "data") == contents(mjsense.folder / "whole")


def test_houses_have_their_own_random_numbers(mjsense):
    job = [*QUICK, "--cameras", "none", "--no-sheet", "--no-replay"]
    mjsense(*job, "--out", "data")
    mjsense(*job, "--house", 1, "--out", "data")
    mjsense(*job, "--house", 1, "--out", "again")
    a, b, c = (episodes_of(mjsense.folder / path)[0] for path in ("data/house_0", "data/house_1", "again"))
    assert b == c and a["obs/extra/obj_start"] != b["obs/extra/obj_start"]
    assert a["attributes"]["seed"] == 0 and b["attributes"]["seed"] != 0


def test_policy_period(mjsense):
    mjsense(*QUICK, "--policy-dt", 50, "--keyint", 3, "--cameras", "wrist_camera", "--no-sheet", "--out", "data")
    house = mjsense.folder / "data/house_0"
    assert video_of(house / "episode_00000000_wrist_camera.mp4")["r_frame_rate"] == "20/1"
    with h5py.File(house / "trajectories_batch_1_of_1.h5") as file:
        recording = json.loads(file.attrs["recording"])
        assert recording["fps"] == "20" and recording["settings"]["policy_dt_ms"] == 50 and recording["video"]["keyint"] == 3
        assert json.loads(file["traj_0/obs_scene"][()])["policy_dt_ms"] == 50
    frames = subprocess.run(["ffprobe", "-v", "error", "-select_streams", "v", "-show_entries", "frame=pict_type", "-of", "csv=p=0",
                             house / "episode_00000000_wrist_camera.mp4"], capture_output=True, text=True, check=True).stdout
    assert "".join(frames.replace(",", "").split()) == "IPPIPPI"
    packets = subprocess.run(["ffprobe", "-v", "error", "-select_streams", "v", "-show_entries", "packet=pts,dts", "-of", "csv=p=0",
                              house / "episode_00000000_wrist_camera.mp4"], capture_output=True, text=True, check=True).stdout.split()
    assert all(len(set(packet.strip(",").split(","))) == 1 for packet in packets) and len(packets) == 7  # decoded in the order of time
    assert "policy_dt_ms = 5 must be a positive multiple" in mjsense(*QUICK, "--policy-dt", 5, "--out", "no", rc=2).stderr


def test_every_dataset_is_described(mjsense):
    mjsense(*QUICK, "--depth", "--segmentation", "--out", "data")
    with h5py.File(mjsense.folder / "data/house_0/trajectories_batch_1_of_1.h5") as file:

        def described(name, item):
            if isinstance(item, h5py.Dataset):
                assert {"unit", "frame", "description"} <= set(item.attrs) and item.attrs["description"], name

        file["traj_0"].visititems(described)
        for name in ("numbers/actions/joint_pos/arm", "replay/state", "env_states/present/franka", "rewards", "obs_scene"):
            assert name in file["traj_0"]


def test_depth_is_kept(mjsense):
    mjsense(*QUICK, "--depth", "--cameras", "wrist_camera", "--out", "data")
    names = [p.name for p in (mjsense.folder / "data/house_0").iterdir()]
    assert [n for n in names if n == "episode_00000000_wrist_camera_depth.mkv"]
    mjsense("verify", "data", "--decode")


def test_segmentation_is_kept(mjsense):
    import mjsense as mjs

    mjsense(*QUICK, "--segmentation", "--cameras", "wrist_camera", "--out", "data")
    mjsense("verify", "data")
    with h5py.File(mjsense.folder / "data/house_0/trajectories_batch_1_of_1.h5") as file:
        traj = file["traj_0"]
        seen = traj["obs/extra/wrist_camera_segmentation"]
        assert seen.shape == (len(traj["success"]), 48, 64, 2) and seen.dtype == np.int32
        assert json.loads(file.attrs["recording"])["settings"]["cameras"][0]["segmentation"] is True
        rows = seen[()]
    assert set(np.unique(rows[..., 1])) <= {-1, int(mujoco.mjtObj.mjOBJ_GEOM)} and len(np.unique(rows[..., 0])) > 3
    options = {"num_envs": 1, "cameras": ["wrist_camera"], "width": 64, "height": 48, "segmentation": True}
    env = mjs.make_vec("pick", observations=["wrist_camera_segmentation"], **options)
    observation, _ = env.reset(seed=0)
    np.testing.assert_array_equal(observation["wrist_camera_segmentation"][0], rows[0])
    env.close()
    assert "wrist_camera_segmentation" in mjsense("sensors", "pick", "--segmentation").stdout
    with_key = mjsense.folder / "job.toml"
    with_key.write_text("segmentation = true\n")
    mjsense(*QUICK, "--config", with_key, "--cameras", "wrist_camera", "--out", "again")
    with h5py.File(mjsense.folder / "again/house_0/trajectories_batch_1_of_1.h5") as file:
        np.testing.assert_array_equal(file["traj_0/obs/extra/wrist_camera_segmentation"], rows)
    assert "settings/cameras" in mjsense(*QUICK, "--cameras", "wrist_camera", "--out", "data", "--resume", rc=2).stderr


def test_without_cameras(mjsense):
    mjsense(*QUICK, "--cameras", "none", "--no-replay", "--out", "data")
    assert [p.name for p in (mjsense.folder / "data/house_0").iterdir()] == ["trajectories_batch_1_of_1.h5"]
    with h5py.File(mjsense.folder / "data/house_0/trajectories_batch_1_of_1.h5") as file:
        assert "replay" not in file["traj_0"]


def test_failures_are_kept_only_on_request(mjsense):
    done = mjsense("record", "pick", "--cameras", "none", "--horizon", 4, "--max-attempts", 3, "--out", "data", "-q",
                   "--json", rc=1)
    summary = json.loads(done.stdout)
    assert summary["kept"] == 0 and summary["failures"] == {"horizon reached: the object is not lifted": 3}
    assert "stopped after 3 attempts" in done.stderr
    assert not [path for path in (mjsense.folder / "data").rglob("*") if path.is_file()]  # the model, without an episode, is removed


def test_recording_contains_the_reason_of_a_failure(mjsense):
    args = ("record", "pick", "--scene", "shelf", "--cameras", "none", "--episodes", 3, "--max-attempts", 3, "--keep-failures", "-q")
    mjsense(*args, "--horizon", 30, "--out", "data")
    with h5py.File(mjsense.folder / "data/house_0/trajectories_batch_1_of_1.h5") as file:
        outcomes = {name: traj.attrs["outcome"] for name, traj in file.items()}
        assert {name for name, outcome in outcomes.items() if outcome == "success"} == {
            name for name, traj in file.items() if traj["success"][-1]}  # fmt: skip
    failed = {name: outcome for name, outcome in outcomes.items() if outcome != "success"}
    # Parentheses contain details of one episode; outcomes are counted without them.
    counted = {name: outcome.split(" (")[0] for name, outcome in outcomes.items()}
    reasons = {counted[name] for name in failed}
    assert failed and reasons <= {"horizon reached: the object is not lifted", "the policy gave up: found no plan"}
    for outcome in failed.values():
        assert "found no plan" not in outcome or re.search(r" \(\d+ grasps: \d+ (out of reach|in collision|without)", outcome), outcome
    file = json.loads(mjsense("inspect", "data", "--json").stdout)["files"][0]
    assert {name: outcome for outcome, names in file["outcomes"].items() for name in names} == counted
    shown = mjsense("inspect", "data").stdout
    for outcome in reasons:
        names = [name for name, other in counted.items() if other == outcome]
        assert f"    {len(names)} x {outcome} ({', '.join(names)})\n" in shown
    assert " x success" not in shown
    mjsense(*args, "--horizon", 30, "--worlds", 1, "--out", "one")
    name = "house_0/trajectories_batch_1_of_1.h5"
    assert (mjsense.folder / "one" / name).read_bytes() == (mjsense.folder / "data" / name).read_bytes()


def test_config_file_and_command_line(mjsense):
    (mjsense.folder / "job.toml").write_text(
        'task = "pick"\nepisodes = 2\nsize = "64x48"\ncameras = ["exo_camera_1"]\nhorizon = 6\nkeep_failures = true\n'
        'seed = 5\nout = "data"\n')
    done = mjsense("record", "--config", "job.toml", "--episodes", 1, "--json", "-q")
    assert json.loads(done.stdout)["wanted"] == 1
    assert len(list((mjsense.folder / "data/house_0").glob("*.mp4"))) == 1


def interrupt(mjsense, args, signals):
    """Starts the program and sends it the signals as soon as episodes run."""
    process = subprocess.Popen([*mjsense.program, *map(str, args)], cwd=mjsense.folder, stdout=subprocess.PIPE,
                               stderr=subprocess.PIPE, text=True)
    running = mjsense.folder / "data/house_0/.recording"
    deadline = time.time() + 60
    while not list(running.glob("episode_*")) and time.time() < deadline:
        time.sleep(0.01)
    for each in signals:
        process.send_signal(each)
        time.sleep(0.05)
    err = process.communicate(timeout=120)[1]
    return process.returncode, err


@pytest.mark.parametrize("signals", [[signal.SIGINT], [signal.SIGINT, signal.SIGINT], [signal.SIGKILL]],
                         ids=["once", "twice", "killed"])
def test_resumed_recording_equals_an_uninterrupted_one(mjsense, signals):
    args = ["record", "pick", "--size", "64x48", "--horizon", 30, "--keep-failures", "--no-sheet", "--episodes", 4]
    code, err = interrupt(mjsense, [*args, "--worlds", 2, "--out", "data"], signals)
    if signals == [signal.SIGKILL]:
        assert code == -signal.SIGKILL
    else:
        assert code == 1 and "Continue with --resume" in err
        house = mjsense.folder / "data/house_0"
        finished = [*house.glob("*.h5"), *house.glob(".recording/episode_????????")]
        assert ("mjsense repair" in err) == bool(finished)  # which needs a finished episode
    mjsense(*args, "--worlds", 1, "--out", "data", "--resume", "-q")
    mjsense(*args, "--worlds", 4, "--out", "whole", "-q")
    assert contents(mjsense.folder / "data") == contents(mjsense.folder / "whole")


def test_recording_with_a_changed_scene_cannot_be_resumed(mjsense):
    scene = mjsense.folder / "scene.toml"
    scene.write_text('name = "mine"\nextends = "table"\ngap = 0.02\n')
    args = ["record", "pick", "--scene", scene, "--cameras", "none", "--horizon", 3, "--keep-failures", "--episodes", 2, "--out", "data", "-q"]
    mjsense(*args, "--max-attempts", 1, rc=1)
    scene.write_text('name = "mine"\nextends = "table"\ngap = 0.03\n')
    assert "'settings/scene_file/gap' was" in mjsense(*args, "--resume", rc=2).stderr
    scene.write_text('name = "mine"\nextends = "table"\ngap = 0.02\n')
    assert "is complete" in mjsense(*args, "--resume", rc=2).stderr  # with the original scene the recording is accepted again


def test_progress_without_a_terminal_is_plain_lines(mjsense):
    done = mjsense("record", "pick", "--cameras", "none", "--horizon", 4, "--keep-failures", "--out", "data")
    assert "1/1 episodes" in done.stderr and "\r" not in done.stderr and "\033" not in done.stderr
    assert "trajectories_batch_1_of_1.h5" in done.stdout

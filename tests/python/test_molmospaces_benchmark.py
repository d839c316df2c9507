# SPDX-License-Identifier: Apache-2.0
"""Benchmarks of MolmoSpaces: they are played from the states that they give, written from benchmarks of mjsense, and checked."""

import copy
import json

import numpy as np
import pytest

import mjsense as mjs
from mjsense.evaluation import create_benchmark, evaluate, export_molmospaces
from mjsense.evaluation.molmospaces_episodes import read_episode

SMALL = {"width": 32, "height": 24, "shadows": False}


@pytest.fixture(scope="module")
def exported(tmp_path_factory):
    """A benchmark, and the same as MolmoSpaces' file."""
    folder = tmp_path_factory.mktemp("exported")
    benchmark = create_benchmark("pick", out=folder / "bench", episodes=3, seed=4, horizon=120, camera_system="easy_randomized_droid", progress=False, **SMALL)
    assert export_molmospaces(benchmark, folder / "theirs") == 3
    return benchmark, folder / "theirs"


def specs_of(folder):
    return json.loads((folder / "benchmark.json").read_text())


def written(folder, specs):
    folder.mkdir(exist_ok=True)
    (folder / "benchmark.json").write_text(json.dumps(specs))
    return folder


def body_pose(episode, name, row=0):
    model = episode.model()
    joint = model.body_jntadr[model.body(name).id]
    return episode.states[row][1 + model.jnt_qposadr[joint] :][:7]


def test_an_exported_benchmark_is_played_from_the_same_starts_with_the_same_outcomes(exported, tmp_path):
    benchmark, theirs = exported
    ours = evaluate(benchmark.folder, out=tmp_path / "a", progress=False)
    again = evaluate(theirs, out=tmp_path / "b", num_worlds=2, progress=False)
    names = ("episode", "seed", "success", "steps", "object", "light", "instruction", "failure")
    rows = [[{name: row[name] for name in names} for row in one.to_table().to_pylist()] for one in (ours, again)]
    assert rows[0] == rows[1] and any(row["success"] for row in rows[0])
    for one, other in zip(mjs.Dataset(tmp_path / "a").episodes, mjs.Dataset(tmp_path / "b").episodes, strict=True):
        np.testing.assert_array_equal(other.states, one.states)
        cameras = one.obs_scene["cameras"], other.obs_scene["cameras"]
        for name in cameras[0]:
            for key in cameras[0][name]:
                if key != "body":
                    np.testing.assert_allclose(cameras[1][name][key], cameras[0][name][key], atol=1e-12)
        assert np.abs(one.video("exo_camera_1")[0].astype(float) - other.video("exo_camera_1")[0]).mean() < 1
    about = json.loads((tmp_path / "b/evaluation.json").read_text())
    assert about["benchmark"]["name"] == "theirs" and about["episodes"] == benchmark.episodes


@pytest.mark.parametrize("task", ("pick_and_place", "open", "close", "nav_to_obj", "door_opening", "pick_and_place_next_to"))
def test_tasks(task, tmp_path):
    options = {"robot": "rby1"} if task in ("nav_to_obj", "door_opening") else {}
    benchmark = create_benchmark(task, out=tmp_path / "bench", episodes=2, horizon=4, progress=False, **SMALL, **options)
    export_molmospaces(benchmark, tmp_path / "theirs")
    evaluate(tmp_path / "theirs", out=tmp_path / "b", progress=False)
    starts = mjs.Dataset(benchmark.folder / "starts").episodes
    for one, other in zip(starts, mjs.Dataset(tmp_path / "b").episodes, strict=True):
        np.testing.assert_allclose(other.states[0], one.states[0], atol=1e-9)
        assert other.obs_scene["objects"] == one.obs_scene["objects"] and other.task == one.task


def test_what_the_file_gives_is_played(exported, tmp_path):
    _, theirs = exported
    specs = specs_of(theirs)[:1]
    spec = specs[0]
    poses = spec["scene_modifications"]["object_poses"]
    target = spec["task"]["pickup_obj_name"]
    other = next(name for name in poses if name != target)
    poses[target][0] += 0.01
    del poses[other]  # what the file does not have is absent
    spec["robot"]["init_qpos"]["arm"][0] = 0.2
    spec["task"]["robot_base_pose"][0] -= 0.02
    spec["task"]["succ_pos_threshold"] = 0.5  # higher than the planner lifts it
    spec["language"]["task_description"] = "Lift the thing"
    spec["cameras"] = [{"name": "top", "type": "exocentric", "pos": [0.5, 0, 2], "up": [1, 0, 0], "forward": [0, 0, -1], "fov": 50, "record_depth": False}]
    spec["mjsense"]["horizon"] = 60
    evaluate(written(tmp_path / "mine", specs), out=tmp_path / "out", progress=False)
    (episode,) = mjs.Dataset(tmp_path / "out").episodes
    np.testing.assert_array_equal(body_pose(episode, target), poses[target])
    assert body_pose(episode, other)[1] >= 100
    np.testing.assert_allclose(episode["obs/agent/qpos/arm"][0, 0], 0.2, atol=1e-6)
    np.testing.assert_allclose(episode["obs/agent/robot_base_pose"][0, 0] if "obs/agent/robot_base_pose" in episode.streams else spec["task"]["robot_base_pose"][0], spec["task"]["robot_base_pose"][0], atol=1e-6)
    assert episode.task == "Lift the thing" and not episode.success and "not lifted" in episode.outcome
    top = episode.obs_scene["cameras"]["top"]
    np.testing.assert_allclose([*top["pos"], *top["forward"], *top["up"], top["fovy"]], [0.5, 0, 2, 0, 0, -1, 1, 0, 0, 50], atol=1e-9)


MODEL = """
<mujoco>
  <worldbody>
    <light pos="0 0 3"/>
    <geom type="plane" size="3 3 0.1"/>
    <geom name="table" type="box" pos="0.55 0 0.2" size="0.3 0.4 0.02"/>
    <body name="cube" pos="0.5 0.1 0.24"><freejoint/><geom type="box" size="0.02 0.02 0.02" mass="0.05"/></body>
    <body name="ball" pos="0.6 -0.2 0.245"><freejoint/><geom type="box" size="0.025 0.02 0.02" mass="0.05"/></body>
  </worldbody>
</mujoco>"""


def foreign(**changes):
    spec = {
        "house_index": 7, "scene_dataset": "procthor-10k", "data_split": "val", "robot": {"robot_name": "franka_droid", "init_qpos": {"arm": [0, -0.7853, 0, -2.35619, 0, 1.57079, 0], "gripper": [0.00296, 0.00296]}},
        "img_resolution": [32, 24],
        "cameras": [{"name": "exo", "type": "robot_mounted", "reference_body_names": ["robot_0/fr3_link0"], "camera_offset": [0.1, 0.57, 0.66], "lookat_offset": [0, 0, 0], "camera_quaternion": [-0.3633, -0.1241, 0.4263, 0.8191], "fov": 71}],
        "scene_modifications": {"object_poses": {"cube": [0.5, -0.1, 0.241, 1, 0, 0, 0]}, "removed_objects": ["ball"]},
        "task": {"task_cls": "molmo_spaces.tasks.pick_task.PickTask", "robot_base_pose": [0, 0, 0, 1, 0, 0, 0], "pickup_obj_name": "cube", "pickup_obj_start_pose": [0.5, -0.1, 0.241, 1, 0, 0, 0]},
        "language": {"task_description": "Pick up the cube"},
    }  # fmt: skip
    return {**spec, **changes}


def test_episodes_in_models_of_the_caller(tmp_path):
    (tmp_path / "val_7.xml").write_text(MODEL)
    (tmp_path / "val_8.xml").write_text(MODEL.replace("0.6 -0.2 0.245", "0.6 -0.2 0.25"))
    moved = copy.deepcopy(foreign(house_index=8))
    moved["scene_modifications"] = {"object_poses": {"cube": [0.45, 0.05, 0.241, 1, 0, 0, 0]}}
    moved["task"]["pickup_obj_start_pose"] = [0.45, 0.05, 0.241, 1, 0, 0, 0]
    folder = written(tmp_path / "bench", [foreign(), moved, foreign()])
    found = evaluate(folder, policy="random", scene=str(tmp_path / "val_{house}.xml"), horizon=3, out=tmp_path / "out", progress=False)
    assert [(row.house, row.episode, row.instruction) for row in found.rows] == [(0, 0, "Pick up the cube"), (0, 2, "Pick up the cube"), (1, 1, "Pick up the cube")]
    episodes = mjs.Dataset(tmp_path / "out").episodes
    cube = next(name for name in [episodes[0].obs_scene["objects"]["pickup_obj"]["body"]])
    assert cube.endswith("cube")
    np.testing.assert_array_equal(body_pose(episodes[0], cube), [0.5, -0.1, 0.241, 1, 0, 0, 0])
    np.testing.assert_array_equal(body_pose(episodes[2], cube), [0.45, 0.05, 0.241, 1, 0, 0, 0])
    assert body_pose(episodes[0], cube.replace("cube", "ball"))[1] >= 100 and body_pose(episodes[2], cube.replace("cube", "ball"))[1] == -0.2


def test_a_file_for_each_episode(exported, tmp_path):
    _, theirs = exported
    for number, spec in enumerate(specs_of(theirs)):
        folder = tmp_path / f"bench/house_{number % 2}"
        folder.mkdir(parents=True, exist_ok=True)
        (folder / f"episode_{number:08}.json").write_text(json.dumps(spec))
    found = evaluate(tmp_path / "bench", policy="random", horizon=2, out=tmp_path / "out", progress=False)
    assert len(found.rows) == 3


def test_bodies_that_are_not_there_are_one_error(tmp_path):
    (tmp_path / "scene.xml").write_text(MODEL)
    spec = foreign()
    spec["scene_modifications"]["object_poses"] |= {"mug": [0, 0, 0, 1, 0, 0, 0], "Bowl_27": [0, 0, 1, 1, 0, 0, 0]}
    spec["scene_modifications"]["added_objects"] = {"Bowl_27": "objects/thor/Bowl_27.xml"}
    with pytest.raises(ValueError, match=r"given starts: the scene has no 'Bowl_27', 'mug'; its free bodies are '.*cube', '.*ball'"):
        evaluate(written(tmp_path / "bench", [spec]), policy="random", scene=str(tmp_path / "scene.xml"), out=tmp_path / "out", progress=False)


@pytest.mark.parametrize("specs, message", (
    ([{"scene_dataset": "procthor-10k", "house_index": house} for house in (7, 5, 5)] + [{"scene_dataset": "ithor", "data_split": "test", "house_index": 2}],
     r"4 episodes in the houses 2 of ithor \(test\); 5, 7 of procthor-10k \(val\)\. mjsense does not contain these scenes"),
    ([{"scene_dataset": "x" * 1000, "house_index": house} for house in range(99)], "99 episodes in the houses 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, ... of x{60} "),
    ([3, {"scene_dataset": [], "data_split": {}, "house_index": "0"}], "2 episodes in the houses that it does not state"),
), ids=("houses", "many", "other"))  # fmt: skip
def test_scenes_that_are_not_there_are_one_error(tmp_path, specs, message):
    with pytest.raises(ValueError, match=message):
        evaluate(written(tmp_path / "bench", specs), policy="random", out=tmp_path / "out")


@pytest.mark.parametrize("change, message", [
    (lambda s: s.update(img_resolution=[0, 10]), "img_resolution is"), (lambda s: s.update(img_resolution=[1e9, 10]), "img_resolution"),
    (lambda s: s.update(seed=-1), "seed is a number; expected a whole number from 0 on"), (lambda s: s.update(house_index="7"), "house_index is a text"),
    (lambda s: s["task"].update(task_cls="os.system"), "task_cls is 'system'; mjsense plays"), (lambda s: s["task"].update(robot_base_pose=[0] * 6), "robot_base_pose is a list; expected 7 numbers"),
    (lambda s: s["task"].update(robot_base_pose=[float("nan")] * 7), "robot_base_pose is nan; expected a number between"), (lambda s: s["task"].pop("pickup_obj_name"), "pickup_obj_name is null"),
    (lambda s: s["task"].update(succ_pos_threshold="high"), "succ_pos_threshold is a text"), (lambda s: s["task"].update(object_colors={"a": [1, 0, 0, 1]}), "it has object_colors"),
    (lambda s: s["robot"].update(init_qpos={"arm": [0] * 101}), "expected at most 100 numbers"),
    (lambda s: s["robot"].update(robot_name="/tmp/x/robot.toml"), "robot is '/tmp/x/robot.toml'; a benchmark can only contain names"), (lambda s: s.update(mjsense={"options": {"environment": "../x.exr"}}), "can only contain names"),
    (lambda s: s.update(mjsense={"options": {"ffmpeg": "sh"}}), "it has the option 'ffmpeg'"), (lambda s: s["robot"].update(init_qpos=[1]), "init_qpos is a list; expected an object"),
    (lambda s: s["cameras"][0].update(name="../x"), r"name is '\.\./x'; expected letters"), (lambda s: s["cameras"].append(s["cameras"][0]), "two cameras have the same name"),
    (lambda s: s["cameras"][0].update(camera_quaternion=[0] * 4), "camera_quaternion is 0"), (lambda s: s["cameras"][0].update(type="hidden"), "type is 'hidden'; expected robot_mounted or exocentric"),
    (lambda s: s["language"].update(task_description="a\x1b[2J"), "expected a text of 1 to 1000 printable characters"), (lambda s: s["scene_modifications"].update(object_poses={"x\n": [0] * 7}), "cannot be a name, which has 1 to 200 printable"),
    (lambda s: s["scene_modifications"].update(object_poses={"x": {}}), "x is an object; expected 7 numbers"), (lambda s: s["scene_modifications"].update(removed_objects="all"), "removed_objects is a text"),
    (lambda s: s.update(cameras=[{}] * 33), "expected a list of at most 32 objects"), (lambda s: s.update(mjsense={"episode": True}), "episode is true or false"),
], ids=range(25))  # fmt: skip
def test_a_hostile_file_is_refused(change, message):
    spec = copy.deepcopy(foreign())
    change(spec)
    with pytest.raises(ValueError, match=message):
        read_episode(spec, "benchmark.json: episode 0")


def test_files_that_are_no_benchmark(tmp_path, exported):
    (tmp_path / "benchmark.json").write_text("[" * 5000)
    with pytest.raises(ValueError, match="nested deeper"):
        evaluate(tmp_path, out=tmp_path / "out")
    (tmp_path / "benchmark.json").write_text("[]")
    with pytest.raises(ValueError, match="expected a list of 1 to"):
        evaluate(tmp_path, out=tmp_path / "out")
    with pytest.raises(ValueError, match="its episodes fix seed, which is given too"):
        evaluate(exported[1], seed=3, out=tmp_path / "out")
    with pytest.raises(ValueError, match="robot 'franka': group 'arm' has 7 joint positions, not 6"):
        specs = specs_of(exported[1])
        specs[0]["robot"]["init_qpos"]["arm"].pop()
        evaluate(written(tmp_path / "short", specs), policy="random", out=tmp_path / "out", progress=False)


def test_a_start_that_cannot_be_played_is_an_error_after_the_others(exported, tmp_path):
    specs = specs_of(exported[1])
    poses = specs[1]["scene_modifications"]["object_poses"]
    first, second = list(poses)[:2]
    poses[second] = poses[first]
    with pytest.raises(ValueError, match=r"1 of 3 episodes cannot be played: 1: scene 'varied_table': '.*' starts .* mm inside '.*'; the results"):
        evaluate(written(tmp_path / "bench", specs), policy="random", horizon=2, out=tmp_path / "out", progress=False)
    assert len(mjs.evaluation.results(tmp_path / "out").rows) == 2

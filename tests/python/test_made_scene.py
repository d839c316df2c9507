# SPDX-License-Identifier: Apache-2.0
"""Scenes that a user's function creates, for built-in tasks; cameras of an episode, frozen and used again."""

import json

import h5py
import numpy as np
import pytest

import mjsense as mjs

BENCH = """
<mujoco>
  <worldbody>
    <light name="lamp" pos="0.5 0 2.5" dir="0 0 -1"/>
    <geom type="plane" size="3 3 0.1"/>
    <geom name="top" type="box" size="0.3 0.5 0.02" pos="0.55 0 0.58"/>
  </worldbody>
</mujoco>"""
THINGS = {"mug": "mug", "can": "soup_can", "cube": "blue_cube"}
TOP = mjs.tasks.SceneRegionCfg(name="top", on="bench/top", area=(0.4, 0.75, -0.4, 0.4), target_area=(0.45, 0.62, -0.2, 0.2))
SMALL = dict(width=64, height=48)


def bench(xml=BENCH):
    things = {name: mjs.EntityCfg(model=f"embedded:objects/{model}.xml") for name, model in THINGS.items()}
    entities = {"bench": mjs.EntityCfg(model=xml, mocap_base=False), **things}
    return mjs.SceneCfg(entities=entities, options=mjs.MujocoCfg(cone="elliptic", impratio=10))


def scene(**fields):
    return mjs.SceneFileCfg(name="bench", models=bench, regions=[TOP], **fields)


def test_built_in_task_runs_in_the_scene(tmp_path):
    made = mjs.record("pick", scene=scene(count=(2, 3)), out=tmp_path, episodes=2, num_worlds=2, **SMALL)
    assert made.kept == 2, made.failures
    with h5py.File(made.path / "trajectories_batch_1_of_1.h5") as file:
        text = json.loads(file["traj_0/obs_scene"][()])["text"]
    assert text in {"Pick up the mug", "Pick up the soup can", "Pick up the blue cube"}


def test_objects_are_placed_in_the_regions():
    env = mjs.make_vec("pick", scene=scene(), num_envs=4, cameras=[])
    env.reset(seed=3)
    model, heights = env.sim.model, {}
    for name, kind in THINGS.items():
        heights[name] = env.sim.data.xpos[:, model.body(f"{name}/{kind}").id, 2]
        assert (heights[name] > 0.58).all() and (heights[name] < 0.75).all(), (name, heights)
    env.close()


def test_scene_may_be_a_function(tmp_path):
    """Without regions objects keep the poses of their models. Here two overlap, which is reported as an error."""
    made = mjs.record("pick", scene=bench, out=tmp_path, episodes=1, max_attempts=1, cameras=[])
    assert made.kept == 0 and "scene 'bench': 'mug' starts 42.0 mm inside" in next(iter(made.failures))


@pytest.mark.parametrize(
    "what, message",
    [
        (3, "scene must be the name or file of a scene"),
        (lambda: 3, r"models\(\) must return a mjsense.SceneCfg, not 3"),
        (mjs.SceneFileCfg(name="both", models=bench, base="x.xml"), "scene 'both': a scene whose models are made by code"),
        (mjs.SceneFileCfg(name="lost", models=bench, regions=[mjs.tasks.SceneRegionCfg(name="r", on="bench/tip")]), "bench/top"),
    ],
)
def test_errors_name_the_scene(what, message):
    with pytest.raises(Exception, match=message):
        mjs.make_vec("pick", scene=what, cameras=[])


def test_task_with_its_own_scene_accepts_no_other():
    class Mine(mjs.Task):
        def scene(self):
            return bench()

        def evaluate(self, sim):
            return np.zeros(sim.num_worlds), np.zeros(sim.num_worlds, bool)

    with pytest.raises(ValueError, match="makes its scene itself"):
        mjs.make_vec(Mine, robot="franka", scene=bench)


def test_a_recording_resumes_only_with_the_same_scene(tmp_path):
    options = dict(out=tmp_path, episodes=1, cameras=[])
    mjs.record("pick", scene=scene(), **options)
    other = mjs.SceneFileCfg(name="bench", models=lambda: bench(BENCH.replace("0.3 0.5 0.02", "0.3 0.5 0.03")), regions=[TOP])
    with pytest.raises(ValueError, match="'model/geom' was"):
        mjs.record("pick", scene=other, resume=True, **{**options, "episodes": 1})
    assert mjs.record("pick", scene=scene(), resume=True, **options).kept == 1


def camera_rows(path, key="traj_0"):
    with h5py.File(path / "trajectories_batch_1_of_1.h5") as file:
        rows = {name: [np.array(group[k]) for k in sorted(group)] for name, group in file[f"{key}/obs/sensor_param"].items()}
        return rows, json.loads(file[f"{key}/obs_scene"][()])


def test_frozen_cameras_have_the_recorded_poses(tmp_path):
    first = mjs.record("pick", camera_system="omni_purpose", out=tmp_path / "a", episodes=1, num_worlds=1, seed=5, **SMALL)
    rows, scene = camera_rows(first.path)
    frozen = tmp_path / "cameras.json"
    frozen.write_text(json.dumps(scene["cameras"]))
    again = mjs.record("pick", camera_system=str(frozen), out=tmp_path / "b", episodes=1, num_worlds=1, seed=5, **SMALL)
    same, _ = camera_rows(again.path)
    assert list(same) == list(rows) and len(rows) == 5
    for name in rows:
        for a, b in zip(rows[name], same[name]):
            np.testing.assert_allclose(a, b, atol=1e-5, err_msg=name)  # poses are float32 on their way


def test_errors_of_frozen_cameras(tmp_path):
    file = tmp_path / "cameras.json"
    for text, message in (("[]", "must be a JSON object of cameras by name"), ('{"eye": {"pos": [1, 2]}}', "'eye': 'pos' must be 3 numbers"),
                          ('{"eye": {"pos": [1, 2, 3], "fovy": 4, "quat": [1, 0, 0, 0], "body": "desk"}}', "body 'desk' does not belong to a robot")):  # fmt: skip
        file.write_text(text)
        with pytest.raises(ValueError, match=message):
            mjs.make_vec("pick", camera_system=str(file))


def test_policy_info_is_recorded(tmp_path):
    class Still(mjs.Policy):
        def act(self, obs):
            return {"done": np.ones(self.num_worlds, bool)}

        def info(self, world):
            return {"checkpoint": "step 9000"}

    made = mjs.record("pick", policy=Still, out=tmp_path, episodes=1, keep_failures=True, cameras=[])
    with h5py.File(made.path / "trajectories_batch_1_of_1.h5") as file:
        assert json.loads(file["traj_0/obs_scene"][()])["checkpoint"] == "step 9000"


@pytest.mark.parametrize("task", ["pick_and_place", "open", "door_opening", "nav_to_obj"])
def test_every_built_in_task_accepts_the_scene(task):
    """An error about something missing names this scene: no other scene is used instead."""
    empty = mjs.SceneFileCfg(name="nothing_there", models=lambda: mjs.SceneCfg(entities={"bench": mjs.EntityCfg(model=BENCH)}))
    with pytest.raises(Exception, match="nothing_there"):
        mjs.make_vec(task, "rby1", scene=empty, cameras=[])


def test_split_is_a_part_of_a_named_scene(tmp_path):
    env = mjs.make_vec("pick", scene="table", split="test", cameras=[])
    names = set(env.scene.entities)
    env.close()
    assert {"pear", "soup_can"} <= names and not {"mug", "marker"} & names
    mjs.record("pick", out=tmp_path / "data", split="train", horizon=2, num_worlds=1, keep_failures=True, cameras=[])
    assert mjs.Dataset(tmp_path / "data").episodes[0].settings["scene"] == "varied_table@train"
    with pytest.raises(ValueError, match="split is 'train', but the scene is an object"):
        mjs.make_vec("pick", scene=mjs.SceneFileCfg(name="made"), split="train")
